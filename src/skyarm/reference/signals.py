"""Time signals: scalar functions of time with their first four derivatives.

``derivatives(t)`` gives (value, d1, d2, d3, d4) for any scalar t: float, NumPy array (a
whole table), traced time. At a switch time the right-hand limit holds, in value and in
every derivative; ``switch_times()`` lists those times. Derivatives are those of the
smooth pieces: the impulse of a jump is not represented.

Signals compose: windows, shifts, sums, products, pulses, sequences of ramps and holds,
arcs and spirals.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from skyarm.algebra import Scalar, sums
from skyarm.algebra.scalars import add, cos, floor, logical_and, mul, same, sin, where
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.records.coerce import concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import Fields, number, shown
from skyarm.records.files.user_code import require_result
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import Place, parts
from skyarm.records.path_names import Names, below, path_names
from skyarm.records.read_table import entry_of, record_from
from skyarm.records.registry import find, names
from skyarm.records.units import Unit, nonnegative, positive

Derivatives = tuple[Any, ...]
"""Value and derivatives one to four of a signal."""

Record = TypeVar("Record")

PACKAGE = f"{__name__.partition('.')[0]}."
"""Prefix of the modules whose signals ship with the library."""

SIGNAL = (
    "must be a finite number, a list of signals of time or a table with a kind of"
    " signal"
)
"""Text for messages: allowed entries of a signal."""


class Signal(ABC):
    """Base class of time signals: scalar functions of time with four derivatives."""

    __slots__ = ()

    @abstractmethod
    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives one to four at time t (s)."""

    def __post_init__(self) -> None:
        accept_fields(self, type(self).__name__.lower())

    def path_names(self) -> Names:
        """Names, in parameter paths, of the signal's parameters and of those of a
        signal that it moves or shifts.
        """
        return {name: ((name,),) for name in parts(self)}

    def switch_times(self) -> tuple[float, ...]:
        """List the times (s), in order, at which the signal or one of its derivatives
        may jump.
        """
        return switch_times(tuple(parts(self).values()))

    def __add__(self, other: Signal) -> Signal:
        """Return the sum of two time signals."""
        return Sum((self, other))

    def to_entry(self) -> Any:
        """Entry for a file from which the signal can be read again: a table of its kind
        and its parameters.
        """
        return {"kind": type(self).__name__.lower()} | {
            name: entry_of(each) for name, each in parts(self).items()
        }

    @classmethod
    def from_table(cls, entry: object, where: str) -> Signal:
        """Time signal from a number, list or table of a scenario file."""
        return signal_from(entry, where)


def with_signals(record: Record, change: Callable[[Signal], Signal]) -> Record:
    """Copy of a dataclass with a function applied to every time signal in it."""
    if isinstance(record, Signal):
        return change(record)  # type: ignore[return-value]
    if isinstance(record, tuple):
        items = tuple(with_signals(each, change) for each in record)
        same = all(new is old for new, old in zip(items, record, strict=True))
        return record if same else items  # type: ignore[return-value]
    moved = {name: with_signals(each, change) for name, each in parts(record).items()}
    moved = {
        name: each for name, each in moved.items() if each is not getattr(record, name)
    }
    return dataclasses.replace(record, **moved) if moved else record  # type: ignore[type-var]


def switch_times(record: object) -> tuple[float, ...]:
    """Sorted times (s) at which any time signal in a dataclass, or one of its
    derivatives, may jump.
    """
    signals: list[Signal] = []
    with_signals(record, lambda signal: signals.append(signal) or signal)  # type: ignore[func-returns-value]
    return tuple(sorted({s for signal in signals for s in signal.switch_times()}))


@positional
class Constant(Signal):
    """Signal with a constant value and zero derivatives."""

    value: Annotated[Scalar, Unit("", "constant value, in the unit of the signal")] = (
        0.0
    )

    def to_entry(self) -> Any:
        """Entry for a file: the constant value."""
        return self.value

    own_number: ClassVar[Place] = ("value",)
    """Field that a parameter path to the signal denotes; in a file the signal is a
    plain number."""

    def derivatives(self, t: Scalar) -> Derivatives:
        """Constant value, and zeros as derivatives."""
        return self.value, 0, 0, 0, 0


