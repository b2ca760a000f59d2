"""Shipped environments: each a scenario file in this folder with default actions,
observation and reward.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import resources
from typing import TYPE_CHECKING, Any

from skyarm.envs.action_kinds import (
    Actions,
    RatesAndThrust,
    References,
    Residual,
    RotorsAndJoints,
)
from skyarm.envs.observed_quantities import USUAL, Depth, Observed
from skyarm.envs.reward_terms import (
    USUAL_REWARD,
    ActionChange,
    Alive,
    Lost,
    PositionDistance,
    PositionNear,
    RewardTerm,
    Spin,
    SurfaceNear,
    Upright,
)
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario, ScenarioError

if TYPE_CHECKING:
    from skyarm.envs.single_environment import Environment
    from skyarm.envs.vector_environment import VectorEnvironment


@immutable
class NamedTask:
    """Default arguments of a shipped learning environment.

    Attributes:
        file: file of its scenario. actions: kind of actions. reward, observation: their
            parts.
        randomise: path -> distribution of what is drawn for every episode. derived:
            path -> expression of it.
    """

    file: str
    actions: Actions
    reward: tuple[RewardTerm, ...]
    randomise: Mapping[str, Any]
    observation: tuple[str | Observed, ...] = USUAL
    derived: Mapping[str, str] | None = None


def _symmetric(size: float) -> dict[str, list[float]]:
    return {"uniform": [-size, size]}


PLACES = {
    f"initial.position.{axis}": {"uniform": [at - 0.3, at + 0.3]}
    for axis, at in zip("xyz", (0, 0, 1.5), strict=True)
}
THROWN = {
    **{
        f"initial.{angle}": _symmetric(size)
        for angle, size in (
            ("roll", math.pi),
            ("pitch", math.pi / 2.0),
            ("yaw", math.pi),
        )
    },
    **{f"initial.rate.{axis}": _symmetric(5.0) for axis in "xyz"},
    **{f"initial.velocity.{axis}": _symmetric(2.0) for axis in "xyz"},
}

# a vehicle without joints would observe empty quantities of them
NO_ARM = ("position_error", "velocity_error", "attitude", "body_rate", "last_action")

NAMED: dict[str, NamedTask] = {
    "Hover": NamedTask(
        file="hover",
        actions=RotorsAndJoints(span=0.3),
        reward=(
            PositionNear(),
            PositionDistance(weight=0.2),
            Spin(weight=0.5),
            ActionChange(weight=0.05),
            Lost(weight=10.0),
        ),
        randomise={
            **PLACES,
            "initial.roll": _symmetric(0.3),
            "initial.pitch": _symmetric(0.3),
        },
        observation=NO_ARM,
    ),
    "TrackTip": NamedTask(
        file="track_tip",
        actions=RotorsAndJoints(span=0.3),
        reward=USUAL_REWARD,
        randomise={"plant.vehicle.base.mass": {"uniform": [0.65, 0.8]}},
    ),
    "HoldTipInWind": NamedTask(
        file="hold_tip_in_wind",
        actions=Residual(span=0.2),
        reward=USUAL_REWARD,
        randomise={
            "environment.wind.force_W.x": _symmetric(2.0),
            "environment.wind.force_W.y": _symmetric(2.0),
        },
    ),
    "CarryPayload": NamedTask(
        file="carry_payload",
        actions=Residual(span=0.2),
        reward=USUAL_REWARD,
        randomise={"plant.payload.mass": {"uniform": [0.0, 0.1]}},
    ),
    "Recover": NamedTask(
        file="recover",
        actions=RatesAndThrust(rate=8.0),
        reward=(
            Upright(),
            PositionDistance(weight=0.1),
            Spin(weight=0.5),
            Alive(weight=0.1),
            Lost(weight=10.0),
        ),
        randomise=THROWN,
    ),
    "ReachWhatTheWristSees": NamedTask(
        file="reach_what_the_wrist_sees",
        actions=References(position=0.5, angle=0.5),
        reward=(
            SurfaceNear(scale=0.2),
            ActionChange(weight=0.05),
            Lost(weight=10.0),
        ),
        randomise={
            "world.surfaces.target.position.x": _symmetric(0.25),
            "world.surfaces.target.position.y": _symmetric(0.25),
            "world.surfaces.target.position.z": {"uniform": [0.5, 0.7]},
        },
        observation=(*USUAL, Depth(sensor="wrist")),
    ),
    "FlyThroughWindow": NamedTask(
        file="fly_through_window",
        actions=References(position=0.5, angle=0.2),
        reward=(
            Alive(),
            ActionChange(weight=0.05),
            Lost(weight=100.0),
        ),
        # the walls move as one
        randomise={
            "y": _symmetric(0.4),
            "z": _symmetric(0.2),
        },
        derived={
            "world.surfaces.left.position.y": "1.4 + y",
            "world.surfaces.right.position.y": "y - 1.4",
            "world.surfaces.above.position.y": "y",
            "world.surfaces.below.position.y": "y",
            "world.surfaces.above.position.z": "2.34 + z",
            "world.surfaces.below.position.z": "0.06 + z",
        },
        observation=(*USUAL, Depth(sensor="front", scale=4.0)),
    ),
}
"""Shipped environments by the name between ``skyarm/`` and ``-v0``."""


def task_scenario(name: str) -> Scenario:
    """Load the scenario of a shipped learning environment.

    Raises:
        ScenarioError: there is none of this name.
    """
    with resources.as_file(
        resources.files("skyarm.envs") / "tasks" / f"{named_task(name).file}.toml"
    ) as path:
        return load_scenario(path)


def named_task(name: str) -> NamedTask:
    """Default arguments of a shipped learning environment, by its name.

    Raises:
        ScenarioError: there is none of this name.
    """
    if name not in NAMED:
        raise ScenarioError(f"task = {shown(name)}: {must_be_one_of(NAMED, name)}")
    return NAMED[name]


def task_arguments(task: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of a shipped learning environment, with defaults for those not
    given.
    """
    mine = named_task(task)
    own = {
        name: getattr(mine, name)
        for name in ("actions", "observation", "reward", "randomise", "derived")
    }
    arguments = {**own, **given}
    # no file is read for a scenario that is given
    if "scenario" in given:
        return arguments
    return {"scenario": task_scenario(task), **arguments}


def make_single(*, task: str, **given: Any) -> Environment:
    """Make a shipped learning environment with one episode at a time."""
    from skyarm.envs.single_environment import Environment

    return Environment(**task_arguments(task, given))


# what Gymnasium looks at before it makes an environment, for modes that it derives, as
# rgb_array_list
make_single.__dict__["metadata"] = {"render_modes": ["rgb_array"]}


def make_vector(num_envs: int = 1, *, task: str, **given: Any) -> VectorEnvironment:
    """Make a shipped learning environment with many parallel episodes."""
    from skyarm.envs.vector_environment import VectorEnvironment

    return VectorEnvironment(num_envs, **task_arguments(task, given))
