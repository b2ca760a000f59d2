"""Learning environment of pure JAX functions, with the interface of gymnax.

Both fly the program of :class:`skyarm.envs.env_program.EnvProgram`, and draw the same
numbers: lane ``reset(key)`` with ``jax.random.PRNGKey(s)`` flies what the native
environment flies after ``reset(seed=s)``, to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from skyarm.compile.machine_code import missing_extra
from skyarm.dynamics import State
from skyarm.envs.env_program import EnvProgram
from skyarm.envs.env_task import Info, LearningTask
from skyarm.envs.randomised_numbers import with_fixed
from skyarm.records.files import shown
from skyarm.records.leaves import rebuild
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate.draws import STARTS, draw_plan
from skyarm.studies.sweep.design import FIRST_CHANNEL
from skyarm.studies.sweep.distributions import (
    Distribution,
    LogUniform,
    Normal,
    Uniform,
    Values,
)

try:
    import jax
    import jax.numpy as jnp
    from jax import Array, lax
    from jax.scipy.special import ndtri
    from jax.typing import ArrayLike
except ImportError as error:  # pragma: no cover
    # the library is there when this is tested
    raise missing_extra("jax") from error

from skyarm.compile.jax.jax_operations import Float, evaluate, uniforms

StepResult = tuple[Array, "JaxState", Array, Array, Info]
"""Result of a step: observation, state, reward, done, info."""

Params = Mapping[str, ArrayLike]
"""Parameter path -> its number, for paths that a caller may set."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class JaxState:
    """State of a JAX environment, as a pytree of JAX arrays.

    Attributes:
        carry: leaves of :class:`skyarm.envs.env_program.EnvState`. numbers: values
            drawn for the episode, one a path.
        seed: high and low word of the reset's key. episode: its number, from 0 on.
            period: number of the next step.
    """

    carry: tuple[Array, ...]
    numbers: tuple[Array, ...]
    seed: Array
    episode: Array
    period: Array


