"""Terms of an environment's reward: records whose values are added up, period by period.

A reward is a tuple of these records. Each gives ``weight`` times a number without a unit; errors are divided by the
record's ``scale``, in the unit that its field states. Rewards read the truth, which the policy does not see.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar, exp, sqrt
from skyarm.envs.observed_quantities import JointTravel, Metres, RadPerSecond, Result, tip_error
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit


@dataclass(frozen=True, kw_only=True)
class RewardTerm:
    """A reward term gives a number each period. A subclass is a frozen dataclass of numbers.

    Attributes:
        weight: by which its value counts.
    """

    weight: Annotated[float, Unit("", "by which its value counts")] = 1.0

    of_state = True
    """Whether it reads the state; it then counts nothing in the period in which that has diverged."""

    def __post_init__(self) -> None:
        accept_fields(self, type(self).__name__)

    def value(self, result: Result) -> Scalar:
        """Its value before the weight, over any scalar."""
        raise NotImplementedError(f"{type(self).__name__} must say its value")


@dataclass(frozen=True, kw_only=True)
class TipNear(RewardTerm):
    """exp(-(e / scale)^2) of the tip's distance e to its reference: 1 on it, 0 far away."""

    scale: Metres = 0.1

    def value(self, result: Result) -> Scalar:
        """Between 0 and 1."""
        return _nearness(tip_error(result.vehicle, result.state, result.reference), self.scale)


@dataclass(frozen=True, kw_only=True)
class TipDistance(RewardTerm):
    """Minus the tip's distance to its reference."""

    scale: Metres = 1.0

    def value(self, result: Result) -> Scalar:
        """At most 0."""
        return -_length(tip_error(result.vehicle, result.state, result.reference)) / self.scale


@dataclass(frozen=True, kw_only=True)
class PositionNear(RewardTerm):
    """exp(-(e / scale)^2) of the base's distance e to its reference."""

    scale: Metres = 0.5

    def value(self, result: Result) -> Scalar:
        """Between 0 and 1."""
        return _nearness(result.reference.position - result.state.position, self.scale)


@dataclass(frozen=True, kw_only=True)
class PositionDistance(RewardTerm):
    """Minus the base's distance to its reference."""

    scale: Metres = 1.0

    def value(self, result: Result) -> Scalar:
        """At most 0."""
        return -_length(result.reference.position - result.state.position) / self.scale


@dataclass(frozen=True, kw_only=True)
class Upright(RewardTerm):
    """Cosine of the tilt: 1 level, -1 upside down."""

    def value(self, result: Result) -> Scalar:
        """Between -1 and 1."""
        return result.state.quaternion.rotation().r2.z


@dataclass(frozen=True, kw_only=True)
class Spin(RewardTerm):
    """Minus the square of the body rate."""

    scale: RadPerSecond = 10.0

    def value(self, result: Result) -> Scalar:
        """At most 0."""
        return -_squares(result.state.rate) / (self.scale * self.scale)


@dataclass(frozen=True, kw_only=True)
class JointDistance(RewardTerm):
    """Minus the mean square of the joints' errors; 0 without joints."""

    scale: JointTravel = 1.0

    def value(self, result: Result) -> Scalar:
        """At most 0."""
        pairs = zip(result.reference.joints, result.state.joints, strict=True)
        return -_mean_square([(a - b) / self.scale for a, b in pairs])


@dataclass(frozen=True, kw_only=True)
class ActionSize(RewardTerm):
    """Minus the mean square of the action's numbers."""

    of_state = False

    def value(self, result: Result) -> Scalar:
        """Between -1 and 0."""
        return -_mean_square(result.action)


@dataclass(frozen=True, kw_only=True)
class ActionChange(RewardTerm):
    """Minus the mean square of how the action's numbers changed from the period before."""

    of_state = False

    def value(self, result: Result) -> Scalar:
        """Between -4 and 0."""
        return -_mean_square([a - b for a, b in zip(result.action, result.action_before, strict=True)])


@dataclass(frozen=True, kw_only=True)
class Alive(RewardTerm):
    """1 in every period that does not end the episode before its time."""

    of_state = False

    def value(self, result: Result) -> Scalar:
        """1 or 0."""
        return 1.0 - result.ended


@dataclass(frozen=True, kw_only=True)
class Lost(RewardTerm):
    """-1 in the period that ends the episode before its time."""

    of_state = False

    def value(self, result: Result) -> Scalar:
        """-1 or 0."""
        return 0.0 - result.ended


REWARDS: dict[str, type[RewardTerm]] = {
    "tip_near": TipNear,
    "tip_distance": TipDistance,
    "position_near": PositionNear,
    "position_distance": PositionDistance,
    "upright": Upright,
    "spin": Spin,
    "joint_distance": JointDistance,
    "action_size": ActionSize,
    "action_change": ActionChange,
    "alive": Alive,
    "lost": Lost,
}
"""Reward terms by the name that stands for one with its usual numbers."""

USUAL_REWARD: tuple[RewardTerm, ...] = (
    TipNear(),
    TipDistance(weight=0.1),
    Spin(weight=0.1),
    ActionChange(weight=0.05),
    Lost(weight=10.0),
)
"""The reward where none is given."""


def _squares(vector: Vec3) -> Scalar:
    square: Scalar = vector.dot(vector)
    return square


def _length(vector: Vec3) -> Scalar:
    return sqrt(_squares(vector))


def _nearness(error: Vec3, scale: float) -> Scalar:
    return exp(-_squares(error) / (scale * scale))


def _mean_square(values: Sequence[Scalar]) -> Scalar:
    total: Scalar = 0.0
    for value in values:
        total = total + value * value
    return total / float(max(1, len(values)))
