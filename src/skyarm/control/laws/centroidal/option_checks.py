"""Options of the centroidal law, refused by name and value where they make no sense."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.gain_presets import ENTRIES, PERIODS, PRESETS, RANGES
from skyarm.files import number, shown

OLDEST = 100
"""Control periods: the largest known delay; each one is a step of the model in the compiled law."""


def one_of(name: str, value: Any, words: Sequence[str]) -> None:
    """Refuse what is none of some words."""
    if not isinstance(value, str) or value not in words:
        raise ControllerError(f"controller.{name} = {shown(value)}: must be one of {list(words)}")


def bounded(name: str, value: Any, low: float, high: float = math.inf) -> float:
    """A finite number from ``low`` to ``high``."""
    try:
        held = number(value, f"controller.{name}", low=low)
    except ValueError as error:
        raise ControllerError(str(error)) from None
    if held > high:
        raise ControllerError(f"controller.{name} = {shown(value)}: must be at most {high:g}")
    return held


def checked(name: str, value: Any) -> Any:
    """A preset's entry of its own kind, within its range.

    Raises:
        ControllerError: no such entry, another count, or something that is no such number.
    """
    if name not in ENTRIES:
        raise ControllerError(f"controller.{name}: must be one of {sorted(ENTRIES)}")
    example = PRESETS["robust"][name]
    if isinstance(example, bool):
        if not isinstance(value, bool):
            raise ControllerError(f"controller.{name} = {shown(value)}: must be true or false")
        return value
    if not isinstance(example, tuple):
        return bounded(name, value, *RANGES[name])
    if not isinstance(value, (list, tuple)) or len(value) != len(example):
        raise ControllerError(f"controller.{name} = {shown(value)}: must be {len(example)} numbers")
    limits = RANGES.get(name, (0.0, math.inf))
    return tuple(bounded(f"{name}[{i}]", each, *limits) for i, each in enumerate(value))


def must_act(changes: Mapping[str, Any], gains: Mapping[str, Any]) -> None:
    """Refuse what is asked for beside options without which it does nothing."""
    for name in ("gust_shift", "swing_rate", "path_rate"):
        if changes.get(name) and not gains["shift_bandwidth"] > 0.0:
            raise ControllerError(f"controller.{name} = {shown(changes[name])}: must be 0 without shift_bandwidth")


def periods_of(delay: Any, control_period: Any) -> int:
    """Control periods of a known delay.

    Raises:
        ControllerError: no whole number of them, too many, or a period that is none.
    """
    period = bounded("control_period", control_period, *PERIODS)
    seconds = bounded("delay", delay, 0.0, OLDEST * period * (1.0 + 1e-9))
    periods = round(seconds / period)
    if abs(periods * period - seconds) > 1e-9:
        raise ControllerError(
            f"controller.delay = {shown(delay)}: must be a whole number of control periods of {period:g} s"
        )
    return periods
