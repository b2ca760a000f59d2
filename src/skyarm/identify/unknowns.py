"""Search variables of an identification: parameters of a vehicle and its surroundings,
with prior knowledge.

What must be positive is searched by its logarithm. The base's moments of inertia are
sums of two of its three second moments of mass, and a thrust curve is a sum of rises,
so that no candidate is a body that cannot be (Traversaro et al. 2016). The total mass
is given: a flight shows forces per mass only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from itertools import pairwise

from skyarm.algebra import Mat3, Scalar, Sym3
from skyarm.dynamics import mass_matrix
from skyarm.dynamics.actuators.rotor import push
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.flight_data.quantities import GRAVITY
from skyarm.records.files import must_be_one_of, number
from skyarm.records.immutable import immutable
from skyarm.vehicle import Body, Link, MountedDrive, Rotor, Vehicle

KNOTS = (0.25, 0.5, 0.75, 1.0)
"""Fractions of the full signal at which the thrust of a rotor with a curve of its own
is identified."""

USUAL_DELAY, DELAY_SPREAD = 0.005, 0.01
"""Expected dead time (s) and its prior standard deviation."""

STICKING = 0.01
"""Largest static error (rad or m) assumed for a servo without recorded dry friction."""

UNKNOWN = 20.0
"""Assumed natural frequency (rad/s) of an unknown servo, critically damped: it settles
in 0.3 s."""

DRAG_HEIGHT = "rotors.drag_height"
"""Height of the hub drag's point above the hubs of the start vehicle: blades flap,
which tilts thrust and adds a moment (Mahony, Kumar, Corke 2012), so that a force that
acts above the hubs stands for both.
"""

DRY = 0.1
"""Largest friction assumed for a joint without recorded friction, as a fraction of the
link's weight torque at its reach.

