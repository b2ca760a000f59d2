"""Stability margins in hover for tuning: required margins, penalty for missing them,
measured margins.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from skyarm.compile.machine_code import missing_extra
from skyarm.records.arrays import Array
from skyarm.scenario.scenario_record import Scenario, with_words
from skyarm.simulate.loop_state import LoopState
from skyarm.studies.stability.closed_loop import OpenLoop, radius
from skyarm.studies.stability.flight_margins import LinearisedInstant, SettledHover
from skyarm.studies.stability.frozen_scenario import LAGS
from skyarm.studies.tune.front import LoopMargins, Required
from skyarm.studies.tune.law_knobs import GainKnob

try:
    from threadpoolctl import threadpool_limits
except (
    ImportError
) as error:  # pragma: no cover  (the library is there when this is tested)
    raise missing_extra("tune") from error

DELAY_SHARE, PERIODS = 1.5, 2
"""Required delay margin: this fraction of the law's nominal delay, and at least so many
control periods."""

GAIN = 1.5
"""Required gain margin of all rotors, and of all joints, up and down: 3.5 dB."""

FAILED = 2.0
"""Cost of a failed test, plus the excess of the spectral radius; equal to an error
seven times as large."""

STEEP, MOST = 100.0, 2.0
"""Cost per spectral radius above 1, and its upper bound."""

DIVERGED = 20.0
"""Cost of a hover that did not settle."""

RESERVE = 1.04
"""Factor on the required margins, so that a candidate that just passes also passes the
final measurement."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Context manager that limits BLAS to one thread, faster for the small matrices of
    a loop.
    """
    with threadpool_limits(1, user_api="blas"):
        yield


def required_margins(scenario: Scenario) -> Required:
    """Stability margins that a scenario's gains must have."""
    nominal = float(scenario.agent.delays.measurement) + float(
        scenario.agent.delays.command
    )
    return Required(
        delay=max(DELAY_SHARE * nominal, PERIODS / scenario.rates.control), gain=GAIN
    )


def calm(flight: Scenario) -> Scenario:
    """Tuning flight without the randomly drawn wind and without unmodelled delay."""
    delays = replace(flight.agent.delays, longest_command=None)
    return with_words(flight, delays=delays, forces=flight.forces[:-1])


def margins_of(hover: LinearisedInstant | None) -> LoopMargins:
    """Delay and gain margins of a linearised hover, for tuning; zero margins if the
    hover did not settle.
    """
    if hover is None:
        return LoopMargins(delay=0.0, rotors=(1.0, 1.0), joints=(1.0, 1.0))
    return LoopMargins(
        delay=hover.delay,
        rotors=hover.gain("rotor_gain"),
        joints=hover.gain("joint_gain"),
    )


class HoverMargins:
    """Evaluator of gain candidates' stability margins in hover; always met if the loop
    cannot be linearised.

    Args:
        scenario: flight of the candidates. knobs: their tunable gains.
        threads: results do not depend on it.
    """

    def __init__(
        self, scenario: Scenario, knobs: Sequence[GainKnob], threads: int = 1
    ) -> None:
        numbers = [(place, value) for knob in knobs for place, value in knob.numbers]
        self._numbers = np.array([value for _, value in numbers])
        self._knob = np.array([i for i, knob in enumerate(knobs) for _ in knob.numbers])
        self._loops: SettledHover | None = None
        self._why_none = ""
        self._threads = threads
        try:
            self._loops = SettledHover(
                calm(scenario),
                [f"controller.{'.'.join(place)}" for place, _ in numbers],
            )
        # gains of a loop that cannot be linearised are judged by their flights alone
        except ValueError as error:
            self._why_none = str(error)
        required = required_margins(scenario)
        step = 1.0 / scenario.rates.physics
        # delays of a linearised loop are whole physics steps
        # rounding of the quotient must not add a step
        self._delay = math.ceil(RESERVE * required.delay / step - 1e-9) * step
        self._gain = RESERVE * required.gain

    def _sets(self, logs: Array) -> Array:
        """Numbers of the law (candidates, numbers) with the factors of the gains."""
        sets: Array = (self._numbers[:, None] * np.exp(logs.T[self._knob])).T
        return sets

    def costs(self, logs: Array) -> Array:
        """Penalty (candidates,) of gain candidates for missing the required margins; 0
        if they are met.

        A test is cheap: the loop with the required extra delay, and with all rotors or
        all joints that much stronger or weaker, must have its eigenvalues inside the
        unit circle, with the rotors' time constant upward and downward.
        """
        loops = self._loops
        if loops is None:
            return np.zeros(len(logs))
        sets = self._sets(logs)

        def cost(settled: LoopState | None, numbers: Sequence[float]) -> float:
            if settled is None:
                return DIVERGED
            return max(
                failed_tests(
                    loops.open_loop(settled, numbers, lag), self._delay, self._gain
                )
                for lag in LAGS
            )

        with ThreadPoolExecutor(self._threads) as pool:
            settled = loops.settle(sets, self._threads)
            return np.array(list(pool.map(cost, settled, sets.tolist())))

    def measure(self, logs: Array) -> list[LoopMargins]:
        """Stability margins of each gain candidate in hover, the worse of those for
        rising and falling rotor speeds.
        """
        if self._loops is None:
            return [replace(margins_of(None), why_none=self._why_none)] * len(logs)
        return list(map(margins_of, self._loops.margins(self._sets(logs))))


def failed_tests(loop: OpenLoop, delay: float, gain: float) -> float:
    """Sum of penalties for the delay and gain margins that a linearised loop misses; 0
    if it misses none.

    ``delay`` is in s; ``gain`` is a factor above 1, whose inverse is tested as well.
    """
    tests = [{"extra_delay": delay}]
    tests += [
        {name: k} for name in ("rotor_gain", "joint_gain") for k in (gain, 1.0 / gain)
    ]
    total = 0.0
    for test in tests:
        beyond = radius(loop, **test) - 1.0
        # not ">": a radius that is no number fails
        if not beyond <= 0.0:
            # rounded: the last bits of an eigenvalue are the linear algebra's
            total += FAILED + round(min(STEEP * beyond, MOST), 6)
    return total