@immutable
class Ramp(Signal):
    """Ramp signal from 0 to ``height`` within ``duration``; 0 before and ``height``
    after.

    Attributes:
        shape: "linear"; "quintic" = 10 u^3 - 15 u^4 + 6 u^5 with u = (t -
            start)/duration, at rest at both ends; or "nonic", whose third and fourth
            derivatives are zero there, too.
    """

    start: Annotated[Scalar, Unit("s", "time at which the ramp begins")]
    duration: Annotated[Scalar, positive("s", "duration of the ramp")]
    height: Annotated[
        Scalar, Unit("", "value after the ramp, in the unit of the signal")
    ]
    shape: Literal["linear", "quintic", "nonic"] = "linear"

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives one to four of the ramp at time t (s).

        Source: the quintic is the rest-to-rest motion of least jerk, Flash, Hogan 1985.
        """
        rate = 1.0 / self.duration
        blend = {"linear": _linear, "quintic": _quintic, "nonic": _nonic}[self.shape]
        pieces: list[Scalar] = []
        scale = self.height
        for order, piece in enumerate(blend((t - self.start) * rate)):
            after = self.height if order == 0 else 0.0
            # an int of 0 is structure: a derivative that no trace computes
            if type(piece) is int:
                pieces.append(0)
            else:
                until = where(t < self.start + self.duration, piece * scale, after)
                pieces.append(where(t < self.start, 0.0, until))
            scale = scale * rate
        return tuple(pieces)

    def switch_times(self) -> tuple[float, ...]:
        """Start and end time (s) of the ramp."""
        return float(self.start), float(self.start + self.duration)


def _linear(u: Scalar) -> Derivatives:
    """Linear blend u, and its derivatives by u."""
    return u, 1.0, 0, 0, 0


def _quintic(u: Scalar) -> Derivatives:
    """Quintic blend 10 u^3 - 15 u^4 + 6 u^5, and its derivatives by u."""
    u2 = u * u
    return (
        u2 * u * (10.0 + u * (6.0 * u - 15.0)),
        30.0 * u2 * (1.0 + u * (u - 2.0)),
        60.0 * u * (1.0 + u * (2.0 * u - 3.0)),
        60.0 + 360.0 * u * (u - 1.0),
        720.0 * u - 360.0,
    )


def _nonic(u: Scalar) -> Derivatives:
    """Blend u^5 (126 - 420 u + 540 u^2 - 315 u^3 + 70 u^4), and its derivatives by
    u.
    """
    # the derivatives in factors: exactly 0 at both ends
    u2, w = u * u, 1.0 - u
    w2 = w * w
    return (
        u2 * u2 * u * (126.0 + u * (u * (540.0 + u * (70.0 * u - 315.0)) - 420.0)),
        630.0 * (u2 * u2) * (w2 * w2),
        2520.0 * (u2 * u) * (w2 * w) * (1.0 - 2.0 * u),
        2520.0 * u2 * w2 * (3.0 + u * (14.0 * u - 14.0)),
        15120.0 * u * w * (1.0 - 2.0 * u) * (1.0 + u * (7.0 * u - 7.0)),
    )


@immutable
class Sine(Signal):
    """Sine signal: amplitude sin(2 pi frequency_hz t + phase)."""

    amplitude: Annotated[Scalar, Unit("", "amplitude, in the unit of the signal")]
    frequency_hz: Annotated[Scalar, Unit("Hz", "frequency")]
    phase: Annotated[Scalar, Unit("rad", "phase at time 0")] = 0.0

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives one to four of the sine at time t (s)."""
        w = 2.0 * math.pi * self.frequency_hz
        angle = w * t + self.phase
        s, c = self.amplitude * sin(angle), self.amplitude * cos(angle)
        return s, w * c, -(w * w) * s, -(w * w * w) * c, (w * w * w * w) * s


