"""Admittance: the tip answers an external force as a mass, a damper and a spring, and a torque as an inertia does.

Nothing of the law changes but the reference that it tracks: the whole of it is shifted by a virtual body
(:mod:`skyarm.control.laws.centroidal.virtual_body`), with its velocity and acceleration, which the external force
drives, observed or measured. The law goes on to compensate the force itself, so that tip, arm and base stay on the
shifted reference and the apparent dynamics are M, D and K alone, as far as the loops reach. A table ``rotation`` adds
the torque about the tip, which turns the tip of the reference (:mod:`skyarm.control.laws.centroidal.tip_rotation`).

External force: wrong masses, wrong thrust and steady wind stand in an observed force for ever, and a virtual body would
move on for ever. So the bias b of the observed disturbance is learned before contact (at ``settling`` in the first
``settle`` seconds, then at ``bias_rate`` as long as nothing is detected); a force above ``threshold`` is detected, and
counts in full, until it has stayed below for ``patience`` seconds. The wind on the base beside the tip's force is
learned meanwhile, too. A torque about the tip has a threshold of its own; the bias is that of free flight from both.

::

    admittance = { mass = [1, 1, 1], damping = [8, 8, 8], stiffness = [20, 20, 0], normal = [-1, 0, 0] }
    admittance.rotation = { inertia = [0.05, 0.05, 0], damping = [0.3, 0.3, 0], stiffness = [0.5, 0.5, 0] }
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar, logical_and, logical_or, minimum, mul, where
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.disturbance_observer import Observed, disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.blocks.select import vector_data
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.interaction import SENSING
from skyarm.control.laws.centroidal.joint_room import Ends, ends_of
from skyarm.control.laws.centroidal.part import Part, Step
from skyarm.control.laws.centroidal.tip_force import ForceErrors, levers, tip_wrench
from skyarm.control.laws.centroidal.tip_rotation import ArmTurn, TurnWeights, require_turning, turned_reference
from skyarm.control.laws.centroidal.virtual_body import Compliance, VirtualBody, move, rotate, rotation_series
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.records.coerce import concrete
from skyarm.records.files import Fields, shown
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle

MASSES, INERTIAS = (0.01, 1000.0), (0.001, 100.0)
"""kg and kg m^2, least and most of the virtual body."""

FASTEST = 50.0
"""rad/s, of the virtual body: no loop of an arm follows a faster one."""

TORQUE = 0.05
"""N m, usual threshold of a torque: noisy flights of docs/giving_way.md (Turning) have it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Detection:
    """Constants of detection; the threshold is an option of laws, the others are in no unit of the vehicle's size."""

    threshold: Annotated[Scalar, Unit("N", "at the tip, above which a force counts", low=0.0)] = 0.3
    patience: Annotated[Scalar, Unit("s", "below the threshold until it counts no more")] = 0.3
    settle: Annotated[Scalar, Unit("s", "at the start of a flight, in which nothing counts")] = 2.0
    settling: Annotated[Scalar, Unit("rad/s", "filter of the observed disturbance then")] = 3.0
    bias_rate: Annotated[Scalar, Unit("rad/s", "filter of the observed disturbance while nothing counts")] = 0.5
    wind_rate: Annotated[Scalar, Unit("rad/s", "filter of the base's force beside one that counts")] = 1.0


@dataclass(frozen=True, kw_only=True, slots=True)
class RotationGains:
    """Constants of the rotation; ``ends`` marks the joints that have limits."""

    body: Compliance
    threshold: Annotated[Scalar, Unit("N m", "about the tip, above which a torque counts", low=0.0)]
    arm: TurnWeights = TurnWeights()
    ends: Ends = ()

    def __post_init__(self) -> None:
        require_moderate("controller.parts.admittance.rotation.body", "inertia", INERTIAS, self.body)


