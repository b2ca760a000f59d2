"""Feasibility of a tip reference: peak demands against the vehicle's limits, before
simulation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from skyarm.dynamics.array_front import frame_jacobian
from skyarm.dynamics.workspace import reach
from skyarm.records.arrays import Array, stack_values
from skyarm.records.immutable import immutable
from skyarm.reference.task_records import Setting
from skyarm.reference.tip_motion import Arm
from skyarm.reference.tip_plan import MARGIN
from skyarm.reference.trajectory import VECTORS, Trajectory
from skyarm.reference.waypoints import FlightLimits, peaks
from skyarm.vehicle import Vehicle

LOOKS = 50.0
"""Sampling rate (Hz) at which a plan is evaluated, five times that of its samples
by default; chosen."""

MOST_LOOKS = 20_000
"""Largest number of instants at which a plan is evaluated: beyond 400 s they are
farther apart."""

MOST_JACOBIANS = 500
"""Largest number of instants at which the arm's Jacobian is evaluated: a singular value
decomposition each; chosen."""

POSTURES = 8
"""Number of random postures that determine in how many directions the arm can move the
tip."""

BLOCKED = 1e-3
"""Fraction of the largest singular value below which an arm cannot move its tip in a
direction; right angles in files are rounded, to 1.571 rad or finer."""

SINGULAR = 0.02
"""Smallest singular value over the arm's length below which a warning calls the arm
nearly singular; the tip then moves by its own length in 50 rad or more."""


@immutable
class Feasibility:
    """Peak thrust and tilt, times at joint limits and nearest arm singularity of a
    planned tip reference.

    Attributes:
        at_limits: (joint, s) of joints that carry the tip and are planned at a limit,
            and how long.
        peaks: peak values of the base's motion; thrust and tilt are those of a point
            mass.
        highest_thrust: largest thrust over the weight.
        weakest: m per rad (or 1), smallest singular value of the tip's Jacobian over
            the joints that carry it, where it is smallest. weakest_at: s, when.
            arm_length: m.
    """

    at_limits: tuple[tuple[str, float], ...]
    peaks: FlightLimits
    highest_thrust: float
    weakest: float
    weakest_at: float
    arm_length: float

    def warnings(self) -> Iterator[str]:
        """Warning texts, one for each demand beyond the vehicle's limits."""
        for joint, seconds in self.at_limits:
            yield (
                f"reference.tip: joint {joint!r} is planned at its limit for"
                f" {seconds:.3g} s; other posture?"
            )
        if self.weakest < SINGULAR * self.arm_length:
            yield (
                f"reference.tip: the arm is nearly singular at {self.weakest_at:.3g} s;"
                f" in one direction it moves the tip by {1e3 * self.weakest:.2g} mm per"
                " rad, and a law that keeps the tip may lose it; other posture?"
            )
        if self.peaks.thrust > self.highest_thrust:
            most = f"the rotors give {self.highest_thrust:.3g}"
            yield (
                f"reference.tip: asks for {self.peaks.thrust:.3g} times the weight,"
                f" {most}; slower?"
            )
        # chosen: the centroidal law leans by atan(1.2) = 0.88 rad at most by default
        if self.peaks.tilt > 1.0:
            yield (
                f"reference.tip: asks for a tilt of {self.peaks.tilt:.3g} rad; slower?"
            )


def _weakest(
    vehicle: Vehicle, carriers: Sequence[int], times: Array, joints: Array
) -> tuple[float, float]:
    """Smallest singular value of the tip Jacobian over a planned motion, and its time
    (s).

    Directions in which the arm moves the tip in no posture, such as across the plane of
    a planar arm, do not count.
    """
    every = -(-len(times) // MOST_JACOBIANS)
    times, joints = times[::every], joints[:, ::every].T
    others = np.tile(joints[0], (POSTURES, 1))
    # of a fixed seed, so that a warning comes in every run or in none
    others[:, list(carriers)] = np.random.default_rng(0).uniform(
        -1.0, 1.0, (POSTURES, len(carriers))
    )
    postures = np.concatenate([others, joints])
    still = np.zeros((len(postures), 3))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (len(postures), 1))
    J = frame_jacobian(vehicle, still, level, postures)[:, :3, 6:][:, :, list(carriers)]
    values = np.linalg.svd(J, compute_uv=False)
    moved = (values[:POSTURES] > BLOCKED * values.max()).sum(axis=1).max()
    # values fall, so the last that counts is that of the weakest direction
    least = values[POSTURES:, max(moved, 1) - 1]
    at = int(np.argmin(least))
    return float(least[at]), float(times[at])


def feasibility(trajectory: Trajectory, setting: Setting) -> Feasibility | None:
    """Feasibility of a trajectory's tip reference; None without a tip reference."""
    tip, vehicle = trajectory.tip, setting.vehicle
    if tip is None or vehicle is None:
        return None
    count = min(max(math.ceil(setting.duration * LOOKS), 1), MOST_LOOKS)
    # without the end: each instant stands for duration / count
    times = np.linspace(0.0, setting.duration, count, endpoint=False)
    reference = trajectory.at(times)
    derivatives = [
        stack_values(count, getattr(reference, name)) for name in VECTORS[1:]
    ]
    q = stack_values(count, reference.joints)
    weakest, weakest_at = _weakest(vehicle, tip.arm.carriers, times, q)
    return Feasibility(
        at_limits=tuple(_at_limits(tip.arm, q, setting.duration / count)),
        peaks=peaks(derivatives, setting.gravity),
        highest_thrust=setting.thrust_to_weight,
        weakest=weakest,
        weakest_at=weakest_at,
        arm_length=float(reach(vehicle)),
    )


def _at_limits(arm: Arm, q: Array, seconds: float) -> Iterator[tuple[str, float]]:
    """Names of arm joints that a planned motion keeps at a limit, each with the
    duration (s).
    """
    for number, joint in zip(arm.carriers, arm.joints, strict=True):
        (low, high), values = joint.ends, q[number]
        # plans keep MARGIN from a limit, so a joint at it is that far away
        near = (values <= low + 2.0 * MARGIN) | (values >= high - 2.0 * MARGIN)
        # a joint with hardly any range is near both limits all the time
        if near.any() and high - low > 4.0 * MARGIN:
            yield joint.name, float(near.sum()) * seconds
