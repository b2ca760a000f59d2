"""Sensors made of channels: each with its own rate and delay, errors by channel, readings that bear their instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.dynamics.state import State
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, where
from skyarm.scalars.philox import normals
from skyarm.sensors.channel import Channel, Dropouts
from skyarm.sensors.sensor import Sensor
from skyarm.vehicle.vehicle_records import Vehicle

Quantities = tuple[tuple[str, Channel, tuple[Any, ...]], ...]
"""Name, errors and true components of each channel."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ChannelMemory:
    """What a sensor keeps from reading to reading.

    Attributes:
        read: 1 after the first reading. drifts: bias of each channel that drifts, else nothing.
        lost: 1 while the link loses readings at random. last: the last reading that came; nothing without dropouts.
        own: of the kind of sensor.
    """

    read: Scalar
    drifts: tuple[tuple[Scalar, ...], ...]
    lost: Scalar
    last: Any
    own: Any = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class ChannelSensor(Sensor):
    """A sensor whose reading is a record of channels, its first field the instant at which it was read.

    A reading that is lost leaves the one before, with that one's instant: who uses readings tells a new one by it.

    Attributes:
        frequency: readings a second; 0 for one each control period. latency: age of a reading when it arrives, s.
        dropouts: readings that do not come.
    """

    frequency: Annotated[float, Unit("Hz", "readings a second, 0: one each control period", low=0.0)] = 0.0
    latency: Annotated[float, Unit("s", "age of a reading when it arrives", low=0.0)] = 0.0
    dropouts: Dropouts = Dropouts()

    def __post_init__(self) -> None:
        accept_fields(self, "")

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Name, errors and true components of each channel."""
        raise NotImplementedError(f"{type(self).__name__} must say what it measures")

    def examples(self, vehicle: Vehicle) -> Quantities:
        """The same of some state: names and numbers of components count."""
        return self.quantities(*_example(vehicle))

    def reading(self, t: Any, values: Sequence[tuple[Any, ...]], state: State, own: Any, first: Any, dt: float) -> Any:
        """Memory of the kind of sensor, and the record of a reading from the components of each channel."""
        raise NotImplementedError(f"{type(self).__name__} must say how it reads")

    def first_own(self, vehicle: Vehicle) -> Any:
        """Memory of the kind of sensor before the first reading."""
        return ()

    def require_vehicle(self, vehicle: Vehicle) -> None:
        """Biases and offsets are one for each component."""
        for name, channel, truth in self.examples(vehicle):
            channel.require_count(len(truth), name)

    def uniforms(self, vehicle: Vehicle) -> int:
        """Pairs for normal numbers, and one for losses at random."""
        return self._uniforms(self.examples(vehicle))

    def _uniforms(self, quantities: Quantities) -> int:
        count = sum(channel.normals(len(truth)) for _, channel, truth in quantities)
        return count + count % 2 + (2 if self.dropouts.random else 0)

    def start(self, vehicle: Vehicle) -> ChannelMemory:
        """Nothing read yet."""
        state, quantities = _example(vehicle)[0], self.examples(vehicle)
        own, last = self.first_own(vehicle), ()
        if self.dropouts.any:
            _, example = self.reading(0.0, [truth for _, _, truth in quantities], state, own, False, 1.0)
            last = rebuild(example, iter([0.0] * len(leaves(example))))
        drifts = tuple(c.start(len(truth)) for _, c, truth in quantities)
        return ChannelMemory(read=0.0, drifts=drifts, lost=0.0, last=last, own=own)

    def measure(
        self, memory: ChannelMemory, t: Any, state: State, specific_force: Vec3, draws: Sequence[Any], dt: float
    ) -> tuple[ChannelMemory, Any]:
        """One reading."""
        return self.read(memory, t, self.quantities(state, specific_force), state, draws, dt)

    def read(
        self, memory: ChannelMemory, t: Any, quantities: Quantities, state: Any, draws: Sequence[Any], dt: float
    ) -> tuple[ChannelMemory, Any]:
        """One reading of some quantities."""
        first = memory.read < 0.5
        if len(draws) != self._uniforms(quantities):
            raise RecordError(
                f"{type(self).__name__.lower()}: a number that is absent varies; make it data first, "
                "by giving it in the file or by with_numbers"
            )
        loss, last = (draws[-2:], draws[:-2]) if self.dropouts.random else ((), draws)
        numbers = iter(normals(last))
        drifts, values = [], []
        for (name, channel, truth), before in zip(quantities, memory.drifts, strict=True):
            share = [next(numbers) for _ in range(channel.normals(len(truth)))]
            drifts.append(channel.drift(before, share, first, dt))
            values.append(channel.read(truth, drifts[-1], share, dt, name, t))
        own, reading = self.reading(t, values, state, memory.own, first, dt)
        lost = memory.lost
        if loss:
            lost = where(first, 0.0, self.dropouts.lost(memory.lost, loss[0], dt))
        if self.dropouts.any:
            silent = self.dropouts.silent(lost, t)
            kept = [
                where(first, new, where(silent, old, new))
                for new, old in zip(leaves(reading), leaves(memory.last), strict=True)
            ]
            reading = rebuild(memory.last, iter(kept))
        following = ChannelMemory(
            read=memory.read * 0.0 + 1.0,
            drifts=tuple(drifts),
            lost=lost,
            last=reading if self.dropouts.any else (),
            own=own,
        )
        return following, reading


def _example(vehicle: Vehicle) -> tuple[State, Vec3]:
    """A state and a specific force whose numbers are not used."""
    still = (0.0,) * vehicle.n
    zero = Vec3(0.0, 0.0, 0.0)
    state = State(
        position=zero, quaternion=Quaternion(1.0, 0.0, 0.0, 0.0), velocity=zero, rate=zero,
        joints=still, joint_rates=still, rotor_speeds=(0.0,) * len(vehicle.rotors),
    )  # fmt: skip
    return state, zero
