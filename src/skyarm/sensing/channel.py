"""Error models of sensors: scale, bias, random walk, white noise, resolution, rate,
delay and lost readings.

A channel's numbers are structure where they are an int 0: what a channel does not have
costs no operation and no draw.

Sources: IEEE Std 952-1997, annex B and C (noise density, rate random walk, their
discrete forms); Gilbert 1960 (dropouts as a Markov chain of two states).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from itertools import repeat
from typing import Annotated, Any, ClassVar

from skyarm.algebra import ZERO3_DATA, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    add,
    data,
    divide,
    floor,
    logical_and,
    logical_or,
    minimum,
    mul,
    sqrt,
    where,
)
from skyarm.algebra.scalars.philox import normals
from skyarm.dynamics.state import State, example_state
from skyarm.records.coerce import RecordError, absent, concrete
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import Tree, blend, rebuild
from skyarm.records.units import Unit, declared_fields, nonnegative
from skyarm.reference.signal_tables import SignalList
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle import Vehicle


@immutable
@checked("")
class Channel:
    """Error model of a measured quantity with one or more components, in the unit of
    the quantity (u).

    A component reads ``(1 + scale) truth + bias + drift + noise``, rounded to the
    resolution. The drift begins at a normal number of deviation ``turn_on``, drawn for
    each episode, and walks.

    Attributes:
        sigma: deviation of the white noise of a reading. density: noise density; adds
            density^2 / dt to its variance.
        bias: fixed, one number for each component; none for no bias.
        turn_on: deviation of the bias with which an episode begins. walk: density of
            the bias's random walk.
        offset: bias as signals of time, one for each component, on top of the others;
            None for none.
        scale: error of the scale factor. resolution: step of the reading, which is
            rounded to the nearest.
    """

    sigma: Annotated[
        Scalar,
        nonnegative(
            "u",
            "standard deviation of the white noise of a reading",
            effect="higher values make readings noisier",
        ),
    ] = 0
    density: Annotated[
        Scalar,
        nonnegative(
            "u/sqrt(Hz)",
            "noise density; adds density^2 / dt to the variance of a reading",
            effect="higher values make readings noisier, more so at high rates",
        ),
    ] = 0
    bias: Annotated[
        Scalars, Unit("u", "constant bias, one number for each component")
    ] = ()
    turn_on: Annotated[
        Scalar,
        nonnegative(
            "u",
            "standard deviation of the bias at the start of an episode",
            begins=True,
            effect="higher values make episodes differ more",
        ),
    ] = 0
    walk: Annotated[
        Scalar,
        nonnegative(
            "u/s/sqrt(Hz)",
            "density of the bias's random walk",
            effect="higher values make the bias drift faster",
        ),
    ] = 0
    scale: Annotated[Scalar, Unit("", "relative error of the scale factor")] = 0
    resolution: Annotated[
        Scalar, nonnegative("u", "step to which readings are rounded; 0: none")
    ] = 0
    offset: SignalList | None = field_if_any(default=None)

    @property
    def drifts(self) -> bool:
        """True if the error model has a random initial bias or a random walk of the
        bias.
        """
        return not (absent(self.turn_on) and absent(self.walk))

    @property
    def noisy(self) -> bool:
        """True if the error model has white noise."""
        return not (absent(self.sigma) and absent(self.density))

    def normals(self, count: int) -> int:
        """Count of standard normal numbers that a reading of ``count`` components
        draws.
        """
        return count * (self.drifts + self.noisy)

    def require_count(self, count: int, where_is: str) -> None:
        """Refuse sensor biases and offsets that do not have ``count`` components.

        ``where_is`` is the path of the error model in messages.

        Raises:
            RecordError: one line with field, value and what is allowed.
        """
        offset = () if self.offset is None else self.offset.signals
        for name, given, what in (
            ("bias", self.bias, "numbers"),
            ("offset", offset, "signals"),
        ):
            if given and len(given) != count:
                allowed = (
                    f"must be {count}, or none"
                    if count
                    else "must be left out: the vehicle has none of them"
                )
                raise RecordError(f"{where_is}.{name} = {len(given)} {what}: {allowed}")

    def start(self, count: int) -> tuple[float, ...]:
        """Zero initial value of each component's random bias; () for an error model
        without random bias.
        """
        return (0.0,) * count if self.drifts else ()

    def drift(
        self,
        before: Sequence[Scalar],
        draws: Sequence[Scalar],
        first: Scalar,
        dt: float,
    ) -> Scalars:
        """Random bias of each component at a reading: random at the first reading, then
        a random walk.

        Args:
            before: random bias of the reading before.
            draws: standard normal numbers, the first of which are used.
            first: condition, true at the first reading of an episode.
            dt: s between readings.
        """
        # the variance of a random walk grows by density^2 dt between two readings
        step = mul(self.walk, dt**0.5)
        return tuple(
            where(first, data(mul(self.turn_on, n)), add(b, mul(step, n)))
            for b, n in zip(before, draws, strict=False)
        )

    def read(
        self,
        truth: Sequence[Scalar],
        drift: Sequence[Scalar],
        draws: Sequence[Scalar],
        dt: float,
        t: Scalar = 0.0,
    ) -> Scalars:
        """Reading of a quantity with all errors of the error model.

        Args:
            truth: components.
            drift: random bias of this reading, or nothing.
            draws: standard normal numbers of :meth:`normals`.
            dt: s between readings.
            t: s, of the reading.
        """
        moved = () if self.offset is None else self.offset.at(t)
        # the first draws are those of the random bias
        noise = draws[len(drift) :]
        deviation = self.deviation(dt)
        readings = []
        for i, value in enumerate(truth):
            off = self.bias[i] if self.bias else 0
            off = add(off, moved[i]) if moved else off
            off = add(off, drift[i]) if drift else off
            off = add(off, mul(deviation, noise[i])) if self.noisy else off
            scaled = value if absent(self.scale) else value * add(1.0, self.scale)
            # resolution comes last, as a converter rounds what its sensor gives
            readings.append(self.quantize(add(scaled, off)))
        return tuple(readings)

    def deviation(self, dt: float) -> Scalar:
        """Standard deviation of a reading's white noise; an int 0 without noise."""
        if absent(self.density):
            return self.sigma
        # white noise of a density, averaged over dt, has the variance density^2 / dt
        discrete = self.density * dt**-0.5
        return (
            discrete
            if absent(self.sigma)
            else sqrt(self.sigma * self.sigma + discrete * discrete)
        )

    def quantize(self, value: Scalar) -> Scalar:
        """Round a value to the nearest multiple of the resolution."""
        if absent(self.resolution):
            return value
        near = floor(divide(value, self.resolution) + 0.5) * self.resolution
        # a resolution that varies between episodes may be 0, which rounds nothing
        return where(self.resolution > 0.0, near, value)


