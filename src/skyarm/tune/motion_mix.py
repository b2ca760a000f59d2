"""The motions by which gains are tuned: circles, swings of the arm, lemniscates, each with a step at the end.

All of them are one trajectory with other numbers: x, y, height and heading on one eased sine each, and one for each
joint. Every plant of a search flies its own: the kinds take turns, amplitudes, frequencies and phases are drawn. Gains
that one motion flatters cost nothing more to tell from good ones, for the numbers are lanes of the same machine code.
A last kind, kept aside, has other shapes: no choice is made by it, so that it says what gains do on a new path.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from skyarm.reference import Constant, Product, Ramp, Signal, Sine, Sum, Trajectory, Windowed
from skyarm.scalars.philox import uniforms
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

KINDS = ("circle", "swings", "lemniscate")
"""Plant k flies kind k modulo their number."""

CHANNEL = 30
"""Of the generator, apart from those of plants and noise."""

EASE = Ramp(start=0.0, duration=3.0, height=1.0, shape="quintic")
"""Every sine grows from rest to its amplitude."""

STEPPED = 8.0
"""s: when the base steps."""

STEP = 0.3
"""m: of the base at the end; that of the paper's Case 3."""

HEIGHT = 10.0
"""m: of the flight; far from the ground, which counts for nothing here."""

TOGETHER = 2
"""Joints that swing by a whole amplitude; of more each swings by its share."""

SPEED = (0.2, 0.8)
"""m/s: slowest and fastest of the circles."""


def motion(vehicle: Vehicle) -> Trajectory:
    """The trajectory whose numbers :func:`draw_motions` replaces; as it stands, a lemniscate with a swinging arm."""
    return Trajectory(
        x=Sum((eased(0.45, 0.2), Windowed(Constant(STEP), start=STEPPED))),
        y=eased(0.15, 0.4),
        z=Sum((Constant(HEIGHT), eased(0.15, 0.3))),
        yaw=eased(0.2, 0.15),
        joints=tuple(_joint(link.joint, vehicle.n, 0.5 + 0.07 * i) for i, link in enumerate(vehicle.links)),
    )


def unseen_motion(vehicle: Vehicle) -> Trajectory:
    """A path of other shapes that no choice is made by.

    A spiral with two sines an axis, heading turned on, joints on two sines each; no step.
    """

    def two(amplitude: float, first: float, second: float, phase: float = 0.0) -> Signal:
        return Sum((eased(amplitude, first, phase), eased(0.5 * amplitude, second, phase + 1.0)))

    joints = []
    for i, link in enumerate(vehicle.links):
        rest, size = rest_and_size(link.joint, vehicle.n)
        joints.append(Sum((Constant(rest), two(0.8 * size, 0.33 + 0.05 * i, 0.71 - 0.04 * i, 0.8 * i))))
    return Trajectory(
        x=two(0.3, 0.11, 0.29),
        y=two(0.4, 0.13, 0.23, 2.0),
        z=Sum((Constant(HEIGHT), two(0.1, 0.19, 0.37))),
        yaw=Product(Sine(amplitude=0.5, frequency_hz=0.1, phase=0.0), EASE),
        joints=tuple(joints),
    )


def draw_motions(vehicle: Vehicle, count: int, *, seed: int) -> tuple[dict[str, Array], npt.NDArray[np.int_]]:
    """Numbers of the motions of ``count`` plants by path of the scenario, and each one's kind (count,).

    Args:
        vehicle: whose joints swing.
        count: plants; the first ones do not depend on it.
        seed: key.
    """
    kinds = np.arange(count) % len(KINDS)
    share = uniforms(seed, np.arange(count), CHANNEL, np.zeros(1, dtype=int), 8 + 3 * vehicle.n).reshape(count, -1)

    def of_kind(*choices: Array | float) -> Array:
        found: Array = np.choose(kinds, [np.broadcast_to(each, count) for each in choices])
        return found

    def between(column: int, low: float, high: float) -> Array:
        found: Array = low + (high - low) * share[:, column]
        return found

    rate, turn = between(0, 0.1, 0.25), between(1, 0.1, 0.22)
    radius = between(2, *SPEED) / (2.0 * math.pi * rate)
    slow, wide = between(3, 0.0, 0.1), between(4, 0.2, 0.5)
    values = {
        **_sine("reference.x.signals.0", of_kind(radius, slow, wide), of_kind(rate, turn, turn)),
        **_sine(
            "reference.y",
            of_kind(radius, slow, 0.35 * wide),
            of_kind(rate, turn, 2.0 * turn),
            of_kind(0.5 * math.pi, 1.0, 0.0),
        ),
        **_sine("reference.z.signals.1", between(5, 0.0, 0.15) * of_kind(0.5, 0.2, 1.0), between(6, 0.15, 0.35)),
        **_sine("reference.yaw", between(7, 0.0, 0.4) * of_kind(1.0, 0.0, 1.0), turn),
    }
    for i, link in enumerate(vehicle.links):
        at = 8 + 3 * i
        _, size = rest_and_size(link.joint, vehicle.n)
        values |= _sine(
            f"reference.joints.{i}.signals.1",
            size * of_kind(between(at, 0.4, 1.0), between(at, 0.8, 1.6), between(at, 0.4, 1.0)),
            of_kind(between(at + 1, 0.3, 0.6), between(at + 1, 0.5, 1.1), between(at + 1, 0.3, 0.7)),
            between(at + 2, -math.pi, math.pi),
        )
    return values, kinds


def eased(amplitude: float, frequency: float, phase: float = 0.0) -> Signal:
    """A sine that grows from rest."""
    return Product(Sine(amplitude=amplitude, frequency_hz=frequency, phase=phase), EASE)


def _sine(path: str, amplitude: Array, frequency: Array, phase: Array | None = None) -> dict[str, Array]:
    """Numbers of an eased sine by path."""
    at = f"{path}.signal"
    return {
        f"{at}.amplitude": amplitude,
        f"{at}.frequency_hz": frequency,
        f"{at}.phase": np.zeros(len(amplitude)) if phase is None else phase,
    }


def _joint(joint: Joint, joints: int, frequency: float) -> Signal:
    rest, size = rest_and_size(joint, joints)
    return Sum((Constant(rest), eased(size, frequency)))


def rest_and_size(joint: Joint, joints: int) -> tuple[float, float]:
    """Middle and amplitude of a joint's swing.

    Args:
        joint: whose.
        joints: of the arm; more than two share what two may do, for the base must bear them all at once.

    A tenth of what the joint may do, about its rest or the nearest place that leaves as much room again; a joint that
    may do little, as a short slide, swings about its middle.
    """
    low, high = (float(bound) for bound in (joint.lower, joint.upper))
    size = min(0.25, 0.1 * min(high - low, 2.0 * math.pi))
    return min(max(0.0, low + 4.0 * size), high - 4.0 * size), size * min(1.0, TOGETHER / joints)