@positional
class Windowed(Signal):
    """Time signal that equals another signal within [start, stop) and is zero
    outside.
    """

    signal: Signal
    start: Annotated[
        Scalar, Unit("s", "start of the interval, included", infinite=True)
    ] = -math.inf
    stop: Annotated[
        Scalar, Unit("s", "end of the interval, excluded", infinite=True)
    ] = math.inf

    def __post_init__(self) -> None:
        Signal.__post_init__(self)
        if concrete(self.start, self.stop) and not self.start < self.stop:
            raise ValueError(
                f"windowed.stop = {self.stop!r}: must be after start = {self.start!r}"
            )

    def path_names(self) -> Names:
        """Names, in parameter paths, of window limits and inner parameters; ``start``
        also shifts an inner sine.
        """
        inner = below(("signal",), path_names(self.signal))
        below_it = {**inner, **Signal.path_names(self)}
        if isinstance(self.signal, Shifted) and isinstance(self.signal.signal, Sine):
            # a circle's start opens its window and is where its angle counts from
            below_it["start"] = (("start",), ("signal", "delay"))
        return below_it

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives of the signal inside the window, zeros outside."""
        return tuple(
            # 0 in and out of the window alike, as structure
            0
            if same(value, 0)
            else where(t < self.start, 0.0, where(t < self.stop, value, 0.0))
            for value in self.signal.derivatives(t)
        )

    def switch_times(self) -> tuple[float, ...]:
        """Start and stop (s) of the window, and the inner signal's switch times between
        them.
        """
        first, last = float(self.start), float(self.stop)
        inner = [s for s in self.signal.switch_times() if first < s < last]
        return tuple(s for s in (first, *inner, last) if math.isfinite(s))


@positional
class Shifted(Signal):
    """Time signal delayed by ``delay`` seconds."""

    signal: Signal
    delay: Annotated[Scalar, Unit("s", "time by which the signal is shifted to later")]

    def path_names(self) -> Names:
        """Names, in parameter paths, of the delay and of the delayed signal's
        parameters.
        """
        inner = below(("signal",), path_names(self.signal))
        return {**inner, **Signal.path_names(self)}

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives of the signal at t - delay."""
        return self.signal.derivatives(t - self.delay)

    def switch_times(self) -> tuple[float, ...]:
        """Switch times of the signal plus the delay, s."""
        return tuple(s + float(self.delay) for s in self.signal.switch_times())


@positional
class Sum(Signal):
    """Sum of several signals; zero if empty."""

    signals: tuple[Signal, ...]

    def path_names(self) -> Names:
        """Names, in parameter paths, of a sum's terms by index, and of the field that
        holds the terms.
        """
        return {str(i): (("signals", str(i)),) for i in range(len(self.signals))} | {
            "signals": (("signals",),)
        }

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives of the sum."""
        total: Derivatives = (0, 0, 0, 0, 0)
        for signal in self.signals:
            total = sums(total, signal.derivatives(t))
        return total


@positional
class Product(Signal):
    """Product of two signals, such as a sine with a ramped amplitude."""

    signal: Signal
    factor: Signal

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives by Leibniz's rule, (f g)^(k) = sum_i C(k, i) f^(i)
        g^(k - i).
        """
        f, g = self.signal.derivatives(t), self.factor.derivatives(t)
        rows: list[Scalar] = []
        for order in range(len(f)):
            total: Scalar = 0
            for i in range(order + 1):
                total = add(total, mul(math.comb(order, i), mul(f[i], g[order - i])))
            rows.append(total)
        return tuple(rows)