Dry, or by damping at the rate of the link's swing, or at 1 m/s.
"""

ACCELEROMETER = "accelerometer_delay"
"""Parameter: delay of the accelerometer, known to half a sample at best because sensors
average without stating it."""

THRUST, BATTERY = "thrust.", 0.2
"""Prefix of the parameter of a flight's thrust relative to the first flight, and the
standard deviation of its logarithm by battery sag: by a tenth of the voltage."""

WIND = 0.3
"""Largest rotor drag over speed and mass (1/s) assumed for a start vehicle without hub
drag: a tenth of the weight at 3 m/s."""


@immutable
class Unknown:
    """Parameter to identify, with its prior.

    Attributes:
        name: name in a vehicle file, or in the vehicle's surroundings.
        unit: SI.
        start: value before the data.
        spread: standard deviation of what is known before; of its logarithm if
            ``positive``.
        positive: the logarithm is searched.
        in_vehicle: it belongs to the vehicle, else to what surrounds it.
        least: bound that physics sets to a number whose logarithm is not searched:
            noise may put it beyond.
    """

    name: str
    unit: str
    start: float
    spread: float
    positive: bool = False
    in_vehicle: bool = True
    least: float = -math.inf

    @property
    def begin(self) -> float:
        """Start value of the search variable: the logarithm of the start value for a
        positive parameter.
        """
        return math.log(self.start) if self.positive else self.start

    def value(self, searched: float) -> float:
        """Parameter value from its search variable, which is the logarithm for a
        positive parameter.
        """
        return math.exp(searched) if self.positive else searched


@immutable
class Reported:
    """Reported parameter: one searched parameter, or the sum of several positive ones.

    Attributes:
        name, unit: name and unit in reports.
        parts: names of the unknowns that it is the sum of.
        least: bound that physics sets.
    """

    name: str
    unit: str
    parts: tuple[str, ...]
    least: float = -math.inf


def unknowns_of(
    vehicle: Vehicle,
    *,
    curve: bool,
    velocity: bool,
    voltage: bool,
    driven: Sequence[bool],
    servoed: Sequence[bool] = (),
    drag_height: bool = False,
    others: Sequence[str] = (),
) -> list[Unknown]:
    """Parameters to identify of a vehicle and of its surroundings, such as delays.

    Args:
        vehicle: start.
        curve: the thrust against the signal is a curve of its own, not that of the
            start times a factor.
        velocity: the flights hold it.
        voltage: the flights hold it.
        driven: whether each joint is moved by known torques.
        servoed: whether a position servo moves each joint to known setpoints.
        drag_height: the rotors' hub drag acts at a height of its own, if the flights
            hold the velocity.
        others: names of the flights after the first one; without the voltage each has a
            thrust of its own.

    Raises:
        ValueError: one line: a vehicle without rotors, or a curve of rotors without a
            highest speed.
    """
    if not vehicle.rotors:
        raise ValueError(f"vehicle '{vehicle.name}': rotors: must be one or more")
    arm = max(math.hypot(*map(float, each.position)) for each in vehicle.rotors)
    unknowns = _of_rotors(vehicle, curve)
    if velocity:
        unknowns += _of_drag(vehicle, arm)
        if drag_height:
            unknowns.append(_any(DRAG_HEIGHT, "m", 0.0, arm))
    moments = second_moments(vehicle.base)
    # how far a number may be off its start is chosen, here and below
    unknowns += [
        _above(f"base.second_moment.{k}", "kg m^2", m, 0.5)
        for k, m in zip("xyz", moments, strict=True)
    ]
    for axis in ("xy", "xz", "yz"):
        unknowns.append(
            _any(
                f"base.inertia.{axis}",
                "kg m^2",
                getattr(vehicle.base.inertia, axis),
                0.03 * sum(moments),
            )
        )
    # without an arm only the height of the drag above the centre of mass shows
    heights = "xy" if drag_height and velocity and not vehicle.links else "xyz"
    unknowns += [
        _any(f"base.com.{axis}", "m", getattr(vehicle.base.com, axis), 0.1 * arm)
        for axis in heights
    ]
    for link, moves in zip(vehicle.links, driven, strict=True):
        unknowns += _of_link(link, moves)
    for i, moves in enumerate(servoed):
        unknowns += _of_servo(vehicle, i) if moves else []
    # a positive number that starts at 0 has no logarithm to search
    unknowns = [each for each in unknowns if not each.positive or each.start > 0.0]
    around = _of_surroundings(arm, GRAVITY * float(vehicle.mass), voltage, any(driven))
    # servos that average a setpoint over its period, and those that obey at once,
    # differ by 0.6 ms of dead time; the share is searched so that intervals cover both
    around += [_any("setpoint_hold", "", 0.5, 0.5)] if any(servoed) else []
    around += (
        []
        if voltage
        else [_above(f"{THRUST}{name}", "times", 1.0, BATTERY) for name in others]
    )
    return [*unknowns, *(replace(each, in_vehicle=False) for each in around)]


def _above(name: str, unit: str, start: Scalar, spread: float) -> Unknown:
    """Unknown positive parameter, with the standard deviation of its logarithm."""
    return Unknown(
        name=name, unit=unit, start=float(start), spread=spread, positive=True
    )


def _any(
    name: str, unit: str, start: Scalar, spread: float, least: float = -math.inf
) -> Unknown:
    """Unknown parameter of any sign, searched on a linear scale."""
    return Unknown(name=name, unit=unit, start=float(start), spread=spread, least=least)


def _loss(name: str, unit: str, start: Scalar, spread: float) -> Unknown:
    """Unknown friction: positive if the start value is not zero, otherwise of any sign
    with a given deviation.
    """
    return (
        _above(name, unit, start, 0.7)
        if float(start)
        else _any(name, unit, start, spread, 0.0)
    )


def _of_rotors(vehicle: Vehicle, curve: bool) -> list[Unknown]:
    rotor = vehicle.rotors[0]
    unknowns = [
        _above(
            "rotors.thrust_coefficient", "N s^2/rad^2", rotor.thrust_coefficient, 0.5
        )
    ]
    if curve:
        unknowns = [
            _above(name, "N", rise, 0.5)
            for name, rise in zip(rises_of_thrust(), _thrust_rises(rotor), strict=True)
        ]
    # half of the rotor's own or a thousandth of the base's, whichever is larger; chosen
    spin = max(1e-3 * sum(second_moments(vehicle.base)), 0.5 * float(rotor.inertia))
    return [
        *unknowns,
        _above("rotors.moment_coefficient", "m", rotor.moment_coefficient, 0.5),
        _above("rotors.time_constant_up", "s", rotor.time_constant_up, 0.7),
        _above("rotors.time_constant_down", "s", rotor.time_constant_down, 0.7),
        _any("rotors.inertia", "kg m^2", rotor.inertia, spin, 0.0),
    ]


def _of_drag(vehicle: Vehicle, arm: float) -> list[Unknown]:
    rotor = vehicle.rotors[0]
    count = len(vehicle.rotors)
    mass = float(vehicle.mass)
    at_hover = math.sqrt(GRAVITY * mass / (count * float(rotor.thrust_coefficient)))
    # a start without hub drag must leave room for some
    hub = max(WIND * mass / (count * at_hover), float(rotor.drag_coefficient))
    unknowns = [
        _any(
            "rotors.drag_coefficient", "N s^2/(rad m)", rotor.drag_coefficient, hub, 0.0
        )
    ]
    for axis in "xyz":
        area = float(getattr(vehicle.drag.area, axis))
        unknowns.append(
            _any(f"drag.area.{axis}", "m^2", area, max(area, 0.3 * arm**2), 0.0)
        )
    return unknowns


def _of_link(link: Link, moves: bool) -> list[Unknown]:
    name, body, joint = f"links.{link.name}", link.body, link.joint
    # a centre of mass on the joint has no distance that could be a scale
    reach = max(math.hypot(*map(float, body.com)), 0.01)
    unknowns = [_above(f"{name}.mass", "kg", body.mass, 0.3)]
    unknowns += [
        _any(f"{name}.com.{axis}", "m", getattr(body.com, axis), 0.2 * reach)
        for axis in "xyz"
    ]
    # no multiple of an inertia that is 0 is another one
    if any(float(getattr(body.inertia, each.name)) for each in fields(Sym3)):
        unknowns.append(_above(f"{name}.inertia", "times", 1.0, 0.4))
    if moves:
        angle, unit = joint.units
        weight = GRAVITY * float(body.mass) * (reach if joint.turns else 1.0)
        dry = DRY * weight
        # rate at which a pendulum of this length swings
        swing = math.sqrt(9.81 / reach) if joint.turns else 1.0
        unknowns += [
            _loss(
                f"{name}.joint.damping", f"{unit} s/{angle}", joint.damping, dry / swing
            ),
            _loss(f"{name}.joint.coulomb", unit, joint.coulomb, dry),
            *_of_moved_joint(link),
        ]
    return unknowns


def _of_moved_joint(link: Link) -> list[Unknown]:
    """Unknown parameters of any moving joint: armature, and rate scale of dry
    friction.
    """
    name, joint = f"links.{link.name}.joint", link.joint
    return [
        _above(
            f"{name}.coulomb_rate",
            f"{joint.units[0]}/s",
            joint.coulomb_rate if joint.coulomb else 0,
            1.5,
        ),
        _above(
            f"{name}.armature", "kg m^2" if joint.turns else "kg", joint.armature, 0.7
        ),
    ]


def _of_servo(vehicle: Vehicle, joint: int) -> list[Unknown]:
    """Unknown parameters of a position servo, whose damping includes that of the
    joint.
    """
    servo = servo_of(vehicle, joint)
    link = vehicle.links[joint]
    assert servo is not None
    name, (angle, effort) = f"drives.{link.joint.name}", link.joint.units
    # sticking within a hundredth of a radian is much for a servo that has none on
    # record
    usual = max(float(link.joint.coulomb), STICKING * float(servo.stiffness))
    unknowns = [
        _above(f"{name}.stiffness", f"{effort}/{angle}", servo.stiffness, 0.7),
        _above(f"{name}.damping", f"{effort} s/{angle}", servo.damping, 0.7),
        _above(f"{name}.integral", f"{effort}/({angle} s)", servo.integral, 0.7),
        _any(f"{name}.latency", "s", servo.latency, DELAY_SPREAD, 0.0),
        _any(
            f"links.{link.name}.joint.coulomb", effort, link.joint.coulomb, usual, 0.0
        ),
        *_of_moved_joint(link),
    ]
    if math.isfinite(float(servo.speed_limit)):
        unknowns.append(
            _above(f"{name}.speed_limit", f"{angle}/s", servo.speed_limit, 0.7)
        )
    return unknowns


def _of_surroundings(
    arm: float, weight: float, voltage: bool, driven: bool
) -> list[Unknown]:
    # spreads about these starts are chosen: along z offset and torque are smaller
    return [
        _any("delay", "s", USUAL_DELAY, DELAY_SPREAD),
        *([_any("joint_delay", "s", USUAL_DELAY, DELAY_SPREAD)] if driven else []),
        _any(ACCELEROMETER, "s", 0.0, USUAL_DELAY),
        *(_any(f"place.{axis}", "m", 0.0, 0.2 * arm) for axis in "xyz"),
        *(
            _any(f"offset.{axis}", "m/s^2", 0.0, 0.03 if axis == "z" else 0.3)
            for axis in "xyz"
        ),
        *(
            _any(
                f"torque.{axis}",
                "N m",
                0.0,
                (0.01 if axis == "z" else 0.1) * weight * arm,
            )
            for axis in "xyz"
        ),
        _any("sag", "", 1.0, 1.0) if voltage else _any("drift", "1/s", 0.0, 0.005),
    ]


def require_searched(known: Mapping[str, float], every: Sequence[Unknown]) -> None:
    """Raise an error if a known parameter is not one that the search would find, or has
    an inadmissible value.

    Args:
        known: known numbers by name.
        every: unknowns of the search without them.

    Raises:
        ValueError: one line: the number, and what is allowed.
    """
    positive = {each.name: each.positive for each in every}
    for name, value in known.items():
        if name not in positive:
            stated = {
                f"base.second_moment.{axis}": f"base.inertia.{axis}{axis}"
                for axis in "xyz"
            }
            allowed = [
                "mass",
                "voltage",
                *(stated.get(each, each) for each in positive),
            ]
            raise ValueError(f"known.{name}: {must_be_one_of(allowed, name)}")
        number(
            value,
            f"known.{name}",
            low=0.0 if positive[name] else -math.inf,
            strict=positive[name],
        )


def reported_of(unknowns: Sequence[Unknown]) -> list[Reported]:
    """Reported parameters: the searched ones, or sums of them where a vehicle file
    holds the sums.
    """
    rises, reported = rises_of_thrust(), list[Reported]()
    for each in unknowns:
        if each.name in rises:
            k = rises.index(each.name)
            reported.append(
                Reported(
                    name=f"rotors.thrust_at_{100 * KNOTS[k]:g}_percent",
                    unit="N",
                    parts=rises[: k + 1],
                )
            )
        elif each.name.startswith("base.second_moment."):
            axis = each.name[-1]
            parts = tuple(
                f"base.second_moment.{other}" for other in "xyz" if other != axis
            )
            reported.append(
                Reported(name=f"base.inertia.{axis}{axis}", unit="kg m^2", parts=parts)
            )
        else:
            reported.append(
                Reported(
                    name=each.name, unit=each.unit, parts=(each.name,), least=each.least
                )
            )
    return reported


def second_moments(base: Body) -> tuple[float, float, float]:
    """Second moments of mass along x, y, z, kg m^2, at least slightly above 0; sums of
    two are moments of inertia.
    """
    xx, yy, zz = (float(getattr(base.inertia, axis)) for axis in ("xx", "yy", "zz"))
    # a flat body has a moment of 0 along its normal, which has no logarithm; a
    # hundredth of the sum is chosen, and 1e-12 is for a body without inertia
    least = max(0.01 * (xx + yy + zz), 1e-12)
    x, y, z = second_moments_of(xx, yy, zz)
    return max(x, least), max(y, least), max(z, least)


def second_moments_of(xx: float, yy: float, zz: float) -> tuple[float, float, float]:
    """Second moments of mass along x, y, z from the moments of inertia, kg m^2; below 0
    if no body has these.
    """
    half = 0.5 * (xx + yy + zz)
    return half - xx, half - yy, half - zz


def rises_of_thrust() -> tuple[str, ...]:
    """Parameter names of the thrust increments between the knots of a thrust curve."""
    return tuple(f"rotors.rise_to_{100 * share:g}_percent" for share in KNOTS)


def _thrust_rises(rotor: Rotor) -> list[float]:
    """Thrust increments of a rotor between the knots of its thrust curve, N."""
    if not math.isfinite(float(rotor.max_speed)):
        raise ValueError(
            "rotors.max_speed = inf: must be finite, the speed of the full signal, for"
            " a thrust curve"
        )
    thrusts = [
        float(rotor.thrust_coefficient * push(rotor, share * float(rotor.max_speed)))
        for share in KNOTS
    ]
    return [thrusts[0], *(b - a for a, b in pairwise(thrusts))]


def without_tilts(vehicle: Vehicle) -> Vehicle:
    """Vehicle without rotor tilt, for replays of flights whose logs hold no tilt
    angles.
    """
    return replace(
        vehicle, rotors=tuple(replace(each, tilt=None) for each in vehicle.rotors)
    )


def servo_of(vehicle: Vehicle, joint: int) -> PositionServo | None:
    """Position servo of a joint; None where the vehicle has another drive or none."""
    name = vehicle.links[joint].joint.name
    drives = [each.drive for each in vehicle.drives if each.name == name]
    return drives[0] if drives and isinstance(drives[0], PositionServo) else None


def with_servos(vehicle: Vehicle, servoed: Sequence[bool]) -> Vehicle:
    """Vehicle with a position servo of moderate gains on each joint that takes
    setpoints and has no drive.

    Args:
        vehicle: start.
        servoed: whether the setpoints of each joint are positions.

    Raises:
        ValueError: one line: such a joint has a drive that takes no position.
    """
    made = list(vehicle.drives)
    for i, (link, moves) in enumerate(zip(vehicle.links, servoed, strict=True)):
        if not moves or servo_of(vehicle, i) is not None:
            continue
        name = link.joint.name
        if name in [each.name for each in vehicle.drives]:
            raise ValueError(
                f"drives.{name}: must be a position_servo, or none: joint_commands are"
                " its setpoints"
            )
        # the joints' rows stand behind the six of the base
        inertia = float(
            mass_matrix(vehicle, Mat3.identity(), [0.0] * vehicle.n)[6 + i][6 + i]
        )
        # critically damped at UNKNOWN rad/s
        servo = PositionServo(
            inertia=inertia,
            stiffness=inertia * UNKNOWN**2,
            damping=2.0 * inertia * UNKNOWN,
        )
        made.append(MountedDrive(name=name, drive=servo))
    return (
        replace(vehicle, drives=tuple(made))
        if len(made) > len(vehicle.drives)
        else vehicle
    )
