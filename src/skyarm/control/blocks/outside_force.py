"""What of an observed force at the tip comes from outside: without the bias of free flight, and only once it is heard.

Wrong masses, wrong thrust and steady wind stand in an observed force for ever, and a virtual tip would go on for ever.
So the bias b of the observed disturbance is learned before contact (at ``settling`` in the first ``settle`` seconds,
then at ``bias_rate`` as long as nothing is heard); a force above ``threshold`` is heard, in full, until it has stayed
below for ``patience`` seconds. What the base feels of wind beside the tip's force is learned meanwhile, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import data, vector_data
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, logical_and, logical_or, where


@dataclass(frozen=True, kw_only=True, slots=True)
class Hearing:
    """Constants; the threshold is an option of laws, the others are in no unit of the vehicle's size."""

    threshold: Annotated[Scalar, Unit("N", "at the tip, above which a force is heard", low=0.0)] = 0.3
    patience: Annotated[Scalar, Unit("s", "below the threshold until it is heard no more")] = 0.3
    settle: Annotated[Scalar, Unit("s", "at the start of a flight, in which nothing is heard")] = 2.0
    settling: Annotated[Scalar, Unit("rad/s", "filter of what is observed then")] = 3.0
    bias_rate: Annotated[Scalar, Unit("rad/s", "filter of what is observed while nothing is heard")] = 0.5
    wind_rate: Annotated[Scalar, Unit("rad/s", "filter of what the base feels beside a force that is heard")] = 1.0


@dataclass(frozen=True, kw_only=True, slots=True)
class HearingMemory:
    """Memory: what is heard, for how long not, and the bias."""

    age: Annotated[Scalar, Unit("s", "since the start of the flight")]
    heard: Annotated[Scalar, Unit("", "1 while a force from outside is heard")]
    quiet: Annotated[Scalar, Unit("s", "since the force was above the threshold")]
    bias: Disturbance
    felt: Annotated[Vec3 | tuple[()], Unit("N", "bias of a force sensor, axes of the tip")] = ()


def first_hearing(joints: int, sensor: bool = False) -> HearingMemory:
    """Nothing is known."""
    zero = Vec3(0.0, 0.0, 0.0)
    bias = Disturbance(force=zero, torque=zero, efforts=(0.0,) * joints)
    return HearingMemory(age=0.0, heard=0.0, quiet=0.0, bias=bias, felt=zero if sensor else ())


def hear(
    gains: Hearing, memory: HearingMemory, observed: Disturbance, force: Vec3, told: Vec3, dt: Any, felt: Vec3 | None
) -> tuple[HearingMemory, Vec3]:
    """One period.

    Args:
        gains: constants.
        memory: one period earlier.
        observed: disturbance.
        force: N, the tip's in it beside the bias, world axes.
        told: N, world axes, the force that counts: the same, or a sensor's beside its bias.
        dt: s.
        felt: N, axes of the tip, as a sensor tells it; None without one.

    Returns:
        The memory, and the force from outside (N, world axes), 0 while nothing is heard.
    """
    settled: Any = memory.age >= gains.settle
    loud: Any = logical_and(settled, told.dot(told) > gains.threshold * gains.threshold)
    quiet = where(loud, 0.0, memory.quiet + dt)
    heard = where(logical_or(loud, logical_and(memory.heard > 0.5, quiet < gains.patience)), 1.0, 0.0)
    calm: Any = heard < 0.5
    rate = where(settled, gains.bias_rate, gains.settling)
    share = where(calm, low_pass_share(rate, dt), 0.0)
    wind = where(calm, share, low_pass_share(gains.wind_rate, dt))
    bias, beside = memory.bias, observed.force - force * heard
    after = HearingMemory(
        age=where(settled, memory.age, memory.age + dt),
        heard=heard,
        quiet=quiet,
        bias=Disturbance(
            force=vector_data(bias.force + (beside - bias.force) * wind),
            torque=vector_data(bias.torque + (observed.torque - bias.torque) * share),
            efforts=tuple(data(b + (e - b) * share) for b, e in zip(bias.efforts, observed.efforts, strict=True)),
        ),
        felt=_moved(memory.felt, felt, share),
    )
    return after, told * heard


def _moved(bias: Vec3 | tuple[()], felt: Vec3 | None, share: Any) -> Vec3 | tuple[()]:
    """The sensor's bias one period later."""
    return vector_data(bias + (felt - bias) * share) if isinstance(bias, Vec3) and felt is not None else bias
