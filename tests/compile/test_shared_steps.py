"""A call of a kernel may be cut into slices of any length and left at any point: same
bits, nothing kept.
"""

from __future__ import annotations

import dataclasses
import weakref

import numpy as np
import pytest
from programs_random import oscillator, same_bits

from skyarm.compile.llvm import shared_steps
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.llvm.shared_steps import SharedSteps, slice_work
from skyarm.compile.tracing.program import trace_loop
from support.engines import interrupted_queue, wait_until

LANES, STEPS = 103, 60


def spring(lanes=4, **options):
    loop = trace_loop(oscillator, (0.0, 0.0), (0.0,), (0.0,), ((0, 2),))
    return Kernel(loop, Lanes(lanes, **options), logging=True)


def given(lanes=LANES, steps=STEPS):
    carry = np.vstack([np.linspace(0.1, 1.0, lanes), np.zeros(lanes)])
    return (
        carry,
        np.linspace(1.0, 30.0, lanes)[None],
        np.sin(np.arange(steps) / 7.0)[:, None],
    )


def fly(kernel, **options):
    return kernel.run(*given(), seed=9, start=5, every=7, **options)


@pytest.fixture
def cut(monkeypatch):
    """Set how many steps of a block a slice has; returns the numbers of calls of
    machine code.
    """

    def lengths(kernel, steps):
        monkeypatch.setattr(shared_steps, "SLICE", (steps + 0.5) * kernel.machine.pace)
        monkeypatch.setattr(shared_steps, "SHARED", 1e-12)
        calls, usual = [], kernel.machine.call
        call = lambda arguments: (calls.append(1), usual(arguments))  # noqa: E731
        monkeypatch.setattr(
            kernel, "machine", dataclasses.replace(kernel.machine, call=call)
        )
        return calls

    return lengths


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("options", [{}, {"single": True, "contract": True}])
def test_slices_of_any_length_have_the_bits_of_the_whole(cut, threads, options):
    """Slices that begin between the steps that are logged, and end with or without
    one.
    """
    for steps in (1, 2, 9, 59, 60, 200):
        kernel = spring(**options)
        whole = fly(kernel)
        calls = cut(kernel, steps)
        assert all(
            same_bits(a, b)
            for a, b in zip(fly(kernel, threads=threads), whole, strict=True)
        ), steps
        assert (
            len(calls) == 26 * -(-STEPS // steps)
            if steps < STEPS
            else 1 <= len(calls) <= 26
        ), steps


def test_slices_take_the_time_they_should():
    """However many lanes and steps there are, a slice of theirs is about as long."""
    for pace in (1e-8, 3e-6, 1e-4):
        for blocks, steps in ((1, 10**9), (2500, 4000), (2**15, 50), (1, 1), (128, 1)):
            for threads in (1, 2, 8):
                group, span = slice_work(blocks, steps, pace, threads)
                assert 1 <= group <= blocks
                assert 1 <= span <= steps
                assert group * span * pace <= max(shared_steps.SLICE, pace)
                if threads > 1 and blocks >= 64:
                    assert blocks / group >= 4 * threads


def test_slices_grow_where_steps_are_quicker_than_was_guessed(cut, monkeypatch):
    kernel = spring()
    whole, calls = fly(kernel), cut(kernel, 1)
    monkeypatch.setattr(shared_steps, "SLICE", 1.0)
    monkeypatch.setattr(
        kernel, "machine", dataclasses.replace(kernel.machine, pace=1.0)
    )
    assert all(same_bits(a, b) for a, b in zip(fly(kernel), whole, strict=True))
    # 1, 2, 4, 8, 16 and 29 steps of the first block, then all of the 25 others
    assert len(calls) == 6 + 25


@pytest.mark.parametrize("threads", [1, 3])
def test_an_interrupt_leaves_the_arrays_given_and_the_kernel_as_they_were(
    cut, monkeypatch, threads
):
    kernel = spring()
    whole, arrays = fly(kernel), given()
    before = [array.copy() for array in arrays]
    cut(kernel, 2)
    usual = kernel.machine.call
    for number in (1, 2, 30, 200):
        made = []

        def interrupted(arguments, made=made, number=number):
            made.append(1)
            usual(arguments)
            if threads == 1 and len(made) == number:
                raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr(
                kernel, "machine", dataclasses.replace(kernel.machine, call=interrupted)
            )
            if threads > 1:
                patch.setattr(shared_steps, "SimpleQueue", interrupted_queue())
            with pytest.raises(KeyboardInterrupt):
                kernel.run(*arrays, seed=9, start=5, every=7, threads=threads)
    assert all(map(np.array_equal, arrays, before))
    assert all(
        same_bits(a, b)
        for a, b in zip(fly(kernel, threads=threads), whole, strict=True)
    )


def test_threads_that_wait_keep_no_arrays(monkeypatch):
    monkeypatch.setattr(shared_steps, "SHARED", 1e-12)
    kernel, seen = spring(), []
    usual = SharedSteps.run

    def noted(self, *arguments, **options):
        seen.extend(weakref.ref(array) for array in self._arrays)
        usual(self, *arguments, **options)

    monkeypatch.setattr(SharedSteps, "run", noted)
    fly(kernel, threads=3)
    assert len(seen) == 5
    wait_until(lambda: all(one() is None for one in seen))
