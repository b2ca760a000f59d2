"""An environment in JAX flies what the native one flies, vectorises, and has right
gradients.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
jax = pytest.importorskip("jax", reason="needs the extra 'jax'")

# ruff: noqa: E402  they need the libraries
import jax.numpy as jnp
from small_environments import bare, noisy, one_program_a_task

from skyarm.compile.jax import jax_cpu
from skyarm.compile.jax.jax_cpu import EXTRA_OPTIONS
from skyarm.envs import make_jax
from skyarm.envs.jax_environment import quantile
from skyarm.envs.single_environment import Environment
from skyarm.envs.vector_environment import VectorEnvironment
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studies.sweep.distributions import distribution_from
from support.engines import jax_doubles

# tests of one process share a JAX, which starts here without flags; none of them is to
# set some for the others
jax.devices()
pytestmark = pytest.mark.filterwarnings("ignore:make_jax. JAX has started")

WIND = "environment.wind.force_W.x"
SHORT = {
    "scenario": "case3_wind",
    "actions": "residual",
    "duration": 0.5,
    "precision": "double",
}
VARIED = {
    "plant.payload.mass": {"uniform": [0.0, 0.1]},
    WIND: {"normal": [1.0, 0.5]},
    "plant.vehicle.base.mass": {"log_uniform": [0.7, 0.8]},
    "plant.gravity": {"list": [9.79, 9.8, 9.81]},
}


@pytest.fixture(autouse=True)
def _double():
    with jax_doubles():
        yield


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    with one_program_a_task(tmp_path_factory.mktemp("cache")):
        yield


def flown_beside(arguments, steps, seed):
    """Greatest difference of observations and rewards from the native environment,
    through ends and new beginnings.
    """
    native = Environment(**arguments)
    env, params = make_jax(**arguments)
    wanted, _ = native.reset(seed=seed)
    found, state = env.reset(jax.random.PRNGKey(seed), params)
    step, worst, ends = jax.jit(env.step), float(np.abs(wanted - found).max()), 0
    draw = np.random.default_rng(1).uniform
    for _ in range(steps):
        action = draw(-0.5, 0.5, env.action_size)
        wanted, reward, ended, truncated, why = native.step(action)
        found, state, gained, done, info = step(None, state, action, params)
        worst = max(
            worst,
            float(np.abs(wanted - info["final_obs"]).max()),
            abs(reward - float(gained)),
        )
        assert (ended, truncated) == (bool(info["terminated"]), bool(info["truncated"]))
        assert env.statuses[int(info["ending"])] == why.get("status", "")
        assert bool(done) == (ended or truncated)
        if done:
            wanted, _ = native.reset()
            worst, ends = max(worst, float(np.abs(wanted - found).max())), ends + 1
    return worst, ends


def test_its_first_step_is_that_of_the_native_one():
    """Operation by operation, which compiles nothing whole."""
    with jax.disable_jit():
        worst, _ = flown_beside(
            bare(actions="rotors_and_joints", precision="double"), 1, seed=3
        )
    assert worst < 1e-12


@pytest.mark.thorough
def test_it_flies_what_the_native_one_flies_through_ends():
    """A quadrotor with a noisy sensor that falls and begins again."""
    worst, ends = flown_beside(
        bare(actions="rotors_and_joints", precision="double"), 70, seed=3
    )
    assert worst < 1e-10
    assert ends == 2


ALONE = """
import sys
sys.path[:0] = {paths!r}
from jax_kernel import configure_cpu
configure_cpu()
import jax
jax.config.update("jax_enable_x64", True)
import test_jax_environment as here
worst, ends = here.flown_beside(here.CASES[{case!r}], 210, seed=2**32 - 1)
assert worst < 1e-10 and ends >= 2, (worst, ends)
"""
CASES = {
    "numbers": {**SHORT, "randomise": VARIED},
    "noise, air, delays": {
        "scenario": noisy(),
        "actions": "residual",
        "precision": "double",
    },
}


@pytest.mark.thorough
@pytest.mark.parametrize("case", CASES)
def test_it_flies_what_the_native_one_flies_with_all_that_draws(case):
    """In a process of its own: with the flags, which JAX reads once, XLA takes seconds
    in place of minutes.
    """
    here = Path(__file__).resolve().parent
    code = ALONE.format(
        paths=[str(here), str(here.parent), str(here.parent / "studies" / "bench")],
        case=case,
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.thorough
def test_many_are_lanes_of_the_vector_environment_and_a_scan_is_a_loop():
    arguments = bare(
        actions="rates_and_thrust",
        precision="double",
        randomise={"initial.roll": {"uniform": [-1.0, 1.0]}},
    )
    env, params = make_jax(**arguments)
    native = VectorEnvironment(3, autoreset_mode="SameStep", **arguments)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 3, env.action_size))
    keys = jax.vmap(jax.random.PRNGKey)(jnp.arange(5, 8))

    def fly(keys, actions, params):
        observed, state = jax.vmap(env.reset, (0, None))(keys, params)

        def step(state, action):
            seen, state, reward, done, _ = jax.vmap(env.step, (0, 0, 0, None))(
                keys, state, action, params
            )
            return state, (seen, reward, done)

        return observed, jax.lax.scan(step, state, actions)[1]

    first, (seen, rewards, done) = jax.jit(fly)(keys, actions, params)
    wanted, _ = native.reset(seed=5)
    assert np.allclose(first, wanted, rtol=0.0, atol=1e-10)
    for k, action in enumerate(actions):
        observed, reward, ended, truncated, _ = native.step(action)
        assert np.allclose(seen[k], observed, rtol=0.0, atol=1e-10)
        assert np.allclose(rewards[k], reward, rtol=0.0, atol=1e-10)
        assert np.array_equal(done[k], ended | truncated)
    assert done.any()
    native.close()


@pytest.mark.thorough
def test_gradients_through_policy_and_physics_are_those_of_differences():
    arguments = bare(
        actions="rates_and_thrust",
        precision="double",
        reward=["position_distance", "spin"],
    )
    env, params = make_jax(**arguments, numbers=["plant.vehicle.base.mass"])
    assert params["plant.vehicle.base.mass"] == pytest.approx(0.716)

    def gained(weights, params):
        def step(carry, _):
            seen, state = carry
            seen, state, reward, _, _ = env.step_env(
                None, state, jnp.tanh(weights @ seen), params
            )
            return (seen, state), reward

        start = env.reset(jax.random.key(1), params)
        return jnp.sum(jax.lax.scan(step, start, None, length=15)[1])

    weights = jnp.asarray(
        np.random.default_rng(0).normal(
            0.0, 0.1, (env.action_size, env.observation_size)
        )
    )
    both = jax.jit(jax.value_and_grad(gained, argnums=(0, 1)))
    _, (slope, slopes) = both(weights, params)
    along = np.random.default_rng(1).normal(size=weights.shape)
    total = jax.jit(gained)
    by_weights = (
        total(weights + 1e-6 * along, params) - total(weights - 1e-6 * along, params)
    ) / 2e-6
    assert float(jnp.sum(slope * along)) == pytest.approx(float(by_weights), rel=1e-5)
    mass = "plant.vehicle.base.mass"
    ends = [total(weights, {**params, mass: params[mass] + h}) for h in (1e-6, -1e-6)]
    assert float(slopes[mass]) == pytest.approx(
        float(ends[0] - ends[1]) / 2e-6, rel=1e-5
    )
    assert float(slopes[mass]) != 0.0


@pytest.mark.parametrize(
    "table",
    [
        {"uniform": [-1.0, 2.0]},
        {"normal": [1.0, 0.5]},
        {"log_uniform": [0.1, 2.0]},
        {"list": [3.0, 1.0, 2.0]},
    ],
)
def test_numbers_are_the_quantiles_of_sweeps(table):
    distribution = distribution_from(table, "at")
    units = np.array([1e-9, 0.2, 0.34, 0.5, 0.67, 0.999, 1.0 - 1e-9])
    found = [float(quantile(distribution, jnp.asarray(unit))) for unit in units]
    assert found == pytest.approx(distribution.quantile(units).tolist(), rel=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"name": "skyarm/Hoover-v0"}, "did you mean"),
        ({"precision": "bit_exact"}, "must be 'single' or 'double'"),
        ({"numbers": "plant.gravity"}, "must be a list of paths"),
        ({"numbers": ["plant.gravity", "plant.gravity"]}, "none that is named already"),
        ({"numbers": ["plant.gravitas"]}, "numbers: .*gravitas"),
    ],
)
def test_what_cannot_be_made_is_refused_in_one_line(change, words):
    with pytest.raises(ScenarioError, match=words) as error:
        make_jax(**{**bare(), **change})
    assert "\n" not in str(error.value)


def test_what_functions_cannot_take_is_refused_in_one_line():
    env, params = make_jax(**bare(precision="double"), numbers=["plant.gravity"])
    key = jax.random.key(0)
    seen, state = jax.eval_shape(env.reset, key, params)
    for given, words in (
        ({}, "must be a table of plant.gravity"),
        ({**params, "gravity": 1.0}, "must be a table of plant.gravity"),
        ({"plant.gravity": jnp.zeros(3)}, "must be one number"),
        ({"plant.gravity": {"uniform": jnp.zeros(2)}}, "must be one number"),
        (3.0, "must be a table of plant.gravity"),
        (
            {"plant.gravity": "heavy"},
            r'params\["plant.gravity"\] = \'heavy\': must be one number',
        ),
        (
            {"plant.gravity": None},
            r'params\["plant.gravity"\] = None: must be one number',
        ),
        (
            {"plant.gravity": True},
            r'params\["plant.gravity"\] = True: must be one number',
        ),
        ({"plant.gravity": 1j}, r'params\["plant.gravity"\] = 1j: must be one number'),
        (
            {"plant.gravity": [9.8, "x"]},
            r'params\["plant.gravity"\] = \[9.8, \'x\'\]: must be one number',
        ),
    ):
        with pytest.raises(ScenarioError, match=words):
            env.reset(key, given)
    for number in (10, np.float32(9.8), np.int64(9), jnp.asarray(9.8), np.array(9.8)):
        assert (
            jax.eval_shape(
                lambda given=number: env.reset(key, {"plant.gravity": given})
            )[0].shape
            == seen.shape
        )
    with pytest.raises(ScenarioError, match=r"action: shape .*must be \(4,\)"):
        jax.eval_shape(env.step, key, state, jnp.zeros((2, 4)), params)
    with pytest.raises(ScenarioError, match="key: must be one key"):
        env.reset(jax.random.split(key, 2), params)


def test_doubles_must_be_allowed():
    with jax_doubles(False), pytest.raises(ScenarioError, match="jax_enable_x64"):
        make_jax(**bare(precision="double"))


FRESH = """
import os, warnings
import jax
from skyarm.envs import make_jax
from skyarm.envs.jax_environment import quantile
warnings.simplefilter("error")
{before}
small = dict(actions="rotors_and_joints", observation=["body_rate"], reward=["alive"])
try:
    make_jax("skyarm/Hover-v0", **small)
