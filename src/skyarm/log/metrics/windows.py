"""Time windows over which metrics are taken; by default the flight after an initial
settling time.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from skyarm.records.arrays import Array, Mask
from skyarm.records.field_rules import checked
from skyarm.records.files import Fields, number, shown
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import parts
from skyarm.records.read_table import record_from
from skyarm.records.units import positive

if TYPE_CHECKING:
    from skyarm.log.flight_log import Log


SETTLING_SHARE = 1.0 / 3.0
"""Fraction of a flight that the general windows leave to the transient."""

LAST = 5.0
"""Default length (s) of the window before the planned end; at most the remainder after
the settling fraction."""

NAMES = ("steady", "transient", "gust", "hover")
"""Names of the windows that are one interval."""


@positional
class Window:
    """Half-open time interval [start, stop), s."""

    start: float
    stop: float

    def __post_init__(self) -> None:
        for name in ("start", "stop"):
            object.__setattr__(
                self, name, number(getattr(self, name), f"window.{name}", low=0.0)
            )
        if not self.start < self.stop:
            raise ValueError(
                f"window = [{self.start:g}, {self.stop:g}]: must start before it stops"
            )

    @classmethod
    def from_table(cls, value: object, where: str) -> Window:
        """Make a time window from a list [start, stop], s."""
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError(f"{where} = {shown(value)}: must be [start, stop] in s")
        start, stop = (
            number(item, f"{where}[{i}]", low=0.0) for i, item in enumerate(value)
        )
        if not start < stop:
            raise ValueError(f"{where} = {shown(value)}: must start before it stops")
        return cls(start, stop)

    def to_entry(self) -> list[float]:
        """Convert the time window to a list [start, stop] (s) for a file."""
        return [self.start, self.stop]

    def of(self, log: Log) -> Mask:
        """Boolean mask (N,) of a log's instants within the time window."""
        return _within(log.time, [self])

    def __str__(self) -> str:
        return f"[{self.start:.4g}, {self.stop:.4g}) s"


@immutable
class FlightWindows:
    """Time windows of the metrics in a flight of known duration.

    Attributes:
        steady: window of means, RMS and extremes. transient: window of peaks.
        gust: window of the metrics that begin with ``gust_``.
        hover: before the motion starts. holds: while the arm is held away from the
            middle.
        last: s before the planned end of the flight.
        duration: duration of the flight, s.
    """

    steady: Window
    transient: Window
    gust: Window
    hover: Window
    holds: tuple[Window, ...]
    last: float
    duration: float

    def masks(self, time: Array) -> dict[str, Mask]:
        """Boolean masks of the given times (s) in each window, by the window's name."""
        masks = {name: _within(time, [getattr(self, name)]) for name in NAMES}
        masks["holds"] = _within(time, self.holds)
        masks["last"] = time >= self.duration - self.last
        return masks | {"whole": np.ones_like(time, dtype=bool)}

    def plain(self) -> dict[str, float | list[float] | list[list[float]]]:
        """Time windows of the metrics as plain data (s), by name."""
        pairs = {name: _pair(getattr(self, name)) for name in NAMES}
        return {
            **pairs,
            "holds": [_pair(each) for each in self.holds],
            "last": self.last,
        }


@immutable
@checked("windows")
class Windows:
    """Requested time windows of the metrics; a window that is None becomes the
    scenario's, or the default one.

    The general windows are the flight after a settling share of a third (``transient``:
    that share; ``last``: the last 5 s of what follows it). Attributes as of
    :class:`FlightWindows`.
    """

    steady: Window | None = None
    transient: Window | None = None
    gust: Window | None = None
    hover: Window | None = None
    holds: tuple[Window, ...] | None = None
    last: Annotated[
        float | None,
        positive("s", "length of the window before the end of the general flight"),
    ] = None

    def of_flight(self, duration: float, own: Windows | None = None) -> FlightWindows:
        """Complete the requested windows by the scenario's windows and defaults, for a
        flight of given duration.

        Raises:
            ValueError: one of these ends after the flight.
        """
        duration = number(duration, "duration", low=0.0, strict=True)
        self.require_within(duration)
        settled = SETTLING_SHARE * duration
        after = Window(settled, duration)
        # where nobody states windows, all but the transient are what follows it
        general = Windows(
            steady=after,
            transient=Window(0.0, settled),
            gust=after,
            hover=after,
            holds=(after,),
            last=min(LAST, duration - settled),
        )
        # the last that states a window has it
        ranked = (general, own or self, self)
        chosen = dict[str, Any]()
        for one in ranked:
            stated = parts(one.within(duration)).items()
            chosen |= {name: each for name, each in stated if each is not None}
        return FlightWindows(duration=duration, **chosen)

    def within(self, duration: float) -> Windows:
        """Requested time windows that end within a flight of given duration (s)."""
        return Windows(
            **{
                name: getattr(self, name)
                for name, (end, _) in self._ends().items()
                if end <= duration
            }
        )

    def require_within(self, duration: float) -> None:
        """Raise an error if a requested time window ends after a flight of given
        duration (s).

        The default of ``last`` does not: in a shorter flight it is the general one.

        Raises:
            ValueError: one line.
        """
        for name, (end, words) in self._ends().items():
            # the default of last is no request of the user
            if end > duration and (name, end) != ("last", LAST):
                raise ValueError(
                    f"windows.{name} = {words}: must end within the flight of"
                    f" {duration:g} s"
                )

    def _ends(self) -> dict[str, tuple[float, str]]:
        """End time (s) and text of each requested time window, by name."""
        ends = {
            name: (each.stop, str(each))
            for name in NAMES
            if (each := getattr(self, name)) is not None
        }
        if self.holds is not None:
            ends["holds"] = (
                max((each.stop for each in self.holds), default=0.0),
                ", ".join(map(str, self.holds)),
            )
        if self.last is not None:
            ends["last"] = self.last, f"{self.last:g} s"
        return ends


def windows_of(log: Log) -> Windows:
    """Read the time windows of the metrics from a log."""
    stated = {
        name: value
        for name, value in log.info.get("windows", {}).items()
        if name != "duration"
    }
    return record_from(Windows, Fields(stated, "windows"))


def _pair(window: Window) -> list[float]:
    return [window.start, window.stop]


def _within(time: Array, windows: Iterable[Window]) -> Mask:
    inside = np.zeros(time.shape, dtype=bool)
    for window in windows:
        inside |= (time >= window.start) & (time < window.stop)
    return inside
