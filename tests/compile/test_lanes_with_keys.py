"""Random numbers of lanes that are stepped together: their keys are (seed, episode),
and begin anew when told.
"""

import numpy as np
import pytest

from skyarm.algebra.scalars.philox import uniforms
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.lane_stepper import LaneStepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop

DRAWS = ((0, 3), (7, 2))
LANES = 5


def drawn(seed, episode, step):
    return np.concatenate(
        [uniforms(seed, episode, channel, step, count) for channel, count in DRAWS]
    )


def stepper(**options):
    loop = trace_loop(lambda c, p, r, u: (c, tuple(u)), (), (), (), DRAWS, **options)
    return LaneStepper(Kernel(loop, Lanes(4), logging=True), LANES, seed=2**40 + 5)


@pytest.mark.parametrize("own", [False, True])
def test_each_lane_draws_by_its_seed_its_episode_and_its_own_count_of_steps(own):
    made, seeds = stepper(own_seeds=own), [2**40 + 5] * LANES
    episodes, first = [3, 9, 4, 1, 2**32 - 1], [0] * LANES
    made.begin(np.arange(LANES), np.array(episodes))
    for tick in range(6):
        if tick == 2:  # two lanes begin other episodes, at steps of their own
            again = np.array([21, 22]) if own else None
            made.begin(np.array([1, 3]), np.array([50, 51]), again, first=7)
            episodes[1], episodes[3] = 50, 51
            first[1] = first[3] = 7 - tick
            if own:
                seeds[1], seeds[3] = 21, 22
        made.step()
        for k in range(LANES):
            np.testing.assert_array_equal(
                made.logged[:, k], drawn(seeds[k], episodes[k], tick + first[k])
            )
