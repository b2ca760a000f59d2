"""Catalogue of metrics: names, time windows and formulas, for flights and logs alike.

Position and joint errors are norms. A metric that needs a reference exists twice:
against the held samples, as a recorded bag would see it, and with the suffix
``_continuous`` against the continuous reference. Those of the gust experiment, which
looks at another window, begin with ``gust_``.

Settling time is not among them. It asks when the error entered a band around its steady
mean, and the mean is known after the steady window only: the error's whole past would
have to be kept. Two flights give it, or a log
(:func:`skyarm.log.metrics.score.settling_time`).

The definitions are rows of ``metric_catalogue.toml``.

Source: Barakou et al. 2026, Table 2 and section 5.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from skyarm.log.metrics.accumulate import ADDED, CONTINUOUS, HUGE, Total, added_metric
from skyarm.log.metrics.interaction import SHARED, TOTALED
from skyarm.log.metrics.metric import Metric
from skyarm.log.team_log import WITHIN
from skyarm.records import coerce
from skyarm.records.arrays import AnyArray, Array
from skyarm.records.files import did_you_mean, must_be_one_of, shipped_tables, shown
from skyarm.records.files.user_code import place_of
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree
from skyarm.records.registry import names as registered_names


@positional
class Measure:
    """Definition of one metric: required sums, time window, formula, description and
    unit.

    Attributes:
        totals: required sums and extremes. window: name of the window whose instants
            are counted.
        value: (instants, period in s, *totals) -> metric.
        words, unit: description and unit for axes and tables.
    """

    totals: tuple[Total, ...]
    window: str
    value: Callable[..., AnyArray] = field(repr=False)
    words: str = ""
    unit: str = ""


def _or_nan(_n: Array, _dt: float, total: Array) -> AnyArray:
    """Extreme or last value of a quantity over each flight; NaN if the flight lacks the
    quantity.
    """
    # a total that no instant has reached still has its start value
    return np.where(np.abs(total) < HUGE, total, np.nan)


FORMS: Mapping[str, tuple[tuple[str, ...], Callable[..., AnyArray]]] = {
    "mean": (("sum",), lambda n, _dt, total: total / n),
    "rms": (("square",), lambda n, _dt, total: np.sqrt(total / n)),
    "root": (("sum",), lambda n, _dt, total: np.sqrt(total / n)),
    "integral": (("sum",), lambda _n, dt, total: total * dt),
    "half_range": (("max", "min"), lambda _n, _dt, high, low: 0.5 * (high - low)),
    "max": (("max",), lambda _n, _dt, total: total),
    "min": (("min",), lambda _n, _dt, total: total),
    "peak": (("peak",), lambda _n, _dt, total: total),
    "last": (("last",), _or_nan),
    "largest": (("max",), _or_nan),
    "lowest": (("min",), _or_nan),
}
"""Form of a metric -> kinds of totals of its quantity, and function from them to its
value; ``root`` is the RMS of a squared quantity."""


def _measure(form: str, window: str, quantity: str, words: str, unit: str) -> Measure:
    kinds, value = FORMS[form]
    return Measure(
        tuple((kind, window, quantity) for kind in kinds), window, value, words, unit
    )


_TABLES = shipped_tables(__file__)


def _rows(table: str) -> dict[str, Measure]:
    return {name: _measure(*row) for name, row in _TABLES[table].items()}


TRACKING = _rows("tracking")

GUST = _rows("gust")

PAPER = _rows("paper")

FREE = _rows("free")
"""Metrics without a counterpart for the continuous reference."""

INTERACTION = {
    name: Measure(
        ((ADDED, "whole", totals),),
        "whole",
        lambda _n, _dt, memory, value=value: value(memory),
        words,
        unit,
    )
    for name, (totals, value, words, unit) in TOTALED.items()
    # value=value binds each row's function, which a closure over the loop would not
} | _rows("counted")
"""Metrics of contact with the world, which a flight without contact lacks."""

GRASPS = _rows("grasps")
"""Metrics of the joints by which vehicles hold a body."""

TEAMS = _rows("teams")
"""Metrics of the body that a team carries."""

REFERRED = TRACKING | GUST | PAPER
"""Metrics against the reference, which exist twice."""

EFFORTS = "efforts"
"""Name for the torques of all joints, alone and in groups."""

_LISTED: Mapping[str, list[str]] = _TABLES["groups"]

GROUPS: Mapping[str, Sequence[str]] = {
    "standard": _LISTED["standard"],
    "gust": (*GUST, "gust_pitch_rms", "gust_peak_pitch"),
    "wind": _LISTED["wind"],
    "paper": (*PAPER, "hover_offset"),
    "effort": _LISTED["effort"],
    "contact": tuple(INTERACTION),
    "team": tuple(TEAMS),
    "all": (*REFERRED, *FREE, "efforts"),
}
"""Names of groups of metrics; ``efforts`` in them is the RMS of every joint's torque
over the steady window."""


def measures(joints: int) -> dict[str, Measure]:
    """Definitions of all available metrics for an arm with a given number of joints, by
    name.
    """
    by_name = (
        REFERRED
        | FREE
        | INTERACTION
        | GRASPS
        | TEAMS
        | {
            f"tau{i + 1}_rms": _measure(
                "rms", "steady", f"effort{i}", f"RMS torque of joint {i + 1}", "N m"
            )
            for i in range(joints)
        }
    )
    for name, each in REFERRED.items():
        twins = tuple(
            (kind, window, f"{what}{CONTINUOUS}") for kind, window, what in each.totals
        )
        by_name[f"{name}{CONTINUOUS}"] = replace(
            each, totals=twins, words=f"{each.words}, continuous reference"
        )
    for name in registered_names("metric"):
        by_name[name] = _registered_measure(name)
    return by_name


def _registered_measure(name: str) -> Measure:
    """Make the definition of a registered metric, shipped or a user's."""
    metric = added_metric(name)
    # a registered metric keeps a memory of its own, which is one total
    totals, window = ((ADDED, metric.window, name),), metric.window
    return Measure(
        totals,
        window,
        lambda n, dt, memory: _result(name, metric, memory, n, dt),
        metric.words,
        metric.unit,
    )


