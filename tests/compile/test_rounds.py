"""A call of a kernel may be cut in any way and left at any point: same bits, no thread at work, nothing kept."""

from __future__ import annotations

import dis
import gc
import sys
import weakref

import numpy as np
import pytest
from programs_random import oscillator, same_bits

from kernel_threads import serving, wait_until
from skyarm.compile.llvm import kernel as native
from skyarm.compile.llvm import rounds, thread_pool
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_rounds import PLACES
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.stepped_loop import trace_loop

LANES, STEPS = 103, 60
TINY = 1e-12


def spring(**options):
    loop = trace_loop(oscillator, (0.0, 0.0), (0.0,), (0.0,), ((0, 2),))
    return Kernel(loop, Lanes(4), logging=True, **options)


def given(lanes=LANES, steps=STEPS):
    carry = np.vstack([np.linspace(0.1, 1.0, lanes), np.zeros(lanes)])
    return carry, np.linspace(1.0, 30.0, lanes)[None], np.sin(np.arange(steps) / 7.0)[:, None]


def fly(kernel, **options):
    return kernel.run(*given(), seed=9, start=5, every=7, **options)


@pytest.fixture
def cut(monkeypatch):
    """Set how long slices and rounds are, s; returns the rounds that were begun."""
    begun = []
    usual = rounds.Rounds._round

    def counted(self):
        begun.append(self)
        usual(self)

    def lengths(slice_, round_):
        monkeypatch.setattr(rounds, "SLICE", slice_)
        monkeypatch.setattr(rounds, "ROUND", round_)
        monkeypatch.setattr(rounds, "FIRST", round_)
        monkeypatch.setattr(rounds, "SHARED", TINY)
        # the speed stays what is guessed here: lengths are whole numbers of steps
        monkeypatch.setattr(rounds.Pace, "measure", lambda *_: None)
        monkeypatch.setattr(rounds.Rounds, "_round", counted)
        begun.clear()
        return begun

    return lengths


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize(("steps", "slices"), [(1, 1), (1, 50), (2, 1), (9, 3), (10, 1000), (59, 1), (60, 1), (200, 2)])
def test_slices_of_any_length_have_the_bits_of_the_whole(cut, threads, steps, slices):
    """Slices that begin between the steps that are logged, and end with or without one."""
    kernel = spring()
    begun = cut(1e6, 1e6)
    whole = fly(kernel)
    assert len(begun) == 1
    begun = cut((steps + 0.5) * kernel.pace.clock, (steps + 0.5) * slices * kernel.pace.clock)
    assert all(same_bits(a, b) for a, b in zip(fly(kernel, threads=threads), whole, strict=True))
    if steps < STEPS:
        # 26 blocks, so many slices each, so many of them a round and thread; they may be somewhat shorter
        assert len(begun) >= 0.5 * 26 * -(-STEPS // steps) / (slices * threads)


def test_single_precision_is_cut_alike(cut):
    loop = trace_loop(oscillator, (0.0, 0.0), (0.0,), (0.0,), ((0, 2),))
    kernel = Kernel(loop, Lanes(8, single=True, contract=True), logging=True)
    cut(1e6, 1e6)
    whole = fly(kernel)
    cut(7.5 * kernel.pace.clock, 40 * kernel.pace.clock)
    for threads in (1, 3):
        assert all(same_bits(a, b) for a, b in zip(fly(kernel, threads=threads), whole, strict=True))


def test_slices_take_the_time_they_should():
    """However many lanes and steps there are, a slice of theirs is about as long."""
    for pace in (1e-8, 3e-6, 1e-4):
        for blocks, steps in ((1, 10**9), (2500, 4000), (2**15, 50), (1, 1), (128, 1)):
            for threads in (1, 2, 8):
                group, span = rounds.sliced(blocks, steps, pace, threads)
                assert 1 <= group <= blocks
                assert 1 <= span <= steps
                assert group * span * pace <= max(rounds.SLICE, pace)
                if threads > 1 and blocks >= 64:
                    assert blocks / group >= 4 * threads


def test_a_kernel_learns_its_speed_and_is_not_misled_by_one_measurement():
    pace = rounds.Pace(1e-6, 1e-6)
    pace.measure(2.0, 1.0, 50_000)
    assert (pace.clock, pace.processor) == pytest.approx((8e-6, 2e-5))
    pace.measure(2.0, 1.0, 100_000)
    assert (pace.clock, pace.processor) == pytest.approx((2e-5, 1e-5))
    # held up: rounds become shorter, slices do not
    pace.measure(1000.0, 1.0, 100_000)
    assert (pace.clock, pace.processor) == pytest.approx((1.6e-4, 1e-5))
    pace.measure(1.0, 1.0, 100_000)
    assert (pace.clock, pace.processor) == pytest.approx((2e-5, 1e-5))
    pace.measure(1.0, 1.0, 0)
    assert (pace.clock, pace.processor) == pytest.approx((2e-5, 1e-5))


def settle(kernels):
    """End all kernels' threads: none writes afterwards."""
    kernels.clear()
    gc.collect()
    wait_until(lambda: not serving())


def test_no_thread_is_at_work_when_a_round_is_left(cut, monkeypatch):
    """An interrupt right after each round: arrays that change later were left to somebody."""
    kernels = [spring()]
    arrays = given(lanes=64, steps=60_000)
    kernels[0].run(*arrays, every=1000)  # times the kernel
    cut(2e-3, 8e-3)
    left = []
    usual = rounds.Rounds._round

    def interrupted(self):
        usual(self)
        left.append([(array, array.copy()) for array in (*self._needs[0], self._reached)])
        raise KeyboardInterrupt

    monkeypatch.setattr(rounds.Rounds, "_round", interrupted)
    for _ in range(30):
        with pytest.raises(KeyboardInterrupt):
            kernels[0].run(*arrays, threads=4, every=1000)
    settle(kernels)
    assert any(np.any(each[-1][1] > 0) for each in left)
    for each in left:
        assert all(same_bits(now, then) for now, then in each)


class Interrupt:
    """Raises KeyboardInterrupt at the n-th instruction inside the kernel's files, and again some instructions later."""

    files = frozenset((native.__file__, rounds.__file__, thread_pool.__file__))
    # on its way into and out of a handler Python itself is never interrupted
    never = frozenset(dis.opmap.get(name) for name in ("PUSH_EXC_INFO", "POP_EXCEPT", "RERAISE", "COPY"))

    def __init__(self, *numbers):
        self.numbers, self.count = numbers, 0

    def __call__(self, frame, event, _argument):
        if frame.f_code.co_filename not in self.files:
            return None
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        if event == "opcode" and frame.f_code.co_code[frame.f_lasti] not in self.never:
            self.count += 1
            if self.count in self.numbers:
                raise KeyboardInterrupt
        return self


def raised_inside(kernel, arrays, *numbers, **options):
    """Whether a flight was interrupted at these of its instructions."""
    tracer, usual = Interrupt(*numbers), sys.gettrace()
    sys.settrace(tracer)
    try:
        kernel.run(*arrays, **options)
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(usual)
    return False


@pytest.mark.skipif(
    sys.version_info >= (3, 12), reason="from Python 3.12 on a tracer is told of instructions otherwise, or not at all"
)
@pytest.mark.parametrize("again", [0, 1, 7])
def test_an_interrupt_at_any_instruction_leaves_the_kernel_as_it_was(cut, monkeypatch, again):
    """Every instruction of a call that makes its threads, and of one that finds them there; a second one soon after."""
    kernel = spring()
    cut(1e6, 1e6)
    whole = fly(kernel)
    cut(40.5 * kernel.pace.clock, 400 * kernel.pace.clock)
    arrays = given()
    before = [array.copy() for array in arrays]
    options = {"seed": 9, "start": 5, "every": 7, "threads": 3}
    for fresh in (True, False):
        number, stride = 1, 1 if not again else 5
        while True:
            if fresh:
                monkeypatch.setattr(kernel, "pools", thread_pool.ThreadPools())
            numbers = (number, number + again) if again else (number,)
            if not raised_inside(kernel, arrays, *numbers, **options):
                break
            number += stride
            if number % 20 == 0:
                assert all(same_bits(a, b) for a, b in zip(fly(kernel, threads=3), whole, strict=True))
        assert number > 500
    assert all(map(np.array_equal, arrays, before))
    assert all(same_bits(a, b) for a, b in zip(fly(kernel, threads=3), whole, strict=True))


def test_who_may_still_help_holds_the_arrays_and_the_machine_code(monkeypatch):
    handed = []
    monkeypatch.setattr(rounds, "SHARED", TINY)
    monkeypatch.setattr(thread_pool.ThreadPool, "call", lambda _self, work, _count: handed.append(work))
    monkeypatch.setattr(rounds.Rounds, "_round", lambda _self: (_ for _ in ()).throw(KeyboardInterrupt))
    kernel = spring()
    held = [weakref.ref(kernel.engine)]
    with pytest.raises(KeyboardInterrupt) as raised:
        fly(kernel, threads=2)
    work = handed[0].__self__
    arrays = (*work._needs[0], work._reached)
    held += [weakref.ref(array) for array in arrays]
    # all that machine code is told of is held
    told = [work._control[PLACES[name] // 8] for name in ("carry", "parameters", "rows", "log", "keys", "reached")]
    assert told == [array.ctypes.data for array in arrays]
    # a round that was never begun, or is over, is left at once
    before = [array.copy() for array in arrays]
    handed[0]()
    assert all(same_bits(now, then) for now, then in zip(arrays, before, strict=True))
    del kernel, work, raised, arrays
    gc.collect()
    assert len(held) == 7
    assert all(one() is not None for one in held)
    handed.clear()
    gc.collect()
    assert all(one() is None for one in held)


def test_threads_that_wait_keep_no_arrays(monkeypatch):
    monkeypatch.setattr(rounds, "SHARED", TINY)
    kernel = spring()
    seen = []
    usual = rounds.Rounds._round

    def noted(self):
        seen.extend(weakref.ref(array) for array in self._needs[0])
        usual(self)

    monkeypatch.setattr(rounds.Rounds, "_round", noted)
    fly(kernel, threads=3)
    assert len(seen) == 5
    wait_until(lambda: all(one() is None for one in seen))