@immutable
class Dropouts:
    """Loss of readings, at random and in given time intervals; the first reading of an
    episode always arrives.

    At random the link is a Markov chain of two states: a share of the readings is lost,
    in runs of a mean duration.

    Attributes:
        share: share of the readings that is lost at random. duration: mean length of a
            run of them, s; 0, or less than that of independent losses, for losses that
            are independent of each other.
        intervals: first and last instant of each interval in which no reading is taken,
            s.
    """

    share: Annotated[
        # below 1, because the probability of a loss's begin divides by 1 - share
        Scalar, nonnegative("", "fraction of the readings lost at random", high=0.99)
    ] = 0
    duration: Annotated[
        Scalar,
        nonnegative(
            "s",
            "mean duration of a run of lost readings",
            effect="longer runs demand more prediction",
        ),
    ] = 0
    intervals: Annotated[
        tuple[tuple[Scalar, Scalar], ...],
        Unit("s", "first and last instant of each interval without readings"),
    ] = ()

    def __post_init__(self) -> None:
        accept_fields(self, "")
        for i, (begin, end) in enumerate(self.intervals):
            if concrete(begin, end) and not 0.0 <= begin < end:
                raise RecordError(
                    f"intervals[{i}] = [{begin:g}, {end:g}]: must begin at 0 or later,"
                    " and end later"
                )

    @property
    def random(self) -> bool:
        """True if readings are lost at random."""
        return not absent(self.share)

    @property
    def any(self) -> bool:
        """True if readings are lost at all."""
        return self.random or bool(self.intervals)

    def lost(self, before: Scalar, draw: Scalar, dt: float) -> Scalar:
        """Data-link state at a reading: 1.0 while readings are lost at random, else 0.0
        (two-state Markov chain).

        Args:
            before: the state at the reading before.
            draw: uniform number.
            dt: s between readings.
        """
        # a run ends with probability e and begins with b, so that b / (b + e) is the
        # share; 1 - share is independence
        # 1e-12 s: a duration of 0 takes the other side of the minimum, independent
        # losses
        ends = minimum(1.0 - self.share, divide(dt, self.duration + 1e-12))
        begins = ends * divide(self.share, 1.0 - self.share)
        return where(draw < where(before > 0.5, 1.0 - ends, begins), 1.0, 0.0)

    def silent(self, lost: Scalar, t: Scalar) -> Scalar:
        """True if no reading arrives at time ``t`` (s): lost at random or within a
        given interval.
        """
        missing: Scalar = lost > 0.5
        for begin, end in self.intervals:
            # half a microsecond: an interval's ends are instants of the loop but for
            # rounding
            missing = logical_or(missing, logical_and(t > begin - 5e-7, t < end - 5e-7))
        return missing


