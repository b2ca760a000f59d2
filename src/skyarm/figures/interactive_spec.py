"""What an interactive figure is made of, as the script in the page reads it: panels, curves, shades, choices."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

DIGITS = 6
"""Decimals kept: 1 um, 1 urad, far below a pixel unless one magnifies a hundred times."""
STYLES = ("ct", "pd", "ct-mujoco", "pd-mujoco", "ct-paper", "pd-paper", "desired", "other")
"""How a line may look: classes of ``plot.css``, which knows light and dark pages."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One panel of values.

    Attributes:
        label: words for the axis of values. unit: SI, or "".
        span: (low, high) that is always in view, so that rounding noise does not fill the panel; None for none.
        from_zero: the axis begins at zero where no value is negative.
    """

    label: str
    unit: str = ""
    span: tuple[float, float] | None = None
    from_zero: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One line of a panel.

    Attributes:
        panel: number of the panel. name: in the legend, which shows and hides all curves of a name at once.
        style: of :data:`STYLES`. shown: from the start.
        x0, dx: first place on the horizontal axis, and step. y: values, None for a gap. points: with dots.
    """

    panel: int
    name: str
    style: str
    shown: bool
    x0: float
    dx: float
    y: Sequence[float | None]
    points: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """One path in space: points (x, y, z) in m, None for a gap; the rest as of a :class:`Curve`."""

    name: str
    style: str
    shown: bool
    x: Sequence[float | None]
    y: Sequence[float | None]
    z: Sequence[float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shade:
    """An interval of the horizontal axis, shaded in all panels; ``name`` is "window" or "gust"."""

    name: str
    start: float
    stop: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A button that shows the curves of these names and hides the others."""

    label: str
    names: Sequence[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelsFigure:
    """Curves over one horizontal axis, in panels.

    Attributes:
        axis: words for the horizontal axis, with its unit.
        height: of one panel, px. columns: of panels, where the page is wide enough.
        categories: names at 0, 1, 2 ... of the horizontal axis; empty for an axis of numbers.
    """

    axis: str
    height: int
    columns: int = 1
    categories: Sequence[str] = ()
    panels: Sequence[Panel]
    curves: Sequence[Curve]
    shades: Sequence[Shade] = ()
    choices: Sequence[Choice] = ()
    kind: str = "panels"


@dataclass(frozen=True, slots=True, kw_only=True)
class PathFigure:
    """Paths in space.

    Attributes:
        height: of the drawing, px. aspect: lengths of the box's sides x, y, z in the picture.
    """

    height: int
    aspect: tuple[float, float, float]
    curves: Sequence[Path]
    choices: Sequence[Choice] = ()
    kind: str = "path"


def figure_json(figure: PanelsFigure | PathFigure) -> str:
    """JSON of a figure; "<" is written as an escape, so that it is safe inside a script element."""
    return json.dumps(asdict(figure), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def rounded(values: npt.NDArray[np.float64] | Iterable[float]) -> list[float | None]:
    """Short numbers; a gap for whatever is not finite."""
    return [round(float(v), DIGITS) if np.isfinite(v) else None for v in values]
