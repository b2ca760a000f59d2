"""The metrics: their names, windows and formulas, counted in flight or over a log by the same functions.

Position and joint errors are norms. A metric that needs a reference exists twice: against the held samples, as a
recorded bag would see it, and with the suffix ``_continuous`` against the continuous reference. Those of the gust
experiment, which looks at another window, begin with ``gust_``.

Settling time is not among them. It asks when the error entered a band around its steady mean, and the mean is known
after the steady window only: the error's whole past would have to be kept. Two flights give it, or a log
(:func:`skyarm.metrics.score.settling_time`).

Source: Barakou et al. 2026, Table 2 and section 5.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.files import did_you_mean, shown
from skyarm.metrics.accumulate import ADDED, CONTINUOUS, Total, added_metric
from skyarm.metrics.contact_totals import VALUES
from skyarm.registry import names as registered_names

Array = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Measure:
    """One metric: the totals it needs, and its value from them, the instants in its window, and the period (s)."""

    totals: tuple[Total, ...]
    window: str
    value: Callable[..., Any] = field(repr=False)


def _mean(window: str, name: str) -> Measure:
    return Measure((("sum", window, name),), window, lambda n, _dt, total: total / n)


def _rms(window: str, name: str) -> Measure:
    return Measure((("square", window, name),), window, lambda n, _dt, total: np.sqrt(total / n))


def _root_mean(window: str, name: str) -> Measure:
    """RMS of what is counted squared already."""
    return Measure((("sum", window, name),), window, lambda n, _dt, total: np.sqrt(total / n))


def _extreme(kind: str, window: str, name: str) -> Measure:
    return Measure(((kind, window, name),), window, lambda _n, _dt, total: total)


def _integral(window: str, name: str) -> Measure:
    return Measure((("sum", window, name),), window, lambda _n, dt, total: total * dt)


def _half_range(window: str, name: str) -> Measure:
    ends: tuple[Total, ...] = (("max", window, name), ("min", window, name))
    return Measure(ends, window, lambda _n, _dt, high, low: 0.5 * (high - low))


def _tracking(prefix: str, window: str) -> dict[str, Measure]:
    found = {}
    for name in ("position", "joint", "ee"):
        found[f"{prefix}{name}_error_mean"] = _mean(window, name)
        found[f"{prefix}{name}_error_max"] = _extreme("max", window, name)
    return found


TRACKING = _tracking("", "steady") | {
    "position_min": _extreme("min", "steady", "position"),
    "position_max": _extreme("max", "steady", "position"),
    "position_ripple": _half_range("steady", "position"),
    "peak_position": _extreme("max", "transient", "position"),
    "iae_position": _integral("whole", "position"),
    "iae_joint": _integral("whole", "joint"),
    "altitude_error_max": _extreme("max", "whole", "altitude"),
    "x_error_max": _extreme("max", "steady", "x"),
    "ee_time_outside": _integral("steady", "ee_outside"),
}

GUST = _tracking("gust_", "gust") | {
    "gust_peak_x": _extreme("peak", "gust", "x"),
    "gust_ee_peak_x": _extreme("peak", "gust", "ee_x"),
    "gust_iae_position": _integral("gust", "position"),
    "gust_iae_joint": _integral("gust", "joint"),
}

PAPER = {
    "held_position_error": _mean("holds", "position"),
    "ee_error_last_mean": _mean("last", "ee"),
    "ee_error_last_max": _extreme("max", "last", "ee"),
}

FREE = {
    "pitch_mean": _mean("steady", "pitch"),
    "pitch_rms": _rms("steady", "pitch"),
    "pitch_ripple": _half_range("steady", "pitch"),
    "roll_rms": _rms("steady", "roll"),
    "peak_pitch": _extreme("max", "transient", "pitch_size"),
    "gust_pitch_rms": _rms("gust", "pitch"),
    "gust_peak_pitch": _extreme("peak", "gust", "pitch"),
    "tilt_rms": _rms("steady", "tilt"),
    "tilt_max": _extreme("max", "whole", "tilt"),
    "rate_rms": _root_mean("steady", "rate_square"),
    "rotor_jitter": _root_mean("steady", "jitter_square"),
    "rotor_jitter_mean": _mean("steady", "jitter_size"),
    "reference_lag_mean": _mean("steady", "lag"),
    "reference_lag_max": _extreme("max", "whole", "lag"),
    "phases_done": _extreme("max", "whole", "phase"),
    # against the continuous reference always, as a mean height before the motion
    "hover_offset": _mean("hover", f"height{CONTINUOUS}"),
}
"""Metrics that have no twin."""

CONTACT = {
    name: Measure(((ADDED, "whole", totals),), "whole", lambda _n, _dt, held, value=value: value(held))
    for name, (totals, value) in VALUES.items()
}
"""Metrics of contact, of which a flight without it has none."""

REFERRED = TRACKING | GUST | PAPER

STANDARD = (
    *("position_error_mean", "position_error_max", "position_min", "joint_error_mean", "joint_error_max"),
    *("ee_error_mean", "ee_error_max", "pitch_mean", "pitch_rms", "pitch_ripple", "roll_rms", "peak_pitch"),
    *("peak_position", "iae_position", "iae_joint", "efforts"),
)

GROUPS: Mapping[str, tuple[str, ...]] = {
    "standard": STANDARD,
    "gust": (*GUST, "gust_pitch_rms", "gust_peak_pitch"),
    "wind": ("position_min", "position_max", "position_ripple", "pitch_mean", "pitch_ripple"),
    "paper": (*PAPER, "hover_offset"),
    "effort": ("efforts", "rotor_jitter", "rate_rms", "tilt_rms", "tilt_max", "altitude_error_max"),
    "contact": tuple(CONTACT),
    "all": (*REFERRED, *FREE, "efforts"),
}
"""Words for several metrics; ``efforts`` in them is the RMS of every joint's torque over the steady window."""


