"""Admittance control of the tip: a virtual mass, damper and spring between an external
force and the reference.

The law compensates the force as ever and the whole reference is shifted, so that the
tip's apparent dynamics are M x'' + D x' + K x = f along each of three axes. f is
measured as g, late by a known time T: the velocity is v = w + T g / M with M w' = g - D
v - K x, f to second order of the lag. A body that damper or spring stop sooner than
within T has not gathered the impulse T f: for it the lead is M / D or sqrt(M / K). The
trapezoidal rule is stable for any numbers that are not negative. Sources: Hogan 1985,
"Impedance control"; Villani, De Schutter, "Force control", Springer Handbook of
Robotics 2016, 9.2.

f is the observed or measured force beyond a bias, estimated before a contact (at
``settling`` in the first ``settle`` seconds, then at ``bias_rate``). A force above
``threshold`` counts until it has stayed below for ``patience`` seconds; meanwhile only
the wind on the base is estimated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from skyarm.algebra import ZERO3_DATA, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    data,
    divide,
    logical_and,
    logical_or,
    maximum,
    sqrt,
    where,
)
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.disturbance_observer import Observed, disturbance
from skyarm.control.blocks.filters import low_pass, low_pass_share
from skyarm.control.blocks.force_control import SENSING, SensorBandwidth
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.blocks.tip_force import ForceErrors, levers, tip_force
from skyarm.control.controller import ControllerError, LawOptions
from skyarm.control.laws.centroidal.parameters import OptionalPart, Step
from skyarm.control.laws.centroidal.step_records import Effect
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.coerce import concrete
from skyarm.records.files import Fields, errors_as, shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit, nonnegative
from skyarm.vehicle import Vehicle

LIGHTEST, HEAVIEST = 0.01, 1000.0
"""Least and largest mass (kg) of the admittance's virtual body; chosen."""

FASTEST = 50.0
"""Largest bandwidth (rad/s) of the admittance's virtual body: no loop of an arm follows
a faster one."""


@immutable
class Compliance:
    """Virtual mass, damping and stiffness of the admittance along three axes; an axis
    of mass int 0 is locked.
    """

    inertia: Annotated[
        Scalars,
        nonnegative(
            "kg",
            "mass of the virtual body along each axis; 0 locks an axis",
            effect="higher values yield more slowly and tolerate more delay",
        ),
    ]
    damping: Annotated[
        Scalars,
        nonnegative(
            "N s/m",
            "damping of the virtual body along each axis",
            effect=(
                "higher values yield more slowly and oscillate less on a stiff surface"
            ),
        ),
    ]
    stiffness: Annotated[
        Scalars,
        nonnegative(
            "N/m",
            "stiffness of the virtual body towards the reference along each axis",
            effect="higher values yield less under a force; 0 does not return",
        ),
    ]
    lead: Annotated[
        Scalar, nonnegative("s", "lag of the measured force that is compensated")
    ]
    axes: Annotated[
        tuple[Vec3, ...],
        Unit(
            "", "unit vectors of the axes, world axes; empty for the world's own axes"
        ),
    ] = ()


@immutable
class VirtualBody:
    """State of the admittance's virtual body: offset from the reference and its rate
    along three axes.
    """

    offset: Annotated[
        Scalars, Unit("m", "displacement from the reference along each axis")
    ] = (
        0.0,
        0.0,
        0.0,
    )
    rate: Annotated[
        Scalars,
        Unit("m/s", "rate of the displacement along each axis, without the lead"),
    ] = (
        0.0,
        0.0,
        0.0,
    )


def move(
    gains: Compliance, memory: VirtualBody, force: Vec3, dt: Scalar
) -> tuple[VirtualBody, tuple[Vec3, ...]]:
    """Next state of the virtual body under a force (N), and its offset with two
    derivatives (m, world axes).
    """
    along = [axis.dot(force) for axis in gains.axes] if gains.axes else list(force)
    axes = zip(
        gains.inertia,
        gains.damping,
        gains.stiffness,
        memory.offset,
        memory.rate,
        along,
        strict=True,
    )
    rates, motions = zip(
        *(_axis_step(axis, gains.lead, dt) for axis in axes), strict=True
    )
    offset = tuple(along_world(gains.axes, each) for each in zip(*motions, strict=True))
    offsets = [
        # a mass that is structure holds its axis where it is
        data(x) if type(M) is int else row[0]
        for M, x, row in zip(gains.inertia, memory.offset, motions, strict=True)
    ]
    return VirtualBody(offset=tuple(offsets), rate=rates), offset


