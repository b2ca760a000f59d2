"""First call and steps a second of an environment in JAX, in a process of its own.

python tests/studies/bench/measure_jax_environment.py [--late]

``--late`` starts JAX before the environment is made, which then warns.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from typing import Any

TASK, LANES, STEPS, CALLS = "skyarm/TrackTip-v0", 4096, 32, 9


def measure(
    *, late: bool = False, lanes: int = LANES, calls: int = CALLS
) -> dict[str, float]:
    """Fly rollouts of ``STEPS`` steps with a linear policy and auto-reset.

    Args:
        late: start JAX first.
        lanes: flown side by side.
        calls: of the compiled rollout, after the first.

    Returns:
        ``first_s`` and ``first_processor_s`` from here to the first result; ``rate``
        and ``work_rate``, steps a second by the clock and of processor time, medians.
    """
    begun = time.perf_counter(), time.process_time()
    import jax
    import jax.numpy as jnp

    from skyarm.envs import make_jax

    if late:
        jax.random.key(0)
    env, params = make_jax(TASK)
    weights = jnp.zeros((env.observation_size, env.action_size))

    def rollout(observations: Any, states: Any) -> Any:
        def step(now: Any, _: Any) -> Any:
            actions = jnp.tanh(now[0] @ weights)
            seen, following, rewards, _, _ = jax.vmap(env.step, (None, 0, 0, None))(
                None, now[1], actions, params
            )
            return (seen, following), rewards

        return jax.lax.scan(step, (observations, states), length=STEPS)

    fly: Any = jax.jit(rollout)
    start: Any = jax.jit(jax.vmap(env.reset, (0, None)))
    wait: Any = jax.block_until_ready
    now, _ = wait(fly(*start(jax.random.split(jax.random.key(0), lanes), params)))
    first = time.perf_counter() - begun[0], time.process_time() - begun[1]
    clock, work = [], []
    for _ in range(calls):
        begun = time.perf_counter(), time.process_time()
        now, _ = wait(fly(*now))
        clock.append(lanes * STEPS / (time.perf_counter() - begun[0]))
        work.append(lanes * STEPS / (time.process_time() - begun[1]))
    found = {"first_s": first[0], "first_processor_s": first[1]}
    return found | {
        "rate": statistics.median(clock),
        "work_rate": statistics.median(work),
    }


def main(words: Sequence[str] | None = None) -> None:
    """Print what is measured."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--late", action="store_true", help="start JAX before the environment is made"
    )
    for name, value in measure(**vars(parser.parse_args(words))).items():
        print(f"{name:<20} {value:12.4g}")


if __name__ == "__main__":
    main()
