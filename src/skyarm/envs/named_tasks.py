"""Shipped environments: each a scenario file in this folder with default actions,
observation and reward.

``shipped_tasks.toml`` lists them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skyarm.envs.action_kinds import ACTIONS, Actions
from skyarm.envs.observed_quantities import USUAL, Depth, Observed
from skyarm.envs.reward_terms import REWARDS, USUAL_REWARD, RewardTerm
from skyarm.envs.shipped_tasks import TASKS
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


def _task_of(row: Mapping[str, Any]) -> NamedTask:
    """Shipped environment from its table; what the table leaves out is usual."""
    depths = [Depth(**each) for each in row.get("depths", ())]
    rewards = [_make_record(each, REWARDS) for each in row.get("reward", ())]
    return NamedTask(
        file=row["file"],
        actions=_make_record(row["actions"], ACTIONS),
        reward=tuple(rewards) or USUAL_REWARD,
        randomise=row["randomise"],
        observation=(*row.get("observation", USUAL), *depths),
        derived=row.get("derived"),
    )


def _make_record(row: Mapping[str, Any], registered: Mapping[str, type[Any]]) -> Any:
    """Record of a registered class, by its name and its fields."""
    return registered[row["name"]](
        **{field: value for field, value in row.items() if field != "name"}
    )


NAMED = {name: _task_of(row) for name, row in TASKS.items()}
"""Shipped environments by the name between ``skyarm/`` and ``-v0``."""


def task_scenario(name: str) -> Scenario:
    """Load the scenario of a shipped learning environment.

    Raises:
        ScenarioError: there is none of this name.
    """
    tasks = Path(__file__).with_name("tasks")
    return load_scenario(tasks / f"{named_task(name).file}.toml")


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
