"""Records of the learned load: constants and memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from skyarm.algebra import Mat3, Vec3, ldl_solve
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.tip_force import ForceErrors
from skyarm.dynamics import mass_matrix
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.files import shown
from skyarm.records.units import Unit
from skyarm.scalars import Scalar
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class InertiaGains:
    """Constants of the learned inertia of a load, chosen on other bars and seeds than docs/carrying.md reports.

    Attributes:
        spread: of what is believed of each moment beforehand, mass times its square.
        stout: of each axis of the tip, the inertia of the unloaded vehicle that its joints and its base feel there: the
            less it is, the sooner is a moment that is believed too large too stiff.
        noise, colour: of a joint's observed torque, and for how long it stays alike: so many seconds are one reading.
    """

    stout: Annotated[tuple[Scalar, ...], Unit("kg m^2", "of the vehicle about each axis of the tip", low=0.0)]
    spread: Annotated[Scalar, Unit("m", "radius of gyration that is not surprising", low=0.0, strict=True)] = 0.1
    furthest: Annotated[Scalar, Unit("m", "root of the largest second moment of mass per kg", low=0.0)] = 0.15
    noise: Annotated[Scalar, Unit("N m", "of a joint's observed torque", low=0.0, strict=True)] = 0.005
    colour: Annotated[Scalar, Unit("s", "for which that noise stays alike", low=0.0, strict=True)] = 0.1
    forgetting: Annotated[Scalar, Unit("1/s", "of what was observed, while the hand is turned", low=0.0)] = 0.5
    turned: Annotated[Scalar, Unit("rad/s^2", "angular acceleration below which little is told or forgotten")] = 2.0
    mean_rate: Annotated[Scalar, Unit("rad/s", "filter of means, which tell nothing", low=0.0)] = 1.0
    pace: Annotated[Scalar, Unit("rad/s", "with which the model follows what is found", low=0.0)] = 5.0


@dataclass(frozen=True, kw_only=True, slots=True)
class JointMeans:
    """Slow means of a joint's observed effort, and of the torques of 1 kg m^2 about each axis of the tip in it."""

    effort: Annotated[Scalar, Unit("N m or N", "mean")]
    unit: Annotated[tuple[Scalar, ...], Unit("1/s^2", "means, of 1 kg m^2 about each axis of the tip")]


@dataclass(frozen=True, kw_only=True, slots=True)
class InertiaMemory:
    """Memory of the learned inertia.

    Attributes:
        once, twice: torques of 1 kg m^2 about each axis of the tip, after one and two stages of the observer's lag.
        A, b: normal equations, lower triangle row by row. moments: about the centre of mass, axes of the tip.
    """

    once: Annotated[tuple[Vec3, ...], Unit("1/s^2", "world axes")]
    twice: Annotated[tuple[Vec3, ...], Unit("1/s^2", "world axes")]
    means: tuple[JointMeans, ...]
    A: Annotated[tuple[Scalar, ...], Unit("1/(kg m^2)^2", "information")]
    b: Annotated[tuple[Scalar, ...], Unit("1/(kg m^2)", "information times moments")]
    moments: Annotated[Vec3, Unit("kg m^2", "about the centre of mass, axes of the tip")]


