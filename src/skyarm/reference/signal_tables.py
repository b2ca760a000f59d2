"""Time signals from tables of a scenario file.

A *signal* is a number (held), a list of signals (their sum), or a table with a kind:

* ``constant``: value; start, stop
* ``sine``: amplitude, frequency_hz; phase (rad, 0); start, stop. Time counts from
  ``start`` (0 if absent).
* ``ramp``: start, duration, height; shape ("linear" or "quintic")
* ``sequence``: start, segments = [[duration, value at its end], ...]; initial (0);
  shape
* ``sum``: signals
* ``windowed``: signal; start, stop (zero outside [start, stop))
* ``shifted``: signal, delay
* ``product``: signal, factor (another signal): a sine that a ramp eases in
* ``pulses``: period, width, count; height (1), start (0): on for ``width`` of each
  period
* ``spline``: times, values: least snap through them
* ``samples``: file (CSV), column, time (name of the column of times, "time"); start

Units are SI and radians; ``start`` and ``stop`` make a half-open window. A wrong table
raises ValueError with one line: field, value, what is allowed.
"""

from __future__ import annotations

import math

from skyarm.algebra import Scalar, Scalars
from skyarm.records.field_rules import checked
from skyarm.records.files import Fields, filled_list, number
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import positional
from skyarm.reference.signals import (
    Constant,
    Shifted,
    Signal,
    Sine,
    Windowed,
    sequence,
    signal_from,
)


def constant_from(fields: Fields) -> Signal:
    """Constant signal within a window of time."""
    return _clip_to_window(Constant(fields.number("value")), *window_of(fields))


def sine_from(fields: Fields) -> Signal:
    """Sine signal within a time window, with its time counted from the start of the
    window.
    """
    amplitude, frequency = fields.number("amplitude"), fields.number("frequency_hz")
    sine = Sine(
        amplitude=amplitude, frequency_hz=frequency, phase=fields.number("phase", 0.0)
    )
    start, stop = window_of(fields)
    return _clip_to_window(
        sine if math.isinf(start) else Shifted(sine, start), start, stop
    )


def sequence_from(fields: Fields) -> Signal:
    """Signal of consecutive ramps, each given by its duration and its final value."""
    start, initial = fields.number("start"), fields.number("initial", 0.0)
    shape = fields.choice("shape", ("linear", "quintic"), "linear")
    at, pairs = fields.at("segments"), "[duration, value at its end]"
    segments = []
    for index, pair in enumerate(
        filled_list(fields.take("segments"), at, f"a list of {pairs}")
    ):
        duration, value = filled_list(pair, f"{at}[{index}]", pairs, 2)
        duration = number(duration, f"{at}[{index}][0]", low=0.0, strict=True)
        segments.append((duration, number(value, f"{at}[{index}][1]")))
    return sequence(start, segments, initial=initial, shape=shape)


def windowed_from(fields: Fields) -> Signal:
    """Signal that is zero outside of a window of time."""
    return _clip_to_window(
        signal_from(fields.take("signal"), f"{fields.where}.signal"), *window_of(fields)
    )


def window_of(fields: Fields) -> tuple[float, float]:
    """Start and stop time (s) of a signal's window, infinite if absent from the
    table.
    """
    start = fields.number("start", -math.inf, infinite=True)
    stop = fields.number("stop", math.inf, infinite=True)
    if not start < stop:
        raise ValueError(
            f"{fields.where}.stop = {stop!r}: must be after start = {start!r}"
        )
    return start, stop


def _clip_to_window(signal: Signal, start: float, stop: float) -> Signal:
    """Signal that is zero outside a time window; unchanged if the window is
    infinite.
    """
    return (
        signal
        if math.isinf(start) and math.isinf(stop)
        else Windowed(signal, start, stop)
    )


def component_from(entry: Entry, where: str) -> Signal:
    """Time signal of one component of a vector from a value of a scenario file.

    An exact zero becomes a constant of compiled code.
    """
    # by type: False is equal to zero, and no number
    return (
        Constant(0)
        if type(entry) in (int, float) and entry == 0.0
        else signal_from(entry, where)
    )


@positional
@checked("signals")
class SignalList:
    """List of time signals, one for each component of a vector."""

    signals: tuple[Signal, ...]

    @classmethod
    def from_table(cls, entry: object, where: str) -> SignalList:
        """Read a list of time signals from a value of a scenario file."""
        what = "a list of signals of time, one for each component"
        return cls(
            tuple(
                component_from(each, f"{where}[{i}]")
                for i, each in enumerate(filled_list(entry, where, what))
            )
        )

    def at(self, t: Scalar) -> Scalars:
        """Values of all signals at time t (s)."""
        return tuple(signal.derivatives(t)[0] for signal in self.signals)