def _result(
    name: str, metric: Metric, memory: Tree, instants: Array, period: float
) -> Array:
    """Result of a registered metric for each flight, after a check of its shape and
    type.
    """
    value = np.asarray(metric.result(memory, instants, period))
    # one number for all flights, or one for each
    if value.dtype.kind not in "biuf" or value.shape not in ((), np.shape(instants)):
        coerce.refuse(
            f"{place_of(type(metric).result)}: metric {name!r}: result",
            value,
            "must be one number a flight",
        )
    return value


def metric_names(
    words: Sequence[str], joints: int, setpoints: Sequence[bool] = ()
) -> tuple[str, ...]:
    """Expand metric names and groups such as "standard" to a list of names, each once.

    A group with the suffix ``_continuous`` stands for the twins of those of its metrics
    that have one, the word "efforts" for the torque of every joint.

    Args:
        words: names and groups.
        joints: number of joints of the arm.
        setpoints: per joint, True if its command is a setpoint in place of a torque:
            groups then leave its torque out.

    Raises:
        ValueError: a name that is none, with those there are; or the torque of a joint
            that takes a setpoint.
    """
    _require_list(words)
    every = measures(joints)
    expanded: list[str] = []
    without = [f"tau{i + 1}_rms" for i, each in enumerate(setpoints) if each]
    torques = [f"tau{i + 1}_rms" for i in range(joints)]
    torques = [name for name in torques if name not in without]
    for word in words:
        group = word.removesuffix(CONTINUOUS) if isinstance(word, str) else ""
        if word in without:
            k = word.removeprefix("tau").removesuffix("_rms")
            raise ValueError(
                f"metrics: {shown(word)}: must be left out: joint {k} is told setpoints"
                " of its drive"
            )
        if isinstance(word, str) and word in every:
            expanded.append(word)
        elif word == EFFORTS or group in GROUPS:
            listed = list[str]()
            for one in GROUPS.get(group, (EFFORTS,)):
                listed += torques if one == EFFORTS else [one]
            twins = [f"{name}{CONTINUOUS}" for name in listed if name in REFERRED]
            expanded += listed if group == word else twins
        else:
            allowed = (
                f"{', '.join(GROUPS)}, or of"
                f" {', '.join(name for name in every if not name.endswith(CONTINUOUS))}"
            )
            meant = did_you_mean(word, (*GROUPS, *every))
            raise ValueError(
                f"metrics: {shown(word)}: {meant}must be one of {allowed}; with"
                f" {CONTINUOUS} its twin"
            )
    # each once, in the order of the request
    return tuple(dict.fromkeys(expanded))


