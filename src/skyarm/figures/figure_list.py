"""Figures 3-18 as a table: which experiment, which quantities, in which order.

Source: Barakou, Tzafestas and Valavanis, Drones 2026, 10, 274, Figures 3-18.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from skyarm.figures.quantities import (
    PITCH,
    POSITION_ERROR,
    ROLL,
    TOOL_ERROR,
    Quantity,
    joint_angle,
    joint_error,
    joint_error_size,
    position_error,
    tool_error,
    tool_position,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One panel of a stack.

    Attributes:
        shows: the quantity.
        letter: names the part that begins here, "" within a part.
        scale: panels with the same name share their limits, "" for its own.
    """

    shows: Quantity
    letter: str = ""
    scale: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperFigure:
    """One figure of the paper: experiment, title, what to see in it, panels from top to bottom."""

    case: str
    title: str
    caption: str
    panels: tuple[Panel, ...]


def _stack(*quantities: Quantity, letter: str = "", scale: str = "") -> tuple[Panel, ...]:
    first, *rest = quantities
    return (
        Panel(shows=first, letter=letter, scale=scale),
        *(Panel(shows=quantity, scale=scale) for quantity in rest),
    )


def _attitude(letter: str = "") -> tuple[Panel, ...]:
    """Roll over pitch on one scale: the arm moves in the pitch plane, and roll should look as small as it is."""
    return _stack(ROLL, PITCH, letter=letter, scale="attitude")


_BOTH, _THREE = range(2), range(3)

PAPER_CATALOGUE: Mapping[int, PaperFigure] = MappingProxyType(
    {
        3: PaperFigure(
            case="case1",
            title="Roll and pitch, Case 1",
            caption="Quadrotor roll and pitch while hovering with an arm ramp.",
            panels=_attitude(),
        ),
        4: PaperFigure(
            case="case1",
            title="Arm ramp, Case 1",
            caption="(a) Joint tracking error. (b) Joint angles, desired and actual, during the arm ramp.",
            panels=_stack(*map(joint_error, _BOTH), letter="a") + _stack(*map(joint_angle, _BOTH), letter="b"),
        ),
        5: PaperFigure(
            case="case1",
            title="Position error, Case 1",
            caption="Norm of the quadrotor position error during the arm ramp.",
            panels=_stack(POSITION_ERROR),
        ),
        6: PaperFigure(
            case="case2",
            title="Roll and pitch, Case 2",
            caption="Quadrotor roll and pitch while hovering with 0.5 Hz sinusoids on both joints.",
            panels=_attitude(),
        ),
        7: PaperFigure(
            case="case2",
            title="Position error, Case 2",
            caption="(a) Norm of the quadrotor position error. (b) The same by world axis, during the arm sinusoids.",
            panels=_stack(POSITION_ERROR, letter="a") + _stack(*map(position_error, _THREE), letter="b"),
        ),
        8: PaperFigure(
            case="case2",
            title="Joint errors, Case 2",
            caption="Joint tracking errors during the arm sinusoids.",
            panels=_stack(*map(joint_error, _BOTH)),
        ),
        9: PaperFigure(
            case="case2_gust",
            title="Pitch, Case 2 with a gust",
            caption="Quadrotor pitch with a gust along x from 7.5 s to 10.5 s.",
            panels=_stack(PITCH),
        ),
        10: PaperFigure(
            case="case2_gust",
            title="Position error, Case 2 with a gust",
            caption="Quadrotor position error by world axis with a gust along x.",
            panels=_stack(*map(position_error, _THREE)),
        ),
        11: PaperFigure(
            case="case2_gust",
            title="Joint errors, Case 2 with a gust",
            caption="Joint tracking errors with a gust along x: joint 1 (top) and joint 2 (bottom).",
            panels=_stack(*map(joint_error, _BOTH)),
        ),
        12: PaperFigure(
            case="case3",
            title="Circle with arm motion, Case 3",
            caption="(a) Norm of the quadrotor position error. (b) Roll and pitch, on the circle with a moving arm.",
            panels=_stack(POSITION_ERROR, letter="a") + _attitude(letter="b"),
        ),
        13: PaperFigure(
            case="case3",
            title="Tip position, Case 3",
            caption="Tip position in the world, desired and actual.",
            panels=_stack(*map(tool_position, _THREE)),
        ),
        14: PaperFigure(
            case="case3",
            title="Joint and tip errors, Case 3",
            caption="(a) Absolute joint tracking errors. (b) Norm of the tip error in the world.",
            panels=_stack(*map(joint_error_size, _BOTH), letter="a") + _stack(TOOL_ERROR, letter="b"),
        ),
        15: PaperFigure(
            case="case3",
            title="Tip error, Case 3",
            caption="Tip error by world axis.",
            panels=_stack(*map(tool_error, _THREE)),
        ),
        16: PaperFigure(
            case="case3_wind",
            title="Position error, Case 3 in constant wind",
            caption="Norm of the quadrotor position error in a constant wind along x.",
            panels=_stack(POSITION_ERROR),
        ),
        17: PaperFigure(
            case="case3_wind",
            title="Roll and pitch, Case 3 in constant wind",
            caption="Quadrotor orientation in a constant wind along x.",
            panels=_attitude(),
        ),
        18: PaperFigure(
            case="case3_wind",
            title="Tip error, Case 3 in constant wind",
            caption="Norm of the tip error in a constant wind along x.",
            panels=_stack(TOOL_ERROR),
        ),
    }
)
