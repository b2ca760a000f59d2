"""Terms of an environment's reward, which are summed in every period.

A reward is a tuple of these records. Each gives ``weight`` times a number without a
unit; errors are divided by the record's ``scale``, in the unit that its field states.
Rewards read the truth, which the policy does not see.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import Scalar, Vec3
from skyarm.algebra.scalars import exp, minimum
from skyarm.envs.observed_quantities import (
    JointTravel,
    Metres,
    RadPerSecond,
    Result,
    tip_error,
)
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import must_be_one_of
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate.tip_and_goal import tip_at


@immutable
class RewardTerm:
    """Base class of reward terms; a term returns one value per control period.

    Attributes:
        weight: factor of its value in the reward.
    """

    weight: Annotated[
        float,
        Unit(
            "",
            "factor of the term's value in the reward",
            effect=(
                "higher values make the policy care more for this term than for the"
                " others"
            ),
        ),
    ] = 1.0

    of_state = True
    """True if the term reads the state; it then counts nothing in the period in which
    the state diverges."""

    def __post_init__(self) -> None:
        accept_fields(self, type(self).__name__)

    def value(self, result: Result) -> Scalar:
        """Value of the reward term in a control period, before multiplication by its
        weight.
        """
        raise NotImplementedError(f"{type(self).__name__} must define value()")


@immutable
class TipNear(RewardTerm):
    """Reward exp(-(e / scale)^2) for the tip's distance e to its reference: 1 at zero
    distance.
    """

    scale: Metres = 0.1

    def value(self, result: Result) -> Scalar:
        """Reward between 0 and 1 that is 1 at the reference position of the tip."""
        return _nearness(
            tip_error(result.vehicle, result.state, result.reference), self.scale
        )


@immutable
class TipDistance(RewardTerm):
    """Penalty for the tip's distance to its reference."""

    scale: Metres = 1.0

    def value(self, result: Result) -> Scalar:
        """Negative distance of the tip from its reference, divided by the scale."""
        error = tip_error(result.vehicle, result.state, result.reference)
        return -error.norm() / self.scale


@immutable
class PositionNear(RewardTerm):
    """Reward exp(-(e / scale)^2) for the base's distance e to its reference."""

    scale: Metres = 0.5

    def value(self, result: Result) -> Scalar:
        """Reward between 0 and 1 that is 1 at the reference position of the base."""
        return _nearness(result.reference.position - result.state.position, self.scale)


@immutable
class PositionDistance(RewardTerm):
    """Penalty for the base's distance to its reference."""

    scale: Metres = 1.0

    def value(self, result: Result) -> Scalar:
        """Negative distance of the base from its reference, divided by the scale."""
        error = result.reference.position - result.state.position
        return -error.norm() / self.scale


@immutable
class SurfaceNear(RewardTerm):
    """Reward exp(-d / scale) for the tip's distance d from a fixed surface: 1 where it
    touches.

    Attributes:
        surface: name of the surface.
    """

    surface: Annotated[str, Unit("", "name of the surface to touch")] = "target"
    scale: Metres = 0.1

    def value(self, result: Result) -> Scalar:
        """Reward between 0 and 1 that is 1 on and within the surface."""
        surfaces = {
            each.name: each for world in result.scenario.worlds for each in world.still
        }
        if self.surface not in surfaces:
            allowed = must_be_one_of(surfaces, self.surface)
            raise ScenarioError(f"SurfaceNear: surface = {self.surface!r}: {allowed}")
        state = result.state
        tip = tip_at(result.vehicle, state.position, state.quaternion, state.joints)
        # a radius that is a float: that of an int 0 asks for the nearest face alone
        depth, _ = surfaces[self.surface].depth(tip, 0.0, 0.0)
        return exp(minimum(depth, 0.0) / self.scale)


@immutable
class Upright(RewardTerm):
    """Reward for a level attitude: cosine of the tilt, 1 when level, -1 upside down."""

    def value(self, result: Result) -> Scalar:
        """Cosine of the tilt angle, between -1 and 1."""
        return result.state.rotation.r2.z


@immutable
class Spin(RewardTerm):
    """Penalty for rotation: minus the squared body rate."""

    scale: RadPerSecond = 10.0

    def value(self, result: Result) -> Scalar:
        """Negative squared body rate, divided by the squared scale."""
        return -_squares(result.state.rate) / (self.scale * self.scale)


@immutable
class JointDistance(RewardTerm):
    """Penalty for joint errors: minus their mean square; 0 without joints."""

    scale: JointTravel = 1.0

    def value(self, result: Result) -> Scalar:
        """Negative mean square of the scaled joint errors."""
        pairs = zip(result.reference.joints, result.state.joints, strict=True)
        return -_mean_square([(a - b) / self.scale for a, b in pairs])


@immutable
class ActionSize(RewardTerm):
    """Penalty for large actions: minus the mean square of their components."""

    of_state = False

    def value(self, result: Result) -> Scalar:
        """Negative mean square of the action's components, between -1 and 0."""
        return -_mean_square(result.action)


@immutable
class ActionChange(RewardTerm):
    """Penalty for action changes: minus the mean squared difference from the previous
    action.
    """

    of_state = False

    def value(self, result: Result) -> Scalar:
        """Negative mean square of the action's change, between -4 and 0."""
        return -_mean_square(
            [a - b for a, b in zip(result.action, result.action_before, strict=True)]
        )


@immutable
class Alive(RewardTerm):
    """Survival reward: 1 in every period without early termination."""

    of_state = False

    def value(self, result: Result) -> Scalar:
        """Reward 1 in a control period without early termination, else 0."""
        return 1.0 - result.ended


@immutable
class Lost(RewardTerm):
    """Penalty for early termination: -1 in the period of termination."""

    of_state = False

    def value(self, result: Result) -> Scalar:
        """Penalty -1 in the control period of an early termination, else 0."""
        return 0.0 - result.ended


REWARDS: dict[str, type[RewardTerm]] = {
    "tip_near": TipNear,
    "tip_distance": TipDistance,
    "position_near": PositionNear,
    "position_distance": PositionDistance,
    "surface_near": SurfaceNear,
    "upright": Upright,
    "spin": Spin,
    "joint_distance": JointDistance,
    "action_size": ActionSize,
    "action_change": ActionChange,
    "alive": Alive,
    "lost": Lost,
}
"""Reward terms by name; a name alone selects the default numbers."""

USUAL_REWARD: tuple[RewardTerm, ...] = (
    TipNear(),
    TipDistance(weight=0.1),
    Spin(weight=0.1),
    ActionChange(weight=0.05),
    Lost(weight=10.0),
)
"""Default reward."""


def _squares(vector: Vec3) -> Scalar:
    square: Scalar = vector.dot(vector)
    return square


def _nearness(error: Vec3, scale: float) -> Scalar:
    return exp(-_squares(error) / (scale * scale))


def _mean_square(values: Sequence[Scalar]) -> Scalar:
    total: Scalar = 0.0
    for value in values:
        total = total + value * value
    # a mean of no joints is 0
    return total / float(max(1, len(values)))