@dataclass(frozen=True, kw_only=True, slots=True)
class Channel:
    """Memory of the force at the tip, or of the torque about it, and of the body that it drives.

    Attributes:
        value: estimated or measured, without bias. sensed, offset: of a sensor, axes of the tip; empty without one.
    """

    body: VirtualBody = VirtualBody()
    detected: Annotated[Scalar, Unit("", "1 while a force or torque from outside counts")] = 0.0
    quiet: Annotated[Scalar, Unit("s", "since it was above its threshold")] = 0.0
    value: Annotated[Vec3, Unit("N or N m", "at the tip, estimated, world axes")] = Vec3(0.0, 0.0, 0.0)
    sensed: Annotated[Vec3 | tuple[()], Unit("N or N m", "by a sensor at the tip, filtered, axes of the tip")] = ()
    offset: Annotated[Vec3 | tuple[()], Unit("N or N m", "bias of that sensor, axes of the tip")] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class AdmittanceMemory:
    """Memory of the admittance: channels of the force and, if the tip turns, of the torque."""

    age: Annotated[Scalar, Unit("s", "since the start of the flight")]
    bias: Disturbance
    channels: tuple[Channel, ...]
    arm: ArmTurn | tuple[()] = ()

    @property
    def force(self) -> Vec3:
        """Force at the tip, N, world axes."""
        return self.channels[0].value


@dataclass(frozen=True, kw_only=True, slots=True)
class AdmittanceGains(Part):
    """Constants of the admittance."""

    tip: Compliance
    detection: Detection = Detection()
    errors: ForceErrors = ForceErrors()
    rest: Annotated[Scalar, Unit("s", "after a force, from which on a law learns loads, friction and lag")] = 0.5
    sensing: Annotated[Scalar, Unit("rad/s", "filter of a force sensor")] | None = None
    rotation: RotationGains | None = None

    def __post_init__(self) -> None:
        require_moderate("controller.parts.admittance.tip", "inertia", MASSES, self.tip)

    @property
    def senses(self) -> bool:
        """True if a force sensor measures the force: structure."""
        return self.sensing is not None

    @property
    def senses_torque(self) -> bool:
        """True if the sensor measures the torque, too."""
        return self.senses and self.rotation is not None

    def start(self, joints: int) -> AdmittanceMemory:
        """At rest on the reference, nothing known."""
        zero = Vec3(0.0, 0.0, 0.0) if self.senses else ()
        count = 1 if self.rotation is None else 2
        still = (0.0,) * joints
        return AdmittanceMemory(
            age=0.0,
            bias=no_disturbance(joints),
            channels=(Channel(sensed=zero, offset=zero),) * count,
            arm=() if self.rotation is None else ArmTurn(joints=still, joint_rates=still),
        )

    def adjust_reference(self, memory: AdmittanceMemory, step: Step) -> AdmittanceMemory:
        """Move the reference; nothing is adapted while an external force is in what is observed, and after it."""
        sensor = step.measurement.tip_force, step.measurement.tip_torque
        memory, step.signals = shift_reference(
            self, memory, step.par.model.vehicle, step.observed, step.signals, sensor, step.dt
        )
        step.external = memory.channels[0].detected
        step.isolate(self.force_cleared(memory))
        return memory

    def force_cleared(self, memory: AdmittanceMemory) -> Any:
        """1 where nothing of an external force or torque is left in what is observed, else 0."""
        quiet = memory.channels[0].quiet
        for each in memory.channels[1:]:
            quiet = minimum(quiet, each.quiet)
        return where(quiet > self.rest, 1.0, 0.0)


