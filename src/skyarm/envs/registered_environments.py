"""Registration of the learning environments with Gymnasium, and their construction in
JAX.

Neither the engine nor JAX is loaded before an environment is made.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from skyarm.envs.shipped_tasks import TASKS
from skyarm.records.files import must_be_one_of, needs_extra, shown

try:
    import gymnasium
except ModuleNotFoundError:
    raise ModuleNotFoundError(
        f"skyarm.envs: {needs_extra('gym')}", name="gymnasium"
    ) from None

SINGLE = "skyarm.envs.single_environment:Environment"
VECTOR = "skyarm.envs.vector_environment:VectorEnvironment"
SHIPPED_TASKS = "skyarm.envs.named_tasks"

ANY_SCENARIO = "skyarm/Scenario-v0"


def register() -> None:
    """Register the learning environments with Gymnasium; repeated calls have no
    effect.
    """
    if ANY_SCENARIO in gymnasium.registry:
        return
    gymnasium.register(ANY_SCENARIO, entry_point=SINGLE, vector_entry_point=VECTOR)
    for name in TASKS:
        gymnasium.register(
            f"skyarm/{name}-v0",
            entry_point=f"{SHIPPED_TASKS}:make_single",
            vector_entry_point=f"{SHIPPED_TASKS}:make_vector",
            kwargs={"task": name},
        )


if TYPE_CHECKING:
    from skyarm.envs.jax_environment import JaxEnvironment

STARTED = (
    "make_jax: JAX has started without XLA's options for stepped programs, so that the"
    " first call takes minutes: call skyarm.envs.make_jax before the first array or key"
    " is made"
)


def make_jax(
    name: str = ANY_SCENARIO, *, numbers: Iterable[str] = (), **task: Any
) -> tuple[JaxEnvironment, dict[str, Any]]:
    """Make a learning environment in JAX; return the environment and its default
    parameters.

    On a processor XLA compiles a step in seconds with options that JAX reads when it
    starts, and in minutes without them: this sets them in ``XLA_FLAGS`` of the process,
    and warns in one line if JAX has started without them.

    Args:
        name: name for :func:`gymnasium.make`: ``"skyarm/TrackTip-v0"``, or
            ``"skyarm/Scenario-v0"`` with a scenario.
        numbers: further paths that stand in ``params``, to be set or differentiated by.
        task: arguments of the environment of that name: ``scenario``, ``actions``,
            ``observation``, ``reward``, ``randomise``, ``controller``, ``duration``,
            ``precision``.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
        ImportError: JAX is not installed.
    """
    from skyarm.compile.jax.jax_cpu import configure_extra_options
    from skyarm.envs.env_task import make_task
    from skyarm.envs.jax_environment import JaxEnvironment
    from skyarm.envs.named_tasks import task_arguments
    from skyarm.scenario.scenario_record import ScenarioError

    tasks = {ANY_SCENARIO: None, **{f"skyarm/{each}-v0": each for each in TASKS}}
    if not isinstance(name, str) or name not in tasks:
        raise ScenarioError(f"name = {shown(name)}: {must_be_one_of(tasks, name)}")
    given = (
        {"scenario": "case3", **task}
        if tasks[name] is None
        else task_arguments(str(tasks[name]), task)
    )
    if not configure_extra_options():
        warnings.warn(STARTED, stacklevel=2)
    env = JaxEnvironment(make_task(**given), numbers=numbers)
    return env, env.default_params