def _axis_step(
    axis: Sequence[Scalar], lead: Scalar, dt: Scalar
) -> tuple[Scalar, tuple[Scalar, Scalar, Scalar]]:
    """Integration step of the virtual body along one axis: its rate, and offset,
    velocity, acceleration.
    """
    M, D, K, x, w, f = axis
    # an int mass is a held axis, known before compilation: nothing of it is computed
    if type(M) is int:
        return data(w), (0, 0, 0)
    per = divide(1.0, M)
    d, k, half = D * per, K * per, 0.5 * dt
    slowed = maximum(maximum(lead * d, 1.0), sqrt(maximum(lead * lead * k, 1.0)))
    ahead = divide(lead, slowed) * per * f
    # w+ = w + h/2 (a + a+), x+ = x + h/2 (v + v+), v = w + ahead, a = f/M - d v - k x
    before = per * f - d * ahead - d * w - k * x
    # a+ with w+ = w + h/2 (a + a+) and x+ = x + h (v + h/4 (a + a+)) put in
    share = half * d + half * half * k
    then = divide(before - dt * k * (w + ahead) - share * before, 1.0 + share)
    rate = w + half * (before + then)
    velocity = rate + ahead
    return rate, (x + half * (w + ahead + velocity), velocity, then)


def along_world(axes: Sequence[Vec3], values: Sequence[Scalar]) -> Vec3:
    """Vector in world axes from its components along given unit vectors."""
    if not axes:
        return Vec3(*values)
    first, second, third = (
        axis * value for axis, value in zip(axes, values, strict=True)
    )
    return first + second + third


@immutable
class Detection:
    """Constants for the detection of an external force at the tip."""

    threshold: Annotated[
        Scalar,
        nonnegative(
            "N",
            "tip force above which an external force is detected",
            effect="higher values ignore noise and wind, and miss weak forces",
        ),
    ] = 0.3
    patience: Annotated[
        Scalar, Unit("s", "time below the threshold until a force has ended")
    ] = 0.3
    settle: Annotated[
        Scalar,
        Unit(
            "s",
            "time at the start of a flight without detection",
            effect="longer times let the bias of the observed force settle",
        ),
    ] = 2.0
    settling: Annotated[
        Scalar, Unit("rad/s", "bandwidth of the bias filter during the time settle")
    ] = 3.0
    bias_rate: Annotated[
        Scalar,
        Unit(
            "rad/s",
            "bandwidth of the bias filter while no force is detected",
            effect="higher values follow a drifting bias faster and absorb slow forces",
        ),
    ] = 0.5
    wind_rate: Annotated[
        Scalar,
        Unit(
            "rad/s", "bandwidth of the filter of the base force that is not the tip's"
        ),
    ] = 1.0


@immutable
class AdmittanceMemory:
    """Internal state of the admittance control: virtual body, external-force detection
    and disturbance bias.
    """

    age: Annotated[Scalar, Unit("s", "time since the start of the flight")] = 0.0
    bias: Disturbance
    body: VirtualBody = VirtualBody()
    detected: Annotated[Scalar, Unit("", "1 while an external force is detected")] = 0.0
    quiet: Annotated[
        Scalar, Unit("s", "time since the force was above its threshold")
    ] = 0.0
    force: Annotated[Vec3, Unit("N", "estimated force at the tip, world axes")] = (
        ZERO3_DATA
    )
    sensed: Annotated[
        Vec3 | tuple[()],
        Unit("N", "filtered reading of the force sensor at the tip, axes of the tip"),
    ] = ()
    sensor_bias: Annotated[
        Vec3 | tuple[()],
        Unit("N", "estimated bias of the force sensor, axes of the tip"),
    ] = ()