@dataclass(frozen=True, kw_only=True, slots=True)
class LoadGains:
    """Constants of the learned load; ``limit`` is the law's option, the others are in no unit of the vehicle's size.

    Attributes:
        twist: N m, of a torque at the tip that counts as much against it as 1 N of the base's force does: a load's
            weight times how far its centre of mass lies from the tip.
        pace, place_pace: rates over the bandwidth of the slower of the observers of the base's force and of the joints.
            The mass and the observer find the same weight at once, and from 2 on they would swing.
        size: small, because a load that has less inertia than is believed of it makes the joints that turn it too
            stiff, and one that has ten times as much does not.
    """

    limit: Annotated[Scalar, Unit("kg", "largest mass that is learned")]
    errors: ForceErrors = ForceErrors()
    twist: Annotated[Scalar, Unit("N m", "at the tip, as much as 1 N of the base's force")] = 0.03
    pace: Annotated[Scalar, Unit("", "rate of the mass over the observer's bandwidth")] = 1.5
    noise_share: Annotated[Scalar, Unit("", "share of the mass, an error below which counts as noise")] = 0.05
    settled_rate: Annotated[Scalar, Unit("", "0 to 1, of the rate that is left of it there")] = 0.1
    place_pace: Annotated[Scalar, Unit("", "rate of the centre of mass over the observer's bandwidth")] = 0.1
    light: Annotated[Scalar, Unit("", "share of the limit, a mass below which tells little of its centre")] = 0.2
    furthest: Annotated[Scalar, Unit("m", "of the centre of mass from the tip, along each of its axes")] = 0.05
    size: Annotated[Scalar, Unit("m", "radius of gyration about the centre of mass, of any axis")] = 0.01
    bias_rate: Annotated[Scalar, Unit("rad/s", "filter of what is observed without a load")] = 0.5
    inertia: InertiaGains | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class LoadMemory:
    """Memory of the learned load.

    Attributes:
        bias: observed without a load.
    """

    mass: Annotated[Scalar, Unit("kg", "learned")]
    place: Annotated[Vec3, Unit("m", "centre of mass, axes of the tip")]
    bias: Disturbance
    inertia: InertiaMemory | tuple[()] = ()


def load_gains(limit: float, vehicle: Vehicle, mode: str, inertia: bool) -> LoadGains | None:
    """Constants of the learned load for its largest mass, kg; None where it is left out.

    Raises:
        ControllerError: a vehicle without a tip that joints move; ``inertia`` without a mass or a tip that is kept.
    """
    if inertia and (limit == 0.0 or mode != "tip"):
        raise ControllerError("controller.load_inertia = true: must be false without load, and but in mode 'tip'")
    if limit == 0.0:
        return None
    if not vehicle.end_effector or not vehicle.n:
        raise ControllerError(
            f"controller.load = {shown(limit)}: must be 0: {vehicle.name!r} has no joints that move an end_effector"
        )
    return LoadGains(limit=limit, inertia=InertiaGains(stout=stout(vehicle)) if inertia else None)


def stout(vehicle: Vehicle) -> tuple[float, ...]:
    """1 / (J M^-1 J^T)_kk about each axis of the tip, kg m^2, joints at zero, J the tip's Jacobian with the base."""
    joints, tip = (0.0,) * vehicle.n, vehicle.frame()
    M, R = mass_matrix(vehicle, Mat3.identity(), joints), frame_pose(vehicle, tip, joints).R
    columns = [Vec3(0, 0, 0)] * 3 + [Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)]
    columns += [column.angular for column in jacobian_columns(vehicle, tip, joints)]
    rows = [[float(R.column(k).dot(column)) for column in columns] for k in range(3)]
    solved = [ldl_solve([list(map(float, line)) for line in M], list(row)) for row in rows]
    return tuple(1.0 / sum(a * b for a, b in zip(x, row, strict=True)) for x, row in zip(solved, rows, strict=True))


def first_load(joints: int, inertia: bool) -> LoadMemory:
    """Nothing is held and nothing is known."""
    zero = Vec3(0.0, 0.0, 0.0)
    bias = Disturbance(force=zero, torque=zero, efforts=(0.0,) * joints)
    return LoadMemory(mass=0.0, place=zero, bias=bias, inertia=first_inertia(joints) if inertia else ())


def first_inertia(joints: int) -> InertiaMemory:
    """Nothing is known of the moments."""
    zero, none = Vec3(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    means = (JointMeans(effort=0.0, unit=none),) * joints
    return InertiaMemory(once=(zero,) * 3, twice=(zero,) * 3, means=means, A=(0.0,) * 6, b=none, moments=zero)