Quantities = tuple[tuple[str, Channel, Scalars], ...]
"""Name, errors and true components of each channel."""


@immutable
class ChannelMemory:
    """Internal state of a sensor between two readings: random biases, data-link loss
    and last reading.

    Attributes:
        read: 1 after the first reading. drifts: bias of each channel that drifts, else
            nothing.
        lost: 1 while the link loses readings at random. last: the last reading that
            came; nothing without dropouts.
        own: state of the kind of sensor.
    """

    read: Scalar
    drifts: tuple[Scalars, ...]
    lost: Scalar
    last: Tree
    own: Any = ()


SampleRate = Annotated[
    float,
    nonnegative(
        "Hz",
        "readings a second; 0: one each control period",
        fixed=True,
        effect="lower rates leave the estimator with older readings",
    ),
]


@immutable
class ChannelSensor(Sensor):
    """Base class of sensors whose reading has a time stamp and one field per measured
    quantity.

    A lost reading leaves the one before with its instant, by which estimators recognise
    a new reading.

    Attributes:
        frequency: sampling rate, Hz; 0 for one reading each control period. latency: s,
            until a reading arrives.
        dropouts: readings that do not come.
    """

    frequency: SampleRate = 0.0
    latency: Annotated[
        float,
        nonnegative(
            "s",
            "age of a reading when it arrives",
            fixed=True,
            effect="older readings make the estimate lag more",
        ),
    ] = 0.0
    dropouts: Dropouts = Dropouts()

    def __post_init__(self) -> None:
        accept_fields(self, "")

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Name, error model and true components of each measured quantity."""
        raise NotImplementedError(f"{type(self).__name__} must define quantities()")

    def channels(self, **values: Iterable[Scalar]) -> Quantities:
        """Name, error model (the sensor's field of that name) and given components of
        each quantity.
        """
        # not strict: the numbers of the white noise follow those of the drift
        return tuple(
            (name, getattr(self, name), tuple(components))
            for name, components in values.items()
        )

    def examples(self, vehicle: Vehicle) -> Quantities:
        """Name, error model and example components of each measured quantity."""
        return self.quantities(example_state(*vehicle.sizes), ZERO3_DATA)

    record: ClassVar[type]
    """Record type of a reading: the time, then a field for each channel."""

    def reading(
        self,
        t: Scalar,
        values: Sequence[Scalars],
        state: State,
        own: Any,
        first: Scalar,
        dt: float,
    ) -> tuple[Tree, Tree]:
        """Make the reading from the values of all quantities; return the sensor's
        internal state and the reading.
        """
        fields = zip(_makers(self.record).items(), values, strict=True)
        return own, self.record(
            time=t, **{name: make(value) for (name, make), value in fields}
        )

    def first_own(self, vehicle: Vehicle) -> Tree:
        """Initial internal state that only this type of sensor has; () for none."""
        return ()

    def require_vehicle(self, vehicle: Vehicle) -> None:
        """Refuse sensor biases and offsets whose number of components does not fit the
        vehicle.
        """
        for name, channel, truth in self.examples(vehicle):
            channel.require_count(len(truth), name)

    def uniforms(self, vehicle: Vehicle) -> int:
        """Count of uniform random numbers per reading: an even count for noise, and two
        for random losses.
        """
        return self._uniforms(self.examples(vehicle))

    def _uniforms(self, quantities: Quantities) -> int:
        count = sum(channel.normals(len(truth)) for _, channel, truth in quantities)
        # normals are made of pairs of uniforms (Box, Muller), so their count is even
        # for losses: a block of the generator gives two, of which the first is used
        return count + count % 2 + (2 if self.dropouts.random else 0)

    def start(self, vehicle: Vehicle) -> ChannelMemory:
        """Initial internal state of the sensor, before the first reading."""
        state, quantities = example_state(*vehicle.sizes), self.examples(vehicle)
        own = self.first_own(vehicle)
        last: Tree = ()
        if self.dropouts.any:
            _, example = self.reading(
                0.0, [truth for _, _, truth in quantities], state, own, False, 1.0
            )
            # of the example the shape alone counts, because a first reading always
            # arrives
            last = rebuild(example, repeat(0.0))
        drifts = tuple(c.start(len(truth)) for _, c, truth in quantities)
        return ChannelMemory(read=0.0, drifts=drifts, lost=0.0, last=last, own=own)

    def measure(
        self,
        memory: ChannelMemory,
        t: Scalar,
        state: State,
        specific_force: Vec3,
        draws: Sequence[Scalar],
        dt: float,
    ) -> tuple[ChannelMemory, Tree]:
        """Take one reading of the true state; return the sensor's next internal state
        and the reading.
        """
        return self.read(
            memory, t, self.quantities(state, specific_force), state, draws, dt
        )

    def read(
        self,
        memory: ChannelMemory,
        t: Scalar,
        quantities: Quantities,
        state: Any,
        draws: Sequence[Scalar],
        dt: float,
    ) -> tuple[ChannelMemory, Tree]:
        """Take one reading of given quantities; return the sensor's next internal state
        and the reading.
        """
        first = memory.read < 0.5
        if len(draws) != self._uniforms(quantities):
            raise RecordError(
                f"{type(self).__name__.lower()}: a number that is absent varies; make"
                " it data first, by with_numbers or a small number in the file"
            )
        loss, last = (draws[-2:], draws[:-2]) if self.dropouts.random else ((), draws)
        numbers = iter(normals(last))
        drifts, values = [], []
        for (_, channel, truth), before in zip(quantities, memory.drifts, strict=True):
            share = [next(numbers) for _ in range(channel.normals(len(truth)))]
            drifts.append(channel.drift(before, share, first, dt))
            values.append(channel.read(truth, drifts[-1], share, dt, t))
        # readings are lost on the link, so the sensor's own state goes on all the same
        own, reading = self.reading(t, values, state, memory.own, first, dt)
        lost = memory.lost
        if loss:
            lost = where(first, 0.0, self.dropouts.lost(memory.lost, loss[0], dt))
        if self.dropouts.any:
            reading = blend(
                first,
                reading,
                blend(self.dropouts.silent(lost, t), memory.last, reading),
            )
        following = ChannelMemory(
            # 1 of the memory's own kind: of an array or a traced number, too
            read=memory.read * 0.0 + 1.0,
            drifts=tuple(drifts),
            lost=lost,
            last=reading if self.dropouts.any else (),
            own=own,
        )
        return following, reading


# asked at every reading, and the fields of a class do not change
@cache
def _makers(record: type) -> Mapping[str, Callable[[Scalars], Vec3 | Scalar]]:
    """Converters from components to a vector or scalar, one for each field of a sensor
    reading except its time.
    """
    return {
        name: (lambda c: Vec3(*c)) if kind is Vec3 else (lambda c: c[0])
        for name, (kind, _) in declared_fields(record).items()
        if name != "time"
    }