@immutable
class AdmittanceGains(OptionalPart):
    """Constants of the admittance control."""

    tip: Compliance
    detection: Detection = Detection()
    errors: ForceErrors = ForceErrors()
    rest: Annotated[
        Scalar,
        Unit(
            "s", "time after a force before loads, friction and lag are estimated again"
        ),
    ] = 0.5
    sensing: SensorBandwidth | None = None

    def __post_init__(self) -> None:
        require_moderate("controller.parts.admittance.tip", "inertia", self.tip)

    def start(self, joints: int) -> AdmittanceMemory:
        """Initial state of the admittance control: virtual body at rest on the
        reference, zero bias.
        """
        zero = () if self.sensing is None else ZERO3_DATA
        return AdmittanceMemory(
            bias=no_disturbance(joints), sensed=zero, sensor_bias=zero
        )

    def affect(
        self, memory: AdmittanceMemory, step: Step, effect: Effect
    ) -> tuple[AdmittanceMemory, Effect]:
        """Shift the reference by the admittance offset; stop adaptation during and
        shortly after an external force.
        """
        memory, signals = shift_reference(
            self,
            memory,
            step.par.model.vehicle,
            step.seen.observed,
            effect.signals,
            step.measurement.tip_force,
            step.dt,
        )
        effect = replace(effect, signals=signals, external=memory.detected)
        return memory, effect.isolating(self.force_cleared(memory))

    def force_cleared(self, memory: AdmittanceMemory) -> Scalar:
        """Flag of 1 if no external force at the tip has been detected for a while, else
        0.
        """
        return where(memory.quiet > self.rest, 1.0, 0.0)


def shift_reference(
    gains: AdmittanceGains,
    memory: AdmittanceMemory,
    vehicle: Vehicle,
    observed: Observed,
    signals: Sequence[Taylor],
    reading: Sequence[Scalar],
    dt: Scalar,
) -> tuple[AdmittanceMemory, list[Taylor]]:
    """Admittance step: next admittance state, and reference signals with x, y and z
    shifted by the virtual body.
    """
    at = levers(vehicle, observed.quaternion.rotation(), observed.joints)
    d = disturbance(observed)
    estimate = tip_force(gains.errors, at, d - memory.bias)
    sensed, value = memory.sensed, estimate
    if sensed and memory.sensor_bias and reading and gains.sensing is not None:
        sensed = low_pass(sensed, Vec3(*reading), gains.sensing, dt)
        turned = at.R @ frame_pose(vehicle, vehicle.frame(), observed.joints).R
        value, sensed = turned.apply(sensed - memory.sensor_bias), as_data(sensed)
    memory = replace(memory, force=as_data(value), sensed=sensed)
    memory = detect(gains.detection, memory, d, estimate, dt)
    body, shift = move(gains.tip, memory.body, memory.force * memory.detected, dt)
    moved = (
        signal + Taylor.of_derivatives((*by, 0, 0))
        for signal, *by in zip(signals[:3], *shift, strict=True)
    )
    return replace(memory, body=body), [*moved, *signals[3:]]


def detect(
    gains: Detection,
    memory: AdmittanceMemory,
    observed: Disturbance,
    force: Vec3,
    dt: Scalar,
) -> AdmittanceMemory:
    """Admittance state with updated external-force detection and disturbance bias."""
    settled = memory.age >= gains.settle
    loud = logical_and(
        settled, memory.force.dot(memory.force) > gains.threshold * gains.threshold
    )
    quiet = where(loud, 0.0, memory.quiet + dt)
    counts = logical_or(
        loud, logical_and(memory.detected > 0.5, quiet < gains.patience)
    )
    # the bias stands still meanwhile: a long push would be learned as one
    detected = where(counts, 1.0, 0.0)
    calm = detected < 0.5
    share = where(
        calm, low_pass_share(where(settled, gains.bias_rate, gains.settling), dt), 0.0
    )
    wind = where(calm, share, low_pass_share(gains.wind_rate, dt))
    unexplained = replace(observed, force=observed.force - force * detected)
    offset = memory.sensor_bias
    if offset and memory.sensed:
        offset = as_data(offset + (memory.sensed - offset) * share)
    return replace(
        memory,
        age=where(settled, memory.age, memory.age + dt),
        bias=memory.bias.blend_towards(unexplained, share, wind),
        detected=detected,
        quiet=quiet,
        sensor_bias=offset,
    )