@immutable
class Pulses(Signal):
    """Rectangular pulse train: ``count`` pulses of ``height`` and ``width`` (s), one
    per ``period`` (s).

    The value jumps; its derivatives are those of the flat pieces, structural zeros.
    """

    start: Annotated[Scalar, Unit("s", "time of the first pulse")] = 0.0
    period: Annotated[Scalar, positive("s", "time from one pulse to the next")]
    width: Annotated[Scalar, nonnegative("s", "width of a pulse")]
    height: Annotated[
        Scalar, Unit("", "value within a pulse, in the unit of the signal")
    ] = 1.0
    count: Annotated[int, Unit("", "number of pulses", low=1, high=100_000)]

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value ``height`` or 0, and zeros as derivatives."""
        number = floor((t - self.start) / self.period)
        within = (t - self.start) - number * self.period < self.width
        on = logical_and(within, logical_and(number >= 0.0, number < float(self.count)))
        return where(on, self.height, 0.0), 0, 0, 0, 0

    def switch_times(self) -> tuple[float, ...]:
        """Start and end times of all pulses, s."""
        begins = [float(self.start + k * self.period) for k in range(self.count)]
        return tuple(
            sorted({t for begin in begins for t in (begin, begin + float(self.width))})
        )


def sequence(
    start: Scalar,
    segments: Iterable[tuple[Scalar, Scalar]],
    *,
    initial: Scalar = 0.0,
    shape: Any = "linear",
) -> Signal:
    """Signal of consecutive ramps and holds; the last value is held.

    Args:
        start: beginning of the first segment, s.
        segments: (duration in s, value at its end); a segment that ends where it begins
            is a hold.
        initial: value before ``start``.
        shape: shape of every ramp, "linear" or "quintic".
    """
    signals: list[Signal] = [Constant(initial)]
    t, value = start, initial
    for duration, target in segments:
        if concrete(duration) and not duration > 0.0:
            raise ValueError(
                f"sequence: a segment lasts {duration!r} s: must be above 0 s"
            )
        # symbols of a trace cannot be compared; the same one is the same number
        if target is not value and not (concrete(target, value) and target == value):
            signals.append(
                Ramp(start=t, duration=duration, height=target - value, shape=shape)
            )
        t, value = t + duration, target
    return Sum(tuple(signals))


@immutable
class Turning(Signal):
    """One coordinate of a point that moves along a circle or spiral, relative to its
    start.

    The point is (radius + growth a) (u cos a + w sin a) from the axis, a the angle: an
    arc, or with a growth an Archimedean spiral.
    """

    angle: Annotated[Signal, Unit("rad", "angle of the turn from its beginning")]
    radius: Annotated[Scalar, Unit("m", "radius at the beginning")]
    growth: Annotated[Scalar, Unit("m/rad", "growth of the radius per angle")] = 0.0
    u: Annotated[
        Scalar, Unit("", "this coordinate of the radial unit vector at the beginning")
    ]
    w: Annotated[
        Scalar,
        Unit("", "this coordinate of the radial unit vector a quarter of a turn later"),
    ]

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives one to four at time t (s)."""
        a = Taylor.of_derivatives(self.angle.derivatives(t))
        place = (a * self.growth + self.radius) * (
            cos(a) * self.u + sin(a) * self.w
        ) - self.radius * self.u
        return tuple(map(place.derivative, range(5)))


def signal_from(entry: object, where: str) -> Signal:
    """Time signal from a number, list or table of a scenario file; one of Python code
    stays as it is.
    """
    if isinstance(entry, Signal):
        return entry
    if isinstance(entry, list):
        return Sum(
            tuple(
                signal_from(item, f"{where}[{index}]")
                for index, item in enumerate(entry)
            )
        )
    if isinstance(entry, (str, bool)):
        raise ValueError(f"{where} = {shown(entry)}: {SIGNAL}")
    if not isinstance(entry, dict):
        return Constant(number(entry, where))
    fields = Fields(entry, where)
    make = find("signal", fields.choice("kind", names("signal")))
    signal: Signal = (
        record_from(make, fields) if isinstance(make, type) else make(fields)
    )
    fields.done()
    # signals of the library are tested, those of users are not
    return signal if make.__module__.startswith(PACKAGE) else _checked(make, signal)


def _checked(make: object, signal: Signal) -> Signal:
    """Check the value of a user-defined time signal at time 0, and return the
    signal.
    """
    require_result(
        make, signal, isinstance(signal, Signal), "a skyarm.reference.Signal"
    )
    derivatives = signal.derivatives(0.0)
    fine = isinstance(derivatives, tuple) and len(derivatives) == len(
        Constant(0.0).derivatives(0.0)
    )
    require_result(
        signal.derivatives,
        derivatives,
        fine,
        "a tuple of five: value and derivatives one to four",
    )
    return signal