def _require_list(words: object) -> None:
    if isinstance(words, str) or not isinstance(words, Collection):
        raise ValueError(
            f"metrics = {shown(words)}: must be a list of names and groups, as"
            " ['standard']"
        )


def names_by_agent(
    words: Sequence[str], setpoints: Mapping[str, Sequence[bool]]
) -> dict[str, dict[str, str]]:
    """Expand metric names and groups for the vehicles of a flight.

    Of several vehicles ``left/tilt_max`` is the metric of one and ``tilt_max`` that of
    each; what belongs to the world, such as the position of an object, has no vehicle's
    name and is counted with the first.

    Args:
        words: names and groups, with or without the name of a vehicle.
        setpoints: for each vehicle and joint, True if the joint's command is a setpoint
            in place of a torque.

    Returns:
        For each vehicle: name among the results -> name in the catalogue.

    Raises:
        ValueError: as :func:`metric_names`, or another vehicle's name.
    """
    # results of one vehicle have the metrics' own names, in rows and files alike
    if len(setpoints) == 1:
        return {
            name: {each: each for each in metric_names(words, len(own), own)}
            for name, own in setpoints.items()
        }
    _require_list(words)
    pairs = [(str(word).rpartition(WITHIN)[0], word) for word in words]
    for agent, word in pairs:
        if agent not in ("", *setpoints):
            raise ValueError(
                f"metrics: {shown(word)}: agent = {shown(agent)}:"
                f" {must_be_one_of(setpoints, agent)}"
            )
    listed: dict[str, dict[str, str]] = {name: {} for name in setpoints}
    # what belongs to the world is counted with the first vehicle
    world = next(iter(listed.values()))
    for name, own in setpoints.items():
        of_it = [
            word.removeprefix(agent + WITHIN) if agent else word
            for agent, word in pairs
            if agent in ("", name)
        ]
        for each in metric_names(of_it, len(own), own):
            shared = {what for _, _, what in measures(len(own))[each].totals} <= SHARED
            (world if shared else listed[name])[
                each if shared else f"{name}{WITHIN}{each}"
            ] = each
    return listed


def row_names(
    words: Sequence[str], setpoints: Mapping[str, Sequence[bool]]
) -> tuple[str, ...]:
    """Expand metric names and groups to the names among the results of a flight
    (:func:`names_by_agent`).
    """
    return tuple(
        name for own in names_by_agent(words, setpoints).values() for name in own
    )


def catalogue_names(names: Iterable[str]) -> set[str]:
    """Names of metrics in the catalogue, without those of the vehicles that they are
    of.
    """
    return {name.rpartition(WITHIN)[2] for name in names}


def is_torque(name: str) -> bool:
    """True for the name of a joint's torque, with or without that of a vehicle."""
    return name.rpartition(WITHIN)[2].startswith("tau")


def required_totals(names: Sequence[str], joints: int) -> tuple[Total, ...]:
    """List the sums and extremes from which the given metrics are computed, each
    once.
    """
    every = measures(joints)
    return tuple(dict.fromkeys(total for name in names for total in every[name].totals))


def values(
    names: Sequence[str],
    totals: Mapping[Total, Array],
    instants: Mapping[str, Array],
    joints: int,
    period: float,
) -> dict[str, Array]:
    """Compute the metrics of each flight of a batch from accumulated sums; NaN for an
    empty time window.

    Args:
        names: names of the metrics.
        totals: totals at the end of each flight.
        instants: window -> how many instants of each flight lie in it.
        joints: number of joints of the arm.
        period: control period, s.
    """
    every = measures(joints)
    results = {}
    # the means over empty windows divide by zero and are replaced below
    with np.errstate(all="ignore"):
        for name in names:
            each = every[name]
            n = instants[each.window]
            value = each.value(n, period, *(totals[total] for total in each.totals))
            # over no instant an integral is zero, a mean has no value
            empty = 0.0 if each.window == "whole" and name.startswith("iae") else np.nan
            results[name] = np.where(n > 0, value, empty)
    return results


def metric_words(name: str) -> tuple[str, str]:
    """Return description and unit of a metric, for axes and tables.

    Joint errors are in rad; those of joints that slide in m.
    """
    agent, within, name = name.rpartition(WITHIN)
    torque = re.fullmatch(r"tau(\d+)_rms", name)
    measure = measures(int(torque[1]) if torque else 0).get(name)
    of = f"{agent}: " if within else ""
    return (
        (of + measure.words, measure.unit)
        if measure and measure.words
        else (of + name.replace("_", " "), "")
    )
