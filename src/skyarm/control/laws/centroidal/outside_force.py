"""What of an observed force at the tip comes from outside: without the bias of free flight, and only once it is heard.

Wrong masses, wrong thrust and steady wind stand in an observed force for ever, and a virtual tip would go on for ever.
So the bias b of the observed disturbance is learned before contact (at ``settling`` in the first ``settle`` seconds,
then at ``bias_rate`` as long as nothing is heard); a force above ``threshold`` is heard, in full, until it has stayed
below for ``patience`` seconds. What the base feels of wind beside the tip's force is learned meanwhile, too. A torque
about the tip is heard likewise, above a threshold of its own; the bias is that of free flight from both.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance, no_disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import vector_data
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


@dataclass(frozen=True, kw_only=True, slots=True)
class TorqueHearing:
    """Memory of what is heard of a torque, as :class:`HearingMemory` of a force."""

    heard: Annotated[Scalar, Unit("", "1 while a torque from outside is heard")]
    quiet: Annotated[Scalar, Unit("s", "since the torque was above the threshold")]
    felt: Annotated[Vec3 | tuple[()], Unit("N m", "bias of a torque sensor, axes of the tip")] = ()


def first_hearing(joints: int, sensor: bool = False) -> HearingMemory:
    """Nothing is known."""
    felt = Vec3(0.0, 0.0, 0.0) if sensor else ()
    return HearingMemory(age=0.0, heard=0.0, quiet=0.0, bias=no_disturbance(joints), felt=felt)


def hear(
    gains: Hearing,
    memory: HearingMemory,
    observed: Disturbance,
    force: Vec3,
    told: Vec3,
    dt: Any,
    felt: Vec3 | None,
    turned: Any = None,
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
        turned: 1 while a torque is heard, too; None of a law that hears none.

    Returns:
        The memory, and the force from outside (N, world axes), 0 while nothing is heard.
    """
    settled, quiet, heard = _heard(gains, memory, memory, gains.threshold, told, dt)
    calm: Any = heard < 0.5
    if turned is not None:
        calm = logical_and(calm, turned < 0.5)
    share = where(calm, _bias_share(gains, settled, dt), 0.0)
    wind = where(calm, share, low_pass_share(gains.wind_rate, dt))
    beside = dataclasses.replace(observed, force=observed.force - force * heard)
    after = HearingMemory(
        age=where(settled, memory.age, memory.age + dt),
        heard=heard,
        quiet=quiet,
        bias=memory.bias.filtered(beside, share, wind),
        felt=_moved(memory.felt, felt, share),
    )
    return after, told * heard


def hear_torque(
    gains: Hearing,
    memory: HearingMemory,
    then: TorqueHearing,
    threshold: Any,
    told: Vec3,
    pushed: Any,
    dt: Any,
    felt: Vec3 | None,
) -> tuple[TorqueHearing, Vec3]:
    """One period of a torque about the tip.

    Args:
        gains: constants, those of a force.
        memory: of the force, one period earlier.
        then: one period earlier.
        threshold: N m, above which a torque is heard.
        told: N m, world axes, the torque that counts: the observed one beside its bias, or a sensor's beside its own.
        pushed: N, world axes, the force that counts.
        dt: s.
        felt: N m, axes of the tip, as a sensor tells it; None without one.

    Returns:
        The memory, and the torque from outside (N m, world axes), 0 while none is heard.
    """
    settled, quiet, heard = _heard(gains, memory, then, threshold, told, dt)
    _, _, other = _heard(gains, memory, memory, gains.threshold, pushed, dt)
    share = where(logical_and(heard < 0.5, other < 0.5), _bias_share(gains, settled, dt), 0.0)
    return TorqueHearing(heard=heard, quiet=quiet, felt=_moved(then.felt, felt, share)), told * heard


def _heard(
    gains: Hearing, memory: HearingMemory, own: HearingMemory | TorqueHearing, threshold: Any, told: Vec3, dt: Any
) -> tuple[Any, Any, Any]:
    """Whether the first seconds are over, the seconds since ``told`` was above its threshold, and 1 while it counts."""
    settled: Any = memory.age >= gains.settle
    loud: Any = logical_and(settled, told.dot(told) > threshold * threshold)
    quiet = where(loud, 0.0, own.quiet + dt)
    heard = where(logical_or(loud, logical_and(own.heard > 0.5, quiet < gains.patience)), 1.0, 0.0)
    return settled, quiet, heard


def _bias_share(gains: Hearing, settled: Any, dt: Any) -> Any:
    """The share of what is observed that the bias takes over in a period in which nothing is heard."""
    return low_pass_share(where(settled, gains.bias_rate, gains.settling), dt)


def _moved(bias: Vec3 | tuple[()], felt: Vec3 | None, share: Any) -> Vec3 | tuple[()]:
    """The sensor's bias one period later."""
    return vector_data(bias + (felt - bias) * share) if isinstance(bias, Vec3) and felt is not None else bias
