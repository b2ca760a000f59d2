"""What calls of batches are given, looked at before anything flies: counts, masks, actions and numbers of the lanes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.files import shown
from skyarm.scenario.paths import LATE, LATER
from skyarm.scenario.scenario_record import Scenario, ScenarioError, whole

Array = npt.NDArray[Any]

WIDTHS = (1, 2, 4, 8, 16, 32, 64)
"""Lanes of a vector that machine code is written for."""


def require_count(field: str, value: Any, least: int = 1) -> int:
    """A whole number.

    Raises:
        ScenarioError: it is none, or less than ``least``.
    """
    held = whole(value)
    if held is None or held < least:
        raise ScenarioError(f"{field} = {shown(value)}: must be a whole number, at least {least}")
    return held


def require_rigid_body(scenario: Scenario) -> None:
    """Refuse a scenario of another plant: batches are machine code of the rigid-body plant.

    Raises:
        ScenarioError: one line.
    """
    if scenario.plant != "rigid_body":
        raise ScenarioError(f"plant.kind = {shown(scenario.plant)}: must be rigid_body for a batch")


def require_width(width: Any) -> None:
    """Lanes of a vector, or None for the processor's own.

    Raises:
        ScenarioError: no power of two.
    """
    if width is not None and whole(width) not in WIDTHS:
        allowed = ", ".join(map(str, WIDTHS))
        raise ScenarioError(f"width = {shown(width)}: must be one of {allowed}, or None for the processor's own")


def require_kind(field: str, value: Any, kind: type) -> None:
    """A record of this kind, or None.

    Raises:
        ScenarioError: something else.
    """
    if not isinstance(value, (kind, type(None))):
        raise ScenarioError(f"{field} = {shown(value)}: must be {kind.__name__} or None")


def require_paths(paths: Any) -> tuple[str, ...]:
    """Names of numbers.

    Raises:
        ScenarioError: one name alone, whose letters would be taken for names, or no names.
    """
    if isinstance(paths, str) or not isinstance(paths, Collection) or not all(isinstance(path, str) for path in paths):
        raise ScenarioError(f"paths = {shown(paths)}: must be a list of paths of numbers, as 'plant.gravity'")
    return tuple(paths)


def require_values(values: Any) -> Mapping[str, Any]:
    """Numbers by path.

    Raises:
        ScenarioError: no mapping.
    """
    if not isinstance(values, Mapping):
        raise ScenarioError(f"values = {shown(values)}: must be a mapping of paths to the numbers of the lanes")
    return values


def lane_mask(mask: Any, lanes: int) -> Array:
    """(lanes,) True where something is to happen; None is everywhere.

    Raises:
        ScenarioError: other than one truth value a lane: indices are none.
    """
    if mask is None:
        return np.ones(lanes, dtype=bool)
    found = _array("mask", mask)
    if found.dtype.kind != "b" or found.shape != (lanes,):
        raise ScenarioError(
            f"mask: {found.dtype} of shape {found.shape}, must be True or False for each of {lanes} lanes"
        )
    return found


def lane_numbers(field: str, values: Any, lanes: int) -> Array:
    """(lanes,) numbers of one path, of one number for all or of one a lane.

    Raises:
        ScenarioError: they are none, not a number, or not as many.
    """
    found = numbers_of(field, values)
    if found.shape not in ((), (lanes,)):
        raise ScenarioError(f"{field}: shape {found.shape}, must be one number, or one for each of {lanes} lanes")
    if np.isnan(found).any():
        raise ScenarioError(f"{field}: nan is not a number")
    return np.broadcast_to(found, (lanes,))


def numbers_of(field: str, values: Any) -> Array:
    """Numbers of the lanes.

    Raises:
        ScenarioError: they are none.
    """
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise ScenarioError(f"{field} = {shown(values)}: must be numbers, one a lane") from None


def require_within_queue(scenario: Scenario, columns: Mapping[str, Array]) -> None:
    """Varied delays stay within the queue of commands.

    Args:
        scenario: with the longest delay of its queue.
        columns: path -> numbers of the lanes; other paths than delays pass.

    Raises:
        ScenarioError: a delay below 0, or delays that together are beyond the longest; names the path.
    """
    longest, delays = scenario.delays.longest_command, scenario.delays
    if longest is None:
        return
    base = columns.get(LATE, np.array([delays.command], dtype=float))
    for path in LATER:
        if path not in columns or not columns[path].size:
            continue
        total = columns[path] if path == LATE else base + columns[path]
        if not (columns[path].min() >= 0.0 and total.max() <= longest):
            raise ScenarioError(f"values[{path!r}]: must be from 0 to delays.longest_command = {longest!r}")
    for path, own in zip(LATER[1:], (delays.rotors, delays.joints), strict=True):
        if path not in columns and LATE in columns and columns[LATE].size and columns[LATE].max() + own > longest:
            raise ScenarioError(f"values[{LATE!r}]: with {path} must be at most delays.longest_command = {longest!r}")


def lane_actions(actions: Any, shape: tuple[int, int]) -> Array:
    """Rotor speeds and joint setpoints of every lane: of a shape, or one column for all of them.

    Raises:
        ScenarioError: another shape, which would fit by chance, or no numbers.
    """
    found = _array("actions", actions)
    if found.shape not in (shape, (shape[0], 1)) or found.dtype.kind not in "fiu":
        allowed = f"must be numbers of shape {shape} or {(shape[0], 1)}: rotor speeds, then joint setpoints"
        raise ScenarioError(f"actions: {found.dtype} of shape {found.shape}, {allowed}")
    return found


def _array(field: str, given: Any) -> Array:
    try:
        return np.asarray(given)
    except (TypeError, ValueError):
        raise ScenarioError(f"{field} = {shown(given)}: must be an array") from None
