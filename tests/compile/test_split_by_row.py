"""What depends on the row of a step alone, computed before the steps: the bits of the
step that computes all itself.
"""

from __future__ import annotations

import numpy as np
import pytest
from programs_random import random_function, same_bits

from skyarm.algebra.scalars import cos, sin, where
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_loop import split_by_row
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.lower import operations
from skyarm.compile.tracing.program import trace_loop

MODES = [Lanes(4), Lanes(4, contract=True), Lanes(8, single=True, contract=True)]


@pytest.fixture(autouse=True)
def _optimised(tmp_path, monkeypatch):
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    monkeypatch.setenv("SKYARM_EFFORT", "2")


def circle(carry, parameters, row, draws):
    """A point pulled to a circle of the lane's radius, by a force that is twice as
    large in the dark.
    """
    x, y = carry
    time, light = row
    pull = where(light < 0.5, 2.0, 1.0) * 0.01
    goal_x, goal_y = (
        parameters[0] * cos(2.0 * time) + time * 0.5,
        parameters[0] * sin(2.0 * time),
    )
    following = x + pull * (goal_x - x), y + pull * (goal_y - y)
    both = time * light
    return following, (*following, x + time * time, y + both, both + 0.3)


def flown(loop, lanes, rows, ahead):
    rng = np.random.default_rng(1)
    kernel = Kernel(loop, lanes, logging=True, ahead=ahead)
    return kernel.run(rng.normal(size=(2, 13)), rng.normal(size=(1, 13)), rows)


@pytest.mark.parametrize("lanes", MODES, ids=str)
def test_the_step_that_reads_has_the_bits_of_the_step_that_computes(lanes):
    loop = trace_loop(circle, (0.0, 0.0), (0.0,), (0.0, 0.0))
    _, step = split_by_row(loop)
    rows = np.column_stack(
        [np.linspace(0.0, 30.0, 50), np.random.default_rng(2).uniform(size=50)]
    )
    for one, other in zip(
        flown(loop, lanes, rows, False), flown(loop, lanes, rows, True), strict=True
    ):
        assert same_bits(one, other)
    # four products and seven sums of a lane, and four products of the row that have one
    # use
    assert operations(step.program.nodes) == 15 < operations(loop.program.nodes) / 4


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("lanes", MODES, ids=str)
def test_split_random_programs_have_the_bits_of_whole_ones(seed, lanes):
    of_row, of_all = (
        random_function(np.random.default_rng([seed, k]), length=10) for k in range(2)
    )

    def step(carry, parameters, row, draws):
        made = of_all(*carry, *parameters, *of_row(*row)[-9:])
        return made[-2:], (*made[:20], *of_row(*row)[:5])

    loop = trace_loop(step, (0.0, 0.0), (0.0,), (0.0, 0.0))
    ahead, _ = split_by_row(loop)
    assert ahead.logged > 3
    rows = np.random.default_rng(seed).normal(size=(6, 2))
    for one, other in zip(
        flown(loop, lanes, rows, False), flown(loop, lanes, rows, True), strict=True
    ):
        assert same_bits(one, other)
