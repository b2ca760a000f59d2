"""Base class of the centroidal law's optional parts, and the control step data that they share.

A part is a record of constants with any of the functions below; its memory is its own record, which the law keeps. A
part that is left out is not in the law's program at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import Scalar, maximum, mul
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.disturbance_observer import Observed, Told
from skyarm.control.blocks.force_control import Pressing
from skyarm.control.blocks.late_actuators import Past
from skyarm.control.blocks.prediction import Actuation, Disturbance
from skyarm.dynamics import State
from skyarm.reference import Reference
from skyarm.reference.preview import Sample
from skyarm.sensing.measurement import Measurement

if TYPE_CHECKING:
    from skyarm.control.laws.centroidal.demands import Demand
    from skyarm.control.laws.centroidal.law import CentroidalMemory
    from skyarm.control.laws.centroidal.parameters import CentroidalParameters


@dataclass(kw_only=True, slots=True)
class Step:
    """Data of one control step of the centroidal law, read and changed by its optional parts.

    Attributes:
        par: constants of this step. memory: of the law, one period earlier. dt: s.
        late: s, after which a command of this step acts, found in flight. The reference and ``state`` are of then.
        past: of the actuators. acted: mean actuation over the period before the measurement.
        signals: x, y, z, yaw and the joints of the reference, series in time.
        observed: of the observer, at the measurement's time. told: accelerations of the model over that period.
        alone: observed disturbance with the adapted feed-forward.
        unknown: disturbance that the demand compensates. force: N, world axes, that the posture follows.
        state: now.
        free, isolated: 1 where base and joints, and the lag, may be adapted, 0 at limits and in contact.
        external: 1 while a force on the tip is part of the observed disturbance.
        pressing: the push; None without one.
        rate: N/s, world axes, trusted part of the observed force's.
        ahead: samples to come of the reference, each with its time from now, s.
        steady: force that the attitude balances, N, world axes.
        demand: of the step, once it is known.
    """

    par: CentroidalParameters
    memory: CentroidalMemory
    measurement: Measurement
    reference: Reference
    dt: Scalar
    signals: Sequence[Taylor]
    observed: Observed
    told: Told
    alone: Disturbance
    unknown: Disturbance
    force: Vec3
    free: tuple[Scalar, ...]
    past: Past
    acted: Actuation
    late: Scalar = 0
    state: State = field(init=False)
    isolated: Scalar = 1.0
    external: Scalar = 0
    pressing: Pressing | None = None
    ahead: Sequence[tuple[Scalar, Sequence[Sample]]] = ()
    rate: Vec3 = ZERO3
    steady: Vec3 = ZERO3
    demand: Demand | None = None

    @property
    def holds(self) -> tuple[Scalar, ...]:
        """Grasp flag, above 0.5 while the tip holds a load: by the reference, else by the gripper; () for neither."""
        return self.reference.load or self.measurement.holds

    def isolate(self, share: Scalar, never: Scalar = 0.0) -> None:
        """Stop adaptation where ``share`` is 0, because an external force is in the observed disturbance.

        ``never`` is 1 where none was there in this flight: the lag is estimated.
        """
        self.free = tuple(mul(each, share) for each in self.free)
        self.isolated = mul(self.isolated, maximum(share, never))


class Part:
    """Base class of an optional part of the centroidal law, whose methods change nothing."""

    __slots__ = ()

    def start(self, joints: int) -> Any:
        """Initial internal state of an optional part of the law, for a vehicle with the given number of joints."""
        return ()

    def delay(self, memory: Any, dt: Scalar) -> Scalar:
        """Delay of the commands, s, across which the law predicts beside the known one."""
        return 0

    def adjust_gains(self, memory: Any, par: CentroidalParameters, dt: Scalar) -> CentroidalParameters:
        """Constants of the law for this control step, as changed by an optional part."""
        return par

    def adjust_reference(self, memory: Any, step: Step) -> Any:
        """Change reference and disturbance of the control step; return the next state of the optional part."""
        return memory

    def learn(self, memory: Any, step: Step) -> Any:
        """State of an optional part at the end of a control step, updated from the computed demand."""
        return memory