def admittance_gains(
    table: LawOptions, gains: LawOptions, leads: bool, lead: float
) -> AdmittanceGains:
    """Admittance constants from the option ``admittance``: mass, damping, stiffness,
    normal and threshold.

    ``gains`` are the law's other options; ``leads``: whether it leads a tip; ``lead``:
    lag of its observer, s.

    Raises:
        ControllerError: a wrong table, a law without a tip to lead, or one that presses
            or learns a load.
    """
    at = "controller.admittance"
    if not leads:
        raise ControllerError(
            f"{at} = {shown(table)}: must be left out but in mode 'tip' with joints"
        )
    for name in ("interaction", "load"):
        if gains[name] not in (0.0, (0.0, 0.0)):
            raise ControllerError(
                f"{at} = {shown(table)}: must be left out beside {name}"
            )
    with errors_as(ControllerError):
        fields = Fields(table, at)
        axes = (
            _axes(fields.vector("normal"), f"{at}.normal")
            if "normal" in fields.table
            else ()
        )
        # a sensor lags by its filter alone, an observed force by the observer and the
        # delay
        sensing = SENSING if gains["force_sensor"] else None
        tip = _compliance(fields, 1.0 / sensing if sensing else lead, axes)
        detection = Detection(
            threshold=fields.number("threshold", Detection().threshold, low=0.0)
        )
        fields.done()
    return AdmittanceGains(tip=tip, detection=detection, sensing=sensing)


def _compliance(fields: Fields, lead: float, axes: tuple[Vec3, ...]) -> Compliance:
    """Virtual mass, damping and stiffness from an option table; axes of mass 0 become
    int zeros.
    """
    rows: list[Scalars] = []
    for each in ("mass", "damping", "stiffness"):
        rows.append(fields.vector(each))
        # read once more, since a vector has three numbers and no lower bound
        fields.numbers(each, low=0.0)
    if not any(rows[0]):
        raise ValueError(
            f"{fields.at('mass')} = {shown(list(rows[0]))}: must be above 0 along an"
            " axis at least"
        )
    mass = tuple(each or 0 for each in rows[0])
    body = Compliance(
        inertia=mass, damping=rows[1], stiffness=rows[2], lead=lead, axes=axes
    )
    require_moderate(fields.where, "mass", body)
    damping, stiffness = (
        tuple(v if m else 0 for v, m in zip(row, mass, strict=True)) for row in rows[1:]
    )
    return replace(body, damping=damping, stiffness=stiffness)


def require_moderate(at: str, name: str, body: Compliance) -> None:
    """Reject a virtual mass, damping or stiffness that is too extreme for a control
    loop.

    ``name`` is that of the masses in messages; an axis whose mass is a structural 0 is
    held.

    Raises:
        ControllerError: one line with field, value and what is allowed.
    """
    bounds = {
        "damping": (FASTEST, f"{FASTEST:g} 1/s"),
        "stiffness": (FASTEST**2, f"({FASTEST:g} rad/s)^2"),
    }
    for i, (mass, *row) in enumerate(
        zip(body.inertia, body.damping, body.stiffness, strict=True)
    ):
        if not concrete(mass, *row):
            continue
        if type(mass) is not int and not LIGHTEST <= mass <= HEAVIEST:
            allowed = (
                f"must be {'0 or ' if mass else ''}from {LIGHTEST:g} to {HEAVIEST:g}"
            )
            raise ControllerError(f"{at}.{name}[{i}] = {shown(mass)}: {allowed}")
        for (field, (limit, unit)), value in zip(bounds.items(), row, strict=True):
            if value > limit * mass:
                allowed = f"must be at most {unit} times the {name}"
                if not mass:
                    allowed = f"must be 0 along an axis of {name} 0, which is held"
                raise ControllerError(f"{at}.{field}[{i}] = {shown(value)}: {allowed}")


def _axes(normal: tuple[float, float, float], at: str) -> tuple[Vec3, ...]:
    """Orthonormal axes of a surface: its unit normal, a horizontal tangent, and their
    cross product.
    """
    length = math.sqrt(sum(c * c for c in normal))
    if not 1e-6 < length < math.inf:
        raise ValueError(f"{at} = {shown(list(normal))}: must have a direction")
    n = Vec3(*(c / length for c in normal))
    level = math.hypot(n.x, n.y)
    # a normal that is vertical has any horizontal tangent
    first = (
        Vec3(-n.y / level, n.x / level, 0.0) if level > 1e-6 else Vec3(1.0, 0.0, 0.0)
    )
    second = n.cross(first)
    return n, first, Vec3(*(c / math.sqrt(second.dot(second)) for c in second))