def shift_reference(
    gains: AdmittanceGains,
    memory: AdmittanceMemory,
    vehicle: Vehicle,
    observed: Observed,
    signals: Sequence[Taylor],
    sensor: Sequence[tuple[Any, ...]],
    dt: Any,
) -> tuple[AdmittanceMemory, list[Taylor]]:
    """One period: the memory, and the reference's signals with x, y and z shifted and, if it turns, joints moved.

    Args:
        gains: constants.
        memory: one period earlier.
        vehicle: model.
        observed: of the observer, at the measurement's time.
        signals: of the reference, series in time.
        sensor: force (N) and torque (N m) of a sensor, axes of the tip; empty without one.
        dt: control period, s.
    """
    at = levers(vehicle, observed.quaternion.rotation(), observed.joints)
    d, rotation = disturbance(observed), gains.rotation
    columns = () if rotation is None else jacobian_columns(vehicle, vehicle.frame(), observed.joints)
    wrench = tip_wrench(vehicle, gains.errors, at, [column.angular for column in columns], d - memory.bias)
    channels = []
    for channel, estimate, reading in zip(memory.channels, wrench, sensor, strict=False):
        sensed, value = channel.sensed, estimate
        if isinstance(sensed, Vec3) and isinstance(channel.offset, Vec3) and reading:
            sensed = sensed + (Vec3(*reading) - sensed) * low_pass_share(gains.sensing, dt)
            turned = at.R @ frame_pose(vehicle, vehicle.frame(), observed.joints).R
            value, sensed = turned.apply(sensed - channel.offset), vector_data(sensed)
        channels.append(dataclasses.replace(channel, value=vector_data(value), sensed=sensed))
    thresholds = (gains.detection.threshold, 0.0 if rotation is None else rotation.threshold)
    memory = detect(gains.detection, memory, channels, thresholds, d, wrench[0], dt)
    force, *others = memory.channels
    body, (place, velocity, acceleration) = move(gains.tip, force.body, force.value * force.detected, dt)
    channels, arm = [dataclasses.replace(force, body=body)], memory.arm
    if rotation is not None and isinstance(arm, ArmTurn):
        (torque,) = others
        turn, vector = rotate(rotation.body, torque.body, torque.value * torque.detected, dt)
        channels.append(dataclasses.replace(torque, body=turn))
        E = rotation_series(vector)
        arm, signals = turned_reference(vehicle, rotation.arm, rotation.ends, arm, E, signals, dt)
    moved = (
        signal + Taylor((p, v, mul(0.5, a), 0, 0))
        for signal, p, v, a in zip(signals[:3], place, velocity, acceleration, strict=True)
    )
    return dataclasses.replace(memory, channels=tuple(channels), arm=arm), [*moved, *signals[3:]]


def detect(
    gains: Detection,
    memory: AdmittanceMemory,
    channels: Sequence[Channel],
    thresholds: Sequence[Any],
    observed: Disturbance,
    force: Vec3,
    dt: Any,
) -> AdmittanceMemory:
    """One period of detection: which channels count, and the biases.

    Args:
        gains: constants.
        memory: one period earlier.
        channels: with the values of this period.
        thresholds: N, N m, of each.
        observed: disturbance.
        force: N, the tip's in it beside the bias, world axes.
        dt: s.
    """
    settled, calm, found = memory.age >= gains.settle, None, []
    for each, threshold in zip(channels, thresholds, strict=False):
        loud = logical_and(settled, each.value.dot(each.value) > threshold * threshold)
        quiet = where(loud, 0.0, each.quiet + dt)
        counts = logical_or(loud, logical_and(each.detected > 0.5, quiet < gains.patience))
        found.append(dataclasses.replace(each, detected=where(counts, 1.0, 0.0), quiet=quiet))
        silent = found[-1].detected < 0.5
        calm = silent if calm is None else logical_and(calm, silent)
    share = where(calm, low_pass_share(where(settled, gains.bias_rate, gains.settling), dt), 0.0)
    wind = where(calm, share, low_pass_share(gains.wind_rate, dt))
    beside = dataclasses.replace(observed, force=observed.force - force * found[0].detected)
    offsets = [
        vector_data(each.offset + (each.sensed - each.offset) * share)
        if isinstance(each.offset, Vec3) and isinstance(each.sensed, Vec3)
        else ()
        for each in found
    ]
    return dataclasses.replace(
        memory,
        age=where(settled, memory.age, memory.age + dt),
        bias=memory.bias.blend_towards(beside, share, wind),
        channels=tuple(dataclasses.replace(each, offset=b) for each, b in zip(found, offsets, strict=True)),
    )


