"""Lines for people: one on standard error, and nothing in them that a terminal would obey."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from typing import Any

from skyarm.files.one_line import printable

WRONG_INPUT, INTERRUPTED = 2, 130
"""Exit codes: for wrong input, and after Ctrl-C as shells count it (128 and the signal's number)."""


def say(message: str, code: int = 0) -> int:
    """One line on standard error, the only way there; returns the exit code."""
    with contextlib.suppress(OSError):  # the terminal may be gone
        print(f"skyarm: {printable(' '.join(message.split()))}", file=sys.stderr, flush=True)
    return code


def print_script(text: str) -> None:
    """A program of ours for standard output, as it is: a shell reads it."""
    print(text)


MANY_JOINTS = 50
"""A flight of so many needs code that takes some seconds to make; the time grows with their number."""


def say_if_many(name: str, joints: int) -> None:
    """Say before long equations are made into code that this takes its time."""
    if joints > MANY_JOINTS:
        say(f"{name}: {joints} joints; its equations are being made into code, which may take minutes")


MOST_WARNINGS = 8
"""Lines about one file: a vehicle that is wrong throughout needs no more."""


def say_unlikely(name: str, lines: Sequence[str]) -> None:
    """Warn of numbers that are probably in other units; nothing is refused."""
    for line in lines[:MOST_WARNINGS]:
        say(f"warning: {name}: {line}")
    if len(lines) > MOST_WARNINGS:
        say(f"warning: {name}: {len(lines) - MOST_WARNINGS} more numbers are unlikely")


WORTH_A_LINE = 2.0
"""How many times shorter than by the physics rate steps are at least that are spoken of."""


def say_steps(scenario: Any) -> None:
    """Say where a surface, an object or a gripper asks for much shorter integration steps than the physics rate."""
    for contact in scenario.contacts:
        what, least = min(contact.steps, key=lambda each: float(each[1]))
        step, usual = float(least), 1.0 / scenario.rates.physics
        if step * WORTH_A_LINE < usual:
            say(
                f"{scenario.name}: {what} asks for integration steps of {1e3 * step:.2g} ms in contact; they follow by "
                f"themselves, and time in contact costs about {usual / step:.1f} times as much as by rates.physics"
            )


def say_warning(message: Warning | str, category: type[Warning], *_where: Any, **_more: Any) -> None:
    """A warning as one line, in place of Python's two that show where in the source it arose."""
    say(f"{'warning' if issubclass(category, RuntimeWarning | UserWarning) else category.__name__}: {message}")
