"""A process whose flights are interrupted: it says when it is ready, is sent a signal,
and tells what it found then.

Every line it prints is JSON. Used by test_signal_races.py, which sends the signals.
"""

from __future__ import annotations

import gc
import json
import signal
import sys
import time

import numpy as np

from skyarm.algebra.scalars import sin
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop

CARRY, LISTEN, TICKS = 16, 0.1, 0.01
"""Numbers that a step hands to the next; s in which threads that still fly give
themselves away; two ticks, s."""


class EndedError(BaseException):
    """SIGTERM came."""


def end(_number, _frame):
    raise EndedError


def chain():
    """Pendulums in a row, each driven by its neighbour and by noise."""

    def step(carry, parameters, row, draws):
        moved = []
        for k in range(0, CARRY, 2):
            angle, rate = carry[k], carry[k + 1]
            rate = rate - 0.01 * (
                parameters[0] * sin(angle)
                + 0.1 * (rate - carry[k - 1])
                - row[0]
                - draws[0]
            )
            moved += [angle + 0.01 * rate, rate]
        return tuple(moved), (moved[0], moved[-1])

    return trace_loop(step, (0.0,) * CARRY, (0.0,), (0.0,), ((0, 1),))


def say(**what):
    print(json.dumps(what), flush=True)


def others_work(seconds):
    """s of processor time that threads other than this one take in a while."""
    # the kernel books the time of other processors' threads at its ticks: what they
    # took before is booked by then
    time.sleep(TICKS)
    before, own = time.process_time(), time.thread_time()
    time.sleep(seconds)
    return (time.process_time() - before) - (time.thread_time() - own)


def main(seed, count, lanes, steps, listen, threads, endless):
    """Fly ``count`` times, never to the end if ``endless``; threads are drawn from 2 to
    8 where 0 is given.
    """
    signal.signal(signal.SIGTERM, end)
    # a shell ignores SIGINT in what it starts in the background, and Python leaves that
    # as it found it
    signal.signal(signal.SIGINT, signal.default_int_handler)
    rng = np.random.default_rng(seed)
    kernel = Kernel(chain(), Lanes(4), logging=True)
    carry, parameters = (
        rng.normal(size=(CARRY, lanes)),
        rng.uniform(1.0, 9.0, (1, lanes)),
    )
    rows = rng.normal(size=(steps, 1))
    given = [array.copy() for array in (carry, parameters, rows)]

    def fly():
        return kernel.run(
            carry,
            parameters,
            rows,
            seed=seed,
            threads=threads or int(rng.integers(2, 9)),
            every=every,
        )

    every = steps if endless else 20
    begun = time.monotonic()
    expected = None if endless else fly()
    say(seconds=time.monotonic() - begun)
    for number in range(count):
        inside, caught = True, 0.0
        try:
            say(ready=number)
            fly()
            inside = False
            time.sleep(600)
        except (KeyboardInterrupt, EndedError):
            caught = time.monotonic()
        later = [np.full((CARRY, lanes), 1.5) for _ in range(4)] + [
            np.full((-(-steps // every), 2, lanes), 1.5)
        ]
        work = others_work(LISTEN) if listen else 0.0
        changed = sum(not np.all(array == 1.5) for array in later)
        del later
        touched = not all(map(np.array_equal, (carry, parameters, rows), given))
        wrong = (
            not endless
            and number % 10 == 9
            and not all(map(np.array_equal, fly(), expected))
        )
        say(
            inside=inside,
            caught=caught,
            work=work,
            changed=changed,
            touched=touched,
            wrong=wrong,
        )
    gc.collect()
    say(done=True)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