except UserWarning as warning:
    print("warned:", warning)
print(os.environ.get("XLA_FLAGS", ""))
make_jax("skyarm/Hover-v0", **small)
"""


@pytest.mark.parametrize("late", [False, True])
def test_options_of_the_compiler_are_set_by_making_one_or_missed_in_one_line(late):
    """In a process of its own: JAX reads them once."""
    environment = os.environ | {
        "XLA_FLAGS": "--xla_cpu_enable_fast_math=false",
        "JAX_PLATFORMS": "cpu",
    }
    code = FRESH.format(before="jax.random.key(0)" if late else "")
    if late:
        code = code[: code.rindex("make_jax")]
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        check=True,
        capture_output=True,
        text=True,
    )
    *words, flags = done.stdout.split("\n")[:-1]
    if late:
        assert "call skyarm.envs.make_jax before" in words[0]
        assert flags == "--xla_cpu_enable_fast_math=false"
    else:
        assert words == []
        assert flags == f"--xla_cpu_enable_fast_math=false {EXTRA_OPTIONS}"


@pytest.mark.parametrize("started", [False, True])
@pytest.mark.parametrize(
    "own", ["", "--xla_backend_extra_options=xla_cpu_flatten_after_fusion"]
)
def test_ones_own_options_stay_and_only_a_processor_needs_them(
    monkeypatch, own, started
):
    monkeypatch.setenv("XLA_FLAGS", own)
    monkeypatch.setattr(jax_cpu, "_has_started", lambda: started)
    assert jax_cpu.configure_extra_options() == (bool(own) or not started)
    assert os.environ["XLA_FLAGS"] == (own if own or started else EXTRA_OPTIONS)
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert jax_cpu.configure_extra_options()
