"""Search for the line of user code that produced the first infinite or NaN value in a control period."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any, TypeAlias

import numpy as np

from skyarm.algebra import Vec3
from skyarm.records.files.user_code import is_own
from skyarm.records.leaves import leaves

CONSTANTS = "self", "par"
"""Arguments whose numbers a period does not change; limits among them may be infinite."""


Trace: TypeAlias = Callable[[FrameType, str, Any], "Trace | None"]
"""Trace function of Python: called with a frame, an event, and its value or error."""


def first_line(period: Callable[[], object]) -> str:
    """First line of user code in a function called with floats that gives inf or NaN from finite arguments.

    Args:
        period: function that may raise; the user's own 1 / 0 is such a line.

    Returns:
        ``file.py:12 (law): name is nan``, with the variable where there is one; empty without such a line.
    """
    lines, debugger = list[str](), sys.gettrace()

    def enter(frame: FrameType, _event: str, _value: object) -> Trace | None:
        given = (value for name, value in frame.f_locals.items() if name not in CONSTANTS)
        if not is_own(frame.f_code, frame.f_globals.get("__name__", "")) or any(map(_kind, given)):
            return None
        line, last, begun, first = frame.f_lineno, "", len(lines), dict[str, str]()

        def step(frame: FrameType, event: str, value: Any) -> Trace:
            nonlocal line, last
            code = frame.f_code
            place = f"{Path(code.co_filename).name}:{line} ({code.co_qualname.replace('<locals>.', '')})"
            for name, each in frame.f_locals.items():
                if isinstance(each, (float, Vec3, np.ndarray)) and (kind := _kind(each)):
                    first.setdefault(kind, f"{place}: {name} is {kind}")
            if event == "exception" and issubclass(value[0], ArithmeticError):
                lines.append(f"{place}: {value[1]}")
            elif event == "return" and last != "exception":
                del lines[begun:]  # what was not finite on the way to a finite result is meant
                if kind := _kind(value):
                    lines.append(first.get(kind, place))
            line, last = frame.f_lineno, event
            return step

        return step

    sys.settrace(enter)
    try:
        period()
    except Exception:
        pass
    finally:
        sys.settrace(debugger)
    return lines[0] if lines else ""


def _kind(value: object) -> str:
    """Worst non-finite number in a value: "nan", else "inf"; empty if all numbers are finite."""
    value = value.tolist() if isinstance(value, np.ndarray) else getattr(value, "state", value)  # of a motion
    if isinstance(value, float):
        return "" if math.isfinite(value) else str(abs(value))
    parts = value if isinstance(value, list) else leaves(value)
    return max((_kind(part) for part in parts if part is not value), default="")