class JaxEnvironment:
    """Learning environment as pure JAX functions ``reset`` and ``step`` of one episode,
    for ``jax.vmap``.

    An episode depends on the key of its reset and on its number alone. The key that a
    step is given, as is usual, is not used: noise and what the next episode begins with
    follow from the key of the reset.

    Args:
        task: learning task. numbers: parameter paths that are in the params, none of
            them randomised.

    Attributes:
        task: given task. paths: parameter paths of the params. default_params: a number
            for each path.
        observation_size, action_size: their lengths. statuses: words of
            ``info["ending"]``.
        dtype: type of all numbers.
    """

    def __init__(self, task: LearningTask, *, numbers: Iterable[str] = ()) -> None:
        if task.precision == "bit_exact":
            raise ScenarioError(
                "precision = 'bit_exact': must be 'single' or 'double' in JAX, which"
                " contracts a * b + c"
            )
        self.dtype: Float = np.float32 if task.precision == "single" else np.float64
        config: Any = jax.config
        if self.dtype == np.float64 and not config.read("jax_enable_x64"):
            raise ScenarioError(
                "precision = 'double': must come after"
                ' jax.config.update("jax_enable_x64", True)'
            )
        if task.randomised.derived:
            raise ScenarioError("derived: must be left out in JAX")
        if any(each.sees for each in task.observation):
            raise ScenarioError("observation: must have no pictures (Depth) in JAX")
        self.task = task
        # fixed numbers are inputs as drawn ones are, of a distribution with one value
        whole = with_fixed(task.randomised, task.scenario, numbers)
        self._program = EnvProgram(replace(task, randomised=whole), loops=False)
        drawn = len(task.randomised.paths)
        loop = self._program.loop
        self.paths = self._program.paths[drawn:]
        self._counts = [
            (channel, count)
            for channel, count in draw_plan(task.scenario).models
            if count
        ]
        self._start = self._program.trace_start()
        # behind the observation a step logs reward, truncated and ending
        self.observation_size, self.action_size = loop.logged - 3, self._program.size
        base = zip(self.paths, self._program.base[drawn:], strict=True)
        self.default_params = {
            path: jnp.asarray(number, self.dtype) for path, number in base
        }
        self.statuses = self._program.statuses
        # traced once, however often the functions are used in others
        self._stepped = jax.jit(self._one_step)
        self._began = jax.jit(self._first)

    def reset(self, key: Array, params: Params) -> tuple[Array, JaxState]:
        """Start episode 0 for a random key.

        Args:
            key: key of ``jax.random``.
            params: values of the paths, shaped as :attr:`default_params`.

        Returns:
            observation (observation_size,), state.
        """
        return self._began(_words(key), jnp.uint32(0), self._numbers(params))  # type: ignore[no-any-return]

    def step(
        self, key: Array, state: JaxState, action: ArrayLike, params: Params
    ) -> StepResult:
        """Simulate one control period, and start the next episode if this one has
        ended.

        Args:
            key: not used.
            state: state of the last call.
            action: (action_size,) in [-1, 1].
            params: params of the reset.

        Returns:
            observation (that of the next episode where this one is over), state,
            reward, done, info: ``terminated``, ``truncated``, ``ending`` (number of
            :attr:`statuses`), ``final_obs`` (that of this episode).
        """
        observed, after, reward, done, info = self.step_env(key, state, action, params)
        # made in every step, since a traced program has no branch that is left out
        fresh, begun = self._began(
            state.seed, state.episode + jnp.uint32(1), self._numbers(params)
        )
        following = jax.tree.map(
            lambda new, old: lax.select(done, new, old), begun, after
        )
        return (
            lax.select(done, fresh, observed),
            following,
            reward,
            done,
            {**info, "final_obs": observed},
        )

    def step_env(
        self, key: Array, state: JaxState, action: ArrayLike, params: Params
    ) -> StepResult:
        """Simulate one control period without starting a new episode at the end."""
        del key
        given = jnp.asarray(action, self.dtype)
        if given.shape != (self.action_size,):
            raise ScenarioError(
                f"action: shape {shown(given.shape)}, must be ({self.action_size},);"
                " jax.vmap makes many"
            )
        carry, observed, reward, truncated, ending = self._stepped(
            state, self._numbers(params), given
        )
        after = replace(state, carry=carry, period=state.period + jnp.uint32(1))
        terminated, truncated = ending > 0.5, truncated > 0.5
        info = {
            "terminated": terminated,
            "truncated": truncated,
            "ending": ending.astype(np.int32),
        }
        return observed, after, reward, terminated | truncated, info

    def plant_state(self, state: JaxState) -> State:
        """True vehicle state of a JAX environment, for analysis."""
        return rebuild(self._program.first, state.carry).loop.agent.state

    def _numbers(self, params: Params) -> tuple[Array, ...]:
        """Check the adjustable parameters of a JAX environment and return them as a
        tuple.

        Raises:
            ScenarioError: other paths than those of the environment, or something else
                than one number.
        """
        if not isinstance(params, Mapping) or set(params) != set(self.paths):
            raise ScenarioError(
                f"params = {shown(params)}: must be a table of"
                f" {', '.join(self.paths) or 'no paths'}"
            )
        for path, value in params.items():
            # an array of JAX may be a tracer, which has no value to convert
            kind = (
                np.asarray(value).dtype.kind
                if not isinstance(value, jax.Array)
                else "f"
            )
            if kind not in "fiu" or np.shape(value):
                raise ScenarioError(
                    f'params["{path}"] = {shown(value)}: must be one number'
                )
        return tuple(jnp.asarray(params[path], self.dtype) for path in self.paths)

    def _one_step(
        self, state: JaxState, numbers: tuple[Array, ...], action: Array
    ) -> tuple[tuple[Array, ...], Array, Array, Array, Array]:
        loop = self._program.loop
        # the state has the high word of the seed first, and the numbers take the low
        # one first
        draws = uniforms(
            state.seed[::-1], state.episode, state.period, loop.uniforms, self.dtype
        )
        outputs = evaluate(
            loop.program,
            (*state.carry, *state.numbers, *numbers, *action, *draws),
            self.dtype,
        )
        *observed, reward, truncated, ending = outputs[loop.carry :]
        return (
            tuple(outputs[: loop.carry]),
            jnp.stack(observed),
            reward,
            truncated,
            ending,
        )

    def _first(
        self, key: Array, episode: Array, numbers: tuple[Array, ...]
    ) -> tuple[Array, JaxState]:
        """Observation and state at the start of an episode."""

        def draw(period: int, channels: Sequence[tuple[int, int]]) -> list[Array]:
            return uniforms(
                key[::-1], episode, jnp.uint32(period), channels, self.dtype
            )

        distributions = self.task.randomised.vary.values()
        units = draw(0, [(FIRST_CHANNEL + i, 1) for i in range(len(distributions))])
        drawn = tuple(
            quantile(each, unit)
            for each, unit in zip(distributions, units, strict=True)
        )
        inputs = [*drawn, *numbers, *draw(0, self._program.uniforms)]
        for pair in self._counts:
            inputs += [*draw(STARTS[0], [pair]), *draw(STARTS[1], [pair])]
        outputs = evaluate(self._start.lowered, inputs, self.dtype)
        carry = tuple(outputs[: self._program.loop.carry])
        # the flight goes on with period 1, because the start has the draws of period 0
        return jnp.stack(outputs[len(carry) :]), JaxState(
            carry, drawn, key, episode, jnp.uint32(1)
        )


def _normal(given: Normal, unit: Array) -> Array:
    # the largest number below 1: a unit of single precision may be rounded up
    below = jnp.nextafter(jnp.ones_like(unit), jnp.zeros_like(unit))
    return given.mean + given.std * ndtri(jnp.minimum(unit, below))


def _value(given: Values, unit: Array) -> Array:
    index = jnp.minimum(
        # rounding to single precision may make a unit 1
        (unit * len(given.values)).astype(np.int32),
        len(given.values) - 1,
    )
    return jnp.asarray(given.values, unit.dtype)[index]


QUANTILES: dict[type, Callable[[Any, Any], Any]] = {
    Uniform: Uniform.quantile,
    LogUniform: (
        lambda given, unit: given.low * jnp.exp(np.log(given.high / given.low) * unit)
    ),
    Normal: _normal,
    Values: _value,
}
"""Quantile functions of the distributions of sweeps, on JAX scalars."""


def quantile(distribution: Distribution, unit: Array) -> Array:
    """Value of a probability distribution at a cumulative probability between 0 and 1,
    in JAX.
    """
    return jnp.asarray(QUANTILES[type(distribution)](distribution, unit), unit.dtype)


def _words(key: Array) -> Array:
    """High and low 32-bit word of a JAX random key."""
    if isinstance(key, jax.Array) and jnp.issubdtype(key.dtype, jax.dtypes.prng_key):
        key = jax.random.key_data(key)
    halves = jnp.asarray(key)
    if halves.dtype != np.uint32 or halves.ndim != 1 or halves.shape[0] < 2:
        raise ScenarioError("key: must be one key of jax.random; jax.vmap takes many")
    # keys of longer generators end with the seed, as PRNGKey(s) is (0, s)
    return halves[-2:]