def admittance_gains(
    table: Any, mode: str, vehicle: Vehicle, sensor: bool, lead: float, others: Mapping[str, bool]
) -> AdmittanceGains | None:
    """Constants of the option ``admittance``; None where it is left out.

    Args:
        table: mass, damping, stiffness; normal, threshold; rotation.
        mode: of the law.
        vehicle: model.
        sensor: whether a force sensor measures the force.
        lead: s, lag of the observer.
        others: options that cannot fly beside it, and whether they are used.

    Raises:
        ControllerError: a table that is none, or a law without a tip to lead.
    """
    if table is None:
        return None
    at, lag = "controller.admittance", 1.0 / SENSING if sensor else lead
    if mode != "tip" or not vehicle.n:
        raise ControllerError(f"{at} = {shown(table)}: must be left out but in mode 'tip' with joints")
    for name, used in others.items():
        if used:
            raise ControllerError(f"{at} = {shown(table)}: must be left out beside {name}")
    try:
        fields = Fields(table, at)
        turning, rotation = fields.take("rotation", None), None
        axes = _axes(fields.vector("normal"), f"{at}.normal") if "normal" in fields.table else ()
        tip = _compliance(fields, "mass", MASSES, lag, axes, needed=turning is None)
        detection = Detection(threshold=fields.number("threshold", Detection().threshold, low=0.0))
        fields.done()
        if turning is not None:
            fields = Fields(turning, f"{at}.rotation")
            body = _compliance(fields, "inertia", INERTIAS, lag, axes, needed=True)
            threshold = fields.number("threshold", TORQUE, low=0.0)
            fields.done()
            require_turning(vehicle, at, turning, sensor)
            rotation = RotationGains(body=body, threshold=threshold, ends=ends_of(vehicle))
    except ValueError as error:
        raise ControllerError(str(error)) from None
    sensing = SENSING if sensor else None
    return AdmittanceGains(tip=tip, detection=detection, rotation=rotation, sensing=sensing)


def _compliance(
    fields: Fields, name: str, limits: tuple[float, float], lead: float, axes: tuple[Vec3, ...], *, needed: bool
) -> Compliance:
    """The compliance of a table whose inertias are called ``name``; structural zeros along axes that are held."""
    rows: list[tuple[Any, ...]] = []
    for each in (name, "damping", "stiffness"):
        rows.append(fields.vector(each))
        fields.numbers(each, low=0.0)
    if needed and not any(rows[0]):
        raise ValueError(f"{fields.at(name)} = {shown(list(rows[0]))}: must be above 0 along an axis at least")
    inertia = tuple(each or 0 for each in rows[0])
    found = Compliance(inertia=inertia, damping=rows[1], stiffness=rows[2], lead=lead, axes=axes)
    require_moderate(fields.where, name, limits, found)
    damping, stiffness = (tuple(v if m else 0 for v, m in zip(row, inertia, strict=True)) for row in rows[1:])
    return dataclasses.replace(found, damping=damping, stiffness=stiffness)


def require_moderate(at: str, name: str, limits: tuple[float, float], body: Compliance) -> None:
    """Refuse plain numbers of a virtual body that no loop can follow, of a table or of a sweep.

    Args:
        at: name of the record.
        name: of its inertias in messages.
        limits: of its inertias.
        body: checked. An axis whose inertia is a structural 0 is held.

    Raises:
        ControllerError: one line with field, value and what is allowed.
    """
    least, most = limits
    bounds = {"damping": (FASTEST, f"{FASTEST:g} 1/s"), "stiffness": (FASTEST**2, f"({FASTEST:g} rad/s)^2")}
    for i, (inertia, *row) in enumerate(zip(body.inertia, body.damping, body.stiffness, strict=True)):
        if not concrete(inertia, *row):
            continue
        if type(inertia) is not int and not least <= inertia <= most:
            allowed = f"must be {'0 or ' if inertia else ''}from {least:g} to {most:g}"
            raise ControllerError(f"{at}.{name}[{i}] = {shown(inertia)}: {allowed}")
        for (field, (limit, unit)), value in zip(bounds.items(), row, strict=True):
            if value > limit * inertia:
                allowed = f"must be at most {unit} times the {name}"
                if not inertia:
                    allowed = f"must be 0 along an axis of {name} 0, which is held"
                raise ControllerError(f"{at}.{field}[{i}] = {shown(value)}: {allowed}")


def _axes(normal: tuple[float, float, float], at: str) -> tuple[Vec3, ...]:
    """The unit normal, a level tangent (of a level surface: x), and the one across both."""
    length = math.sqrt(sum(c * c for c in normal))
    if not 1e-6 < length < math.inf:
        raise ValueError(f"{at} = {shown(list(normal))}: must have a direction")
    n = Vec3(*(c / length for c in normal))
    level = math.hypot(n.x, n.y)
    first = Vec3(-n.y / level, n.x / level, 0.0) if level > 1e-6 else Vec3(1.0, 0.0, 0.0)
    second = n.cross(first)
    return n, first, Vec3(*(c / math.sqrt(second.dot(second)) for c in second))
