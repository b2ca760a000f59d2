"""A log from what a file holds: its arrays and its description, checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import IF_ANY, Log, log_of_arrays
from skyarm.log.log_columns import JOINT_ARRAYS, ROTOR_ARRAYS
from skyarm.log.sensor_data import ESTIMATE, READINGS, sources_of
from skyarm.records.leaves import field_names
from skyarm.records.units import units

SCHEMA = 1

SCALARS = ("time", "yaw_held", "yaw_reference", "load_mass_found", "path_time", "phase")
"""Arrays of a number an instant."""

FOURS = ("quaternion",)

LAYOUT = "columns"
"""Key of a file's description that says the names and units of the arrays' columns."""


def log_of(content: Mapping[str, Any], info: Any, schema_words: str) -> Log:
    """The log that a file's arrays and description make.

    Raises:
        ValueError: ``schema_words``: arrays are missing or of other shapes, or the description is none.
    """
    absent = ["info", "received", *(name for name in IF_ANY if name not in content)]
    wanted = [name for name in field_names(Log) or () if name not in absent]
    axes = _axes(info) if isinstance(info, dict) and info.get("schema") == SCHEMA else None
    if axes is None or sorted(content) != sorted([*wanted, *axes]):
        raise ValueError(schema_words)
    count = np.shape(content["time"])
    joints, rotors = np.shape(content["joints"])[1:], np.shape(content["rotor_speeds"])[1:]
    for name in wanted:
        width = (3,) if name not in SCALARS else ()
        width = joints if name in JOINT_ARRAYS else rotors if name in ROTOR_ARRAYS else (4,) if name in FOURS else width
        array = np.asarray(content[name])
        width = array.shape[1:2] if name in IF_ANY and name not in SCALARS else width
        if len(count) != 1 or array.shape != (*count, *width) or array.ndim > 2 or array.dtype != np.float64:
            raise ValueError(schema_words)
    arrays = dict(content)
    for name, several in axes.items():
        array = np.asarray(content[name])
        if several is None and array.shape[1:] == (1,):  # files of columns do not tell a number from a list of one
            array = np.ascontiguousarray(array[:, 0])
        if array.shape != (*count, *([len(several)] if several else [])) or array.dtype != np.float64:
            raise ValueError(schema_words)
        arrays[name] = array
    return log_of_arrays(arrays, {name: value for name, value in info.items() if name != LAYOUT})


def _axes(info: Mapping[str, Any]) -> dict[str, list[str] | None] | None:
    """Array of readings and estimate -> endings of its columns, None for a number an instant; None if damaged."""
    try:
        sources = sources_of(info)
    except ValueError:
        return None
    return {f"{source}.{name}": each.axes for source, of in sources.items() for name, each in of.fields.items()}


def arrays_of(table: npt.NDArray[np.float64], names: Sequence[str], layout: Any) -> dict[str, Any]:
    """The arrays whose columns stand side by side in a table.

    Args:
        table: (N, columns).
        names: of its columns.
        layout: array -> its columns, as :func:`skyarm.log.log_columns.layout` writes it.

    Raises:
        ValueError: a column is missing, or the layout is none.
    """
    place, found = {name: k for k, name in enumerate(names)}, {}
    try:
        given = {name: [place[each] for each in layout[name]["columns"]] for name in layout}
    except (KeyError, TypeError):
        raise ValueError("columns: must be those that the file says it has") from None
    for name in units(Log):
        chosen = given.get(name, [])
        if name in IF_ANY and not chosen:
            continue
        array = np.ascontiguousarray(table[:, chosen])
        found[name] = array[:, 0].copy() if name in SCALARS and chosen else array
    received = (name for name in given if name.startswith((f"{READINGS}.", f"{ESTIMATE}.")))
    return found | {name: np.ascontiguousarray(table[:, given[name]]) for name in received}