def measures(joints: int) -> dict[str, Measure]:
    """Every metric there is for an arm of so many joints."""
    found = REFERRED | FREE | CONTACT | {f"tau{i + 1}_rms": _rms("steady", f"effort{i}") for i in range(joints)}
    for name, each in REFERRED.items():
        twins = tuple((kind, window, f"{what}{CONTINUOUS}") for kind, window, what in each.totals)
        found[f"{name}{CONTINUOUS}"] = Measure(twins, each.window, each.value)
    for name in registered_names("metric"):
        found[name] = _added(name)
    return found


def _added(name: str) -> Measure:
    """A registered metric."""
    metric = added_metric(name)
    return Measure(((ADDED, metric.window, name),), metric.window, lambda n, dt, held: metric.result(held, n, dt))


def metric_names(wanted: Sequence[str], joints: int, told: Sequence[bool] = ()) -> tuple[str, ...]:
    """Names of metrics and groups, with groups written out, each once.

    A group with the suffix ``_continuous`` stands for the twins of those of its metrics that have one.

    Args:
        wanted: names and groups.
        joints: of the arm.
        told: joint by joint, whether its command is a setpoint in place of a torque: groups then leave its torque out.

    Raises:
        ValueError: a name that is none, with those there are; or the torque of a joint that takes a setpoint.
    """
    if isinstance(wanted, str) or not isinstance(wanted, Collection):
        raise ValueError(f"metrics = {shown(wanted)}: must be a list of names and groups, as ['standard']")
    known = measures(joints)
    found: list[str] = []
    without = [f"tau{i + 1}_rms" for i, each in enumerate(told) if each]
    for word in wanted:
        group = word.removesuffix(CONTINUOUS) if isinstance(word, str) else ""
        if word in without:
            k = word.removeprefix("tau").removesuffix("_rms")
            raise ValueError(f"metrics: {shown(word)}: must be left out: joint {k} is told setpoints of its drive")
        if isinstance(word, str) and word in known:
            found.append(word)
        elif group in GROUPS:
            listed = [name for one in GROUPS[group] for name in _written_out(one, joints) if name not in without]
            twins = [f"{name}{CONTINUOUS}" for name in listed if name in REFERRED]
            found += listed if group == word else twins
        else:
            allowed = f"{', '.join(GROUPS)}, or of {', '.join(name for name in known if not name.endswith(CONTINUOUS))}"
            meant = did_you_mean(word, (*GROUPS, *known))
            raise ValueError(f"metrics: {shown(word)}: {meant}must be one of {allowed}; with {CONTINUOUS} its twin")
    return tuple(dict.fromkeys(found))


def _written_out(name: str, joints: int) -> list[str]:
    return [f"tau{i + 1}_rms" for i in range(joints)] if name == "efforts" else [name]


def needed(names: Sequence[str], joints: int) -> tuple[Total, ...]:
    """Totals that metrics need, each once."""
    known = measures(joints)
    return tuple(dict.fromkeys(total for name in names for total in known[name].totals))


def values(
    names: Sequence[str], totals: Mapping[Total, Array], instants: Mapping[str, Array], joints: int, period: float
) -> dict[str, Array]:
    """Metrics of each lane; NaN where no instant of its flight fell into the window, 0 for integrals over the whole.

    Args:
        names: of the metrics.
        totals: at the end of each flight.
        instants: window -> how many instants of each flight lie in it.
        joints: of the arm.
        period: s.
    """
    known, found = measures(joints), {}
    with np.errstate(all="ignore"):
        for name in names:
            each = known[name]
            n = instants[each.window]
            value = each.value(n, period, *(totals[total] for total in each.totals))
            empty = 0.0 if each.window == "whole" and name.startswith("iae") else np.nan
            found[name] = np.where(n > 0, value, empty)
    return found
