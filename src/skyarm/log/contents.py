"""Checks of a log file's arrays and description, and the log made of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from skyarm.log.flight_log import IF_ANY, Log, log_of_arrays
from skyarm.log.flown_scenario import Info
from skyarm.log.log_columns import group_of, layout
from skyarm.log.sensor_data import COMPONENTS, sources_of
from skyarm.log.team_log import SHARED, WITHIN, TeamLog
from skyarm.records.arrays import AnyArray
from skyarm.records.files import Fields, shown
from skyarm.records.leaves import field_names
from skyarm.records.plain import Plain

SCHEMA = 1

WORDS = "must be a log of schema 1"

SCALARS = (
    "time",
    "yaw_held",
    "yaw_reference",
    "load_mass_found",
    "push_deviation",
    "path_time",
    "phase",
)
"""Arrays with one number per instant."""

AGENTS = "agents"
"""Key of a file's description with those of the vehicles of a flight of several."""

LAYOUT = "columns"
"""Key of a file's description with the names and units of the arrays' columns."""


TEXTS = ("scenario", "status", "cause")
"""Text fields of every description."""

OTHERS: Mapping[str, type] = {
    "title": str,
    "controller": str,
    "plant": str,
    "integrator": str,
    "plant_vehicle": str,
    "model_vehicle": str,
    "scenario_record": dict,
    "windows": dict,
    "plugins": dict,
    "code": dict,
    "versions": dict,
    "phases": list,
    "waits": list,
    "digest": str,
}
"""Optional fields of a description and their types."""

OF_TEXTS = ("plugins", "code", "versions", "phases")
"""Tables and lists that contain only text."""

KINDS: Mapping[type, str] = {dict: "table", list: "list", str: "text"}


def log_info(log: Log) -> Info:
    """Metadata of a log for its file, with the column names of each array."""
    if isinstance(log, TeamLog):
        return {
            **log.info,
            AGENTS: {name: log_info(each) for name, each in log.agents.items()},
        }
    return {**log.info, LAYOUT: layout(log)}


def log_of(content: Mapping[str, AnyArray], info: Plain) -> Log:
    """Make a log from the arrays and metadata of a file, after checks.

    Raises:
        ValueError: one line, without the file's name: arrays are missing or of other
            shapes, or the description is not one of a flight.
    """
    if isinstance(info, dict) and AGENTS in info:
        return _log_of_team(content, info)
    absent = ["info", "received", *(name for name in IF_ANY if name not in content)]
    names = [name for name in field_names(Log) or () if name not in absent]
    if not isinstance(info, dict) or info.get("schema") != SCHEMA:
        raise ValueError(WORDS)
    axes = _axes(info)
    if sorted(content) != sorted([*names, *axes]):
        raise ValueError(WORDS)
    count = np.shape(content["time"])
    widths = {
        "joints": np.shape(content["joints"])[1:],
        "rotors": np.shape(content["rotor_speeds"])[1:],
    }
    for name, value in content.items():
        # a damaged file may hold bytes in place of an array
        array = np.asarray(value)
        if name in axes:
            width = axes[name]
        elif name in SCALARS:
            width = ()
        elif name in IF_ANY:
            # as many columns as the law or the flight has of them
            width = array.shape[1:2]
        else:
            width = widths.get(group_of(name), (4,) if name == "quaternion" else (3,))
        if (
            len(count) != 1
            or array.shape != (*count, *width)
            or array.ndim > 2
            # the file is from outside: other types would fail later, in the middle of a
            # plot
            or array.dtype != np.float64
        ):
            raise ValueError(WORDS)
    _require_description(info)
    return log_of_arrays(
        content, {name: value for name, value in info.items() if name != LAYOUT}
    )


def _log_of_team(content: Mapping[str, AnyArray], info: Info) -> TeamLog:
    """Make the log of several vehicles from the arrays and metadata of a file, after
    checks.

    Raises:
        ValueError: as :func:`log_of`.
    """
    agents, shared = info[AGENTS], info.get(SHARED, [])
    if not isinstance(agents, dict) or not agents or not _is_texts(shared):
        raise ValueError(WORDS)
    every = {name: array for name, array in content.items() if WITHIN not in name}
    logs = dict[str, Log]()
    taken = len(every)
    for name, each in agents.items():
        own = {
            key.partition(WITHIN)[2]: array
            for key, array in content.items()
            if key.startswith(f"{name}{WITHIN}")
        }
        # every array must be taken once: one of an unknown vehicle is damage
        taken += len(own)
        logs[name] = log_of({**own, **every}, each)
    if taken != len(content) or sorted(every) != sorted(
        ["time", *(f"{COMPONENTS}.{name}" for name in shared)]
    ):
        raise ValueError(WORDS)
    _require_description(info)
    return TeamLog(
        logs, {name: value for name, value in info.items() if name != AGENTS}
    )


def _is_texts(value: object) -> bool:
    """True for a list of texts."""
    return isinstance(value, list) and all(isinstance(each, str) for each in value)


def _axes(info: Info) -> dict[str, tuple[int, ...]]:
    """Shape at one instant of each logged array of sensors, estimate and components.

    Raises:
        ValueError: a damaged file.
    """
    try:
        sources = sources_of(info)
    except ValueError:
        raise ValueError(WORDS) from None
    return {
        f"{source}.{name}": (len(each.axes),) if each.axes else ()
        for source, of in sources.items()
        for name, each in of.fields.items()
    }


def _require_description(info: Info) -> None:
    """Raise an error if entries of a log file's metadata have wrong types.

    Raises:
        ValueError: one line: field, value, what is allowed.
    """
    fields = Fields(info, "info")
    for name in TEXTS:
        if not isinstance(fields.take(name), str):
            raise ValueError(f"info.{name} = {shown(info[name])}: must be a text")
    for name in ("duration", "end_time"):
        fields.number(name, low=0.0)
    rates = Fields(fields.take("rates_hz"), "info.rates_hz")
    for name in ("physics", "control", "reference"):
        rates.number(name, low=0.0, strict=True)
    for name, kind in OTHERS.items():
        if info.get(name) is not None and not isinstance(info[name], kind):
            raise ValueError(
                f"info.{name} = {shown(info[name])}: must be a {KINDS[kind]}"
            )
    for name in OF_TEXTS:
        texts = info.get(name) or []
        if not all(
            isinstance(each, str)
            for each in (texts.values() if isinstance(texts, dict) else texts)
        ):
            raise ValueError(f"info.{name} = {shown(texts)}: must hold texts only")
    for k, wait in enumerate(info.get("waits") or ()):
        fields = Fields(wait, f"info.waits[{k}]")
        for name in ("phase", "at", "timeout"):
            fields.number(name)
