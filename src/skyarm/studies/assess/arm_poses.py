"""Static hover in arm poses sampled over the joint space, and a search for the worst
pose.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from skyarm import dynamics
from skyarm.algebra import E_Z, ZERO3, Motion
from skyarm.dynamics.actuators import make_mixer
from skyarm.dynamics.workspace import joint_range
from skyarm.records.arrays import Array, Mask, doubles, stack_values
from skyarm.records.immutable import immutable, positional
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_records import undriven_joints

WRENCH = 4
"""Number of rows of a wrench that the mixer reads: torque x, y, z (N m, about the base
origin) and force along z (N)."""


def hover_efforts(vehicle: Vehicle, gravity: float, joints: Array) -> Array:
    """Generalized forces (4 + n, poses) of a static level hover: base torque and
    thrust, then joint efforts.

    Args:
        vehicle: the rigid bodies.
        gravity: m/s^2.
        joints: (lanes, n), rad or m.
    """
    still = vehicle.zeros
    level = Motion(ZERO3, E_Z * gravity)
    force, efforts = dynamics.inverse_dynamics(
        vehicle, tuple(joints.T), ZERO3, still, level, still
    )
    return stack_values(len(joints), (*force.torque, force.force.z, *efforts))


@positional
class Allocation:
    """Control allocation as arrays: wrench to squared rotor speeds, with their limits.

    Attributes:
        inverse: (rotors, 4) squared speed per wrench. highest: (rotors,) largest
            squared speed, (rad/s)^2.
        lowest: (rotors,) least one, which counts negative backwards.
    """

    inverse: Array
    highest: Array
    lowest: Array

    @classmethod
    def of(cls, vehicle: Vehicle) -> Allocation:
        """Create the allocation arrays of a vehicle whose numbers are plain;
        AllocationError if it has none.
        """
        mixer = make_mixer(vehicle)
        highest = doubles(mixer.highest)
        lowest = np.where([rotor.reversible for rotor in vehicle.rotors], -highest, 0.0)
        return cls(doubles(mixer.inverse), highest, lowest)

    def sizes(self, squared: Array) -> Array:
        """Squared speeds (rotors, poses) without the sign of rotors that may turn
        backwards.
        """
        return np.where(self.lowest[:, None] < 0.0, np.abs(squared), squared)

    def squared_speeds(self, efforts: Array) -> Array:
        """Squared rotor speeds (rotors, poses), not limited, for base torque and
        thrust: ``efforts[:4]``.
        """
        return self.inverse @ efforts[:WRENCH]

    def headroom(self, squared: Array, change: Array) -> Array:
        """Factor (rotors, poses) on a change of squared rotor speeds at which each
        rotor reaches a limit; inf if never.

        Args:
            squared: (rotors, poses) squared speeds, (rad/s)^2.
            change: (rotors, poses or 1) of them.
        """
        # a rotor that the change leaves alone divides by zero, and the masks drop it
        with np.errstate(divide="ignore", invalid="ignore"):
            up = (self.highest[:, None] - squared) / change
            down = (self.lowest[:, None] - squared) / change
        return np.where(change > 0.0, up, np.where(change < 0.0, down, np.inf))

    def room(self, squared: Array, direction: Array) -> Array:
        """Largest multiple (poses,) of a wrench (4,) that can be added to a hover
        within the rotor speed limits.

        Negative where a rotor is outside its limits already and the direction takes it
        further out.
        """
        far = self.headroom(squared, (self.inverse @ direction)[:, None])
        return doubles(np.min(far, axis=0))


GRAVITY = 9.81
"""Gravity (m/s^2) of a static pose; a pose under weight alone is the same under any."""

RESTS, SETTLED = 50, 1e-9
"""Largest number of passes that bring every joint to rest while the others stay, and
change (rad or m) that ends them."""

NOTHING = 1e-9
"""Effort (N m or N) below which the weight does not move a joint."""


def hanging_joints(vehicle: Vehicle) -> tuple[int, ...]:
    """Indices of undriven joints, which hang under gravity; joints that drive a coupled
    joint are not included.
    """
    # the energy of a leader with its followers is no single sine, as _lowest takes it
    leaders = {each.leader for each in vehicle.followers}
    free = undriven_joints(vehicle)
    return tuple(
        i
        for i, joint in enumerate(vehicle.joints)
        if joint.name in free and i not in leaders
    )


def rest_of_hanging(vehicle: Vehicle, joints: Array) -> Array:
    """Joint values (poses, n) with undriven joints at their lowest potential energy
    within limits, base level.

    The energy of weight is a single sine of each joint that turns while the others
    stay, so that two torques give its lowest point exactly; the joints take turns until
    none moves.
    """
    hanging = hanging_joints(vehicle)
    rest = np.array(joints, dtype=float)
    for _ in range(RESTS if hanging else 0):
        before = rest.copy()
        for i in hanging:
            rest[:, i] = _lowest(vehicle, rest, i)
        if np.max(np.abs(rest - before)) < SETTLED:
            break
    return rest


def _lowest(vehicle: Vehicle, joints: Array, i: int) -> Array:
    """Values (poses,) of joint i that minimize the potential energy with all other
    joints fixed.
    """
    joint = vehicle.links[i].joint
    low, high = joint.ends

    def torque(value: float) -> Array:
        moved = joints.copy()
        moved[:, i] = value
        return doubles(hover_efforts(vehicle, GRAVITY, moved)[WRENCH + i])

    at_zero = torque(0.0)
    if not joint.turns:  # slides down as far as it can
        end = np.where(at_zero > 0.0, low, high)
        return np.where(
            (np.abs(at_zero) > NOTHING) & np.isfinite(end), end, joints[:, i]
        )
    # the energy is b sin q - a cos q, its slope b cos q + a sin q
    at_quarter = torque(0.5 * math.pi)
    lowest = np.arctan2(-at_zero, at_quarter)
    # the lowest point recurs each turn: the first one within the limit
    if math.isfinite(low):
        lowest = lowest + math.tau * np.ceil((low - lowest) / math.tau)
    elif math.isfinite(high):
        lowest = lowest + math.tau * np.floor((high - lowest) / math.tau)
    # a single sine without its lowest point inside is least at one of the ends
    if math.isfinite(high - low):
        ends = [
            at_zero * math.sin(end) - at_quarter * math.cos(end) for end in (low, high)
        ]
        lowest = np.where(
            lowest <= high, lowest, np.where(ends[0] < ends[1], low, high)
        )
    # a joint that no weight turns is at rest anywhere, so it stays
    return np.where(np.hypot(at_zero, at_quarter) > NOTHING, lowest, joints[:, i])


Quantities = Callable[[Array], Array]
"""Function of joint values (lanes, n) that returns quantities (count, lanes)."""

POSES, MOST_POSES = 1024, 1_000_000
"""Number of sampled poses by default, and its upper bound."""

LANES = 4096
"""Number of poses evaluated at once, which bounds the memory for long arms."""

CORNERS = 6
"""Largest number of joints for which every corner of the joint ranges is evaluated."""

HUNG = 8
"""Sampled poses of more joints than these if all of them hang, at one rest but for
joints that no weight turns. To find the rest from each sample took minutes for ropes of
30 joints."""

ROUNDS, AROUND, CLOSER = 16, 24, 0.65
"""Local search around the worst pose: number of rounds, trials of each round, and
factor on their steps per round."""


@immutable(slots=False)
class ArmPoses:
    """Level hovers of a vehicle in sampled arm poses; undriven joints hang at rest.

    Attributes:
        vehicle: vehicle with its load. held: text of the load, as " with 0.3 kg"; empty
            without a load.
        low, high: (n,) rad or m: the limits; at most one turn, and 1 m to either side
            where there is none.
        joints: (count, n) the poses: zero (or the nearest within limits), corners, and
            Sobol points.
        gravity: m/s^2.
        searched: whether the search may leave the sampled poses.
        load: (4 + n, 1) generalized forces of a further load, which is the same in all
            poses.
    """

    vehicle: Vehicle
    low: Array
    high: Array
    joints: Array
    gravity: float
    held: str = ""
    searched: bool = True
    load: Array | float = 0.0

    @classmethod
    def only(
        cls, vehicle: Vehicle, joints: Array, gravity: float, held: str
    ) -> ArmPoses:
        """Hovers of a vehicle in given arm poses (count, n) only, without a search for
        worse poses.
        """
        none = np.zeros(vehicle.n)
        poses = cls(
            vehicle=vehicle,
            low=none,
            high=none,
            joints=joints,
            gravity=gravity,
            searched=False,
        )
        return poses.of(vehicle, held)

    def of(self, vehicle: Vehicle, held: str = "") -> ArmPoses:
        """Same arm poses in hover for another vehicle, with the equilibrium of its
        passive joints computed anew.
        """
        return replace(
            self,
            joints=rest_of_hanging(vehicle, self.joints),
            vehicle=vehicle,
            held=held,
        )

    @cached_property
    def allocation(self) -> Allocation:
        """Control allocation of the rotors, which must span the torque axes and
        thrust.
        """
        return Allocation.of(self.vehicle)

    def efforts(self, joints: Array) -> Array:
        """Generalized forces (4 + n, poses) of level hovers: base torque and thrust,
        then joint efforts.
        """
        return hover_efforts(self.vehicle, self.gravity, joints) + self.load

    def squared_speeds(self, joints: Array) -> Array:
        """Squared rotor speeds (rotors, poses) of level hovers; not limited."""
        return self.allocation.squared_speeds(self.efforts(joints))

    def worst(self, quantities: Quantities) -> tuple[Array, Array]:
        """Minimum over all arm poses of each checked quantity (count,), and the poses
        (count, n) where it occurs.

        A random search with shrinking steps starts from the worst sample; each quantity
        has lanes of its own.
        """
        values = in_parts(quantities, self.joints)
        at = np.argmin(values, axis=1)
        least = values[np.arange(len(values)), at]
        best = self.joints[at]
        if not self.searched or not self.joints.shape[1]:
            return least, best
        # a fixed seed, so that one vehicle always has the same findings
        rng = np.random.default_rng(0)
        # the first steps are a tenth of each joint's range, chosen
        spread = 0.1
        count = len(values)
        for _ in range(ROUNDS):
            steps = (
                spread
                * (self.high - self.low)
                * rng.normal(size=(AROUND, len(self.low)))
            )
            near = np.clip(best[:, None] + steps, self.low, self.high)
            near = rest_of_hanging(self.vehicle, near.reshape(count * AROUND, -1))
            # every quantity is evaluated at the poses of all, but searched in its own
            # lanes
            near_values = in_parts(quantities, near).reshape(count, count, AROUND)
            own = near_values[np.arange(count), np.arange(count)]
            at = np.argmin(own, axis=1)
            tried = own[np.arange(count), at]
            better = tried < least
            least = np.where(better, tried, least)
            nearest = near.reshape(count, AROUND, -1)[np.arange(count), at]
            best = np.where(better[:, None], nearest, best)
            spread *= CLOSER
        return least, best


def in_parts(quantities: Quantities, joints: Array) -> Array:
    """Evaluate a function of arm poses for many poses, in batches of 4096 to bound
    memory.
    """
    parts = [quantities(joints[i : i + LANES]) for i in range(0, len(joints), LANES)]
    return np.concatenate(parts, axis=1)


def arm_poses(
    vehicle: Vehicle, count: int = POSES, gravity: float = GRAVITY
) -> ArmPoses:
    """Sample the arm poses of a vehicle for a check; a vehicle without joints has a
    single pose.

    Args:
        vehicle: vehicle with its joints' limits.
        count: sampled poses beside zero and the corners.
        gravity: m/s^2.

    Raises:
        ValueError: one line: a count outside of what is allowed.
    """
    if not 1 <= count <= MOST_POSES:
        raise ValueError(f"--arm-poses = {count}: must be from 1 to {MOST_POSES}")
    ranges = np.array([joint_range(joint) for joint in vehicle.joints]).reshape(-1, 2)
    low, high = ranges[:, 0], ranges[:, 1]
    n = vehicle.n
    # a fixed seed, so that every check of a vehicle looks at the same poses
    rng = np.random.default_rng(0)
    joints = np.clip(np.zeros((1, n)), low, high)
    long_rope = n > CORNERS and len(hanging_joints(vehicle)) == n
    count = min(count, HUNG) if long_rope else count
    if n:
        unit = np.stack([_coordinates(count, i, rng) for i in range(n)], axis=1)
        corners = (
            np.array(np.meshgrid(*[(0.0, 1.0)] * n)).reshape(n, -1).T
            if n <= CORNERS
            else np.zeros((0, n))
        )
        joints = np.vstack([joints, low + (high - low) * np.vstack([corners, unit])])
    if long_rope:
        rest = rest_of_hanging(vehicle, joints[:1])
        joints = np.where(_at_rest_anywhere(vehicle, rest), joints, rest)
    poses = ArmPoses(
        vehicle=vehicle,
        low=low,
        high=high,
        joints=joints,
        gravity=gravity,
        searched=not long_rope,
    )
    return poses.of(vehicle)


def _at_rest_anywhere(vehicle: Vehicle, rest: Array) -> Mask:
    """True for each joint that no weight turns in a pose (1, n) at rest."""
    # by 1 rad or m, chosen: what _lowest gives back unchanged there has no lowest place
    turned = [
        np.where(np.arange(vehicle.n) == i, rest + 1.0, rest) for i in range(vehicle.n)
    ]
    return np.array(
        [_lowest(vehicle, each, i)[0] == each[0, i] for i, each in enumerate(turned)],
        dtype=bool,
    )


def _coordinates(count: int, dimension: int, rng: np.random.Generator) -> Array:
    """Samples (count,) in [0, 1) for one joint: coordinate of shifted Sobol points;
    beyond 21 joints, random.
    """
    # brings the sweeps along
    from skyarm.studies.sweep.sobol import BITS, DIMENSIONS, sobol

    if dimension >= DIMENSIONS:
        return rng.random(count)
    # unshifted, the first point of every joint would be its lower limit
    points = sobol(np.arange(count), dimension).astype(float) / 2.0**BITS
    return (points + rng.random()) % 1.0
