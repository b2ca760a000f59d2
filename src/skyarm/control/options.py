"""Options of a law's maker, refused by name and value where they are of the wrong kind."""

from __future__ import annotations

from typing import Any

from skyarm.control.controller import ControllerError
from skyarm.files import number, shown


def positive(name: str, value: Any, *, zero: bool = False) -> float:
    """A number above zero (or at least zero)."""
    try:
        return number(value, f"controller.{name}", low=0.0, strict=not zero)
    except ValueError as error:
        raise ControllerError(str(error)) from None


def three(name: str, values: Any, *, zero: bool = False) -> tuple[float, float, float]:
    """Three numbers above zero (or at least zero)."""
    if not isinstance(values, (list, tuple)) or len(values) != 3:
        raise ControllerError(f"controller.{name} = {shown(values)}: must be three numbers")
    first, second, third = (positive(f"{name}[{i}]", value, zero=zero) for i, value in enumerate(values))
    return first, second, third


def two(name: str, values: Any, *, zero: bool = False) -> tuple[float, float]:
    """Two numbers above zero (or at least zero)."""
    if not isinstance(values, (list, tuple)) or len(values) != 2:
        raise ControllerError(f"controller.{name} = {shown(values)}: must be 2 numbers")
    first, second = (positive(f"{name}[{i}]", value, zero=zero) for i, value in enumerate(values))
    return first, second


def whole(name: str, value: Any) -> int:
    """A whole number from 0 to 100."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 100:
        raise ControllerError(f"controller.{name} = {shown(value)}: must be a whole number from 0 to 100")
    return value


def flag(name: str, value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise ControllerError(f"controller.{name} = {shown(value)}: must be true or false")
    return value
