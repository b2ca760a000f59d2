"""Stability margins in hover, also of many sets of gains at once, and along a flight;
Nyquist loci in hover.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from skyarm.records.arrays import Array, Complex, doubles
from skyarm.records.files import PathLike
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import Constant, Trajectory
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.scenario_file import as_scenario
from skyarm.scenario.scenario_record import Scenario, ScenarioError, with_words
from skyarm.simulate.batch_leg import Leg, LegOptions
from skyarm.simulate.engine import Engine, EpisodeCode
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop_state import LoopState
from skyarm.studies.stability.closed_loop import OpenLoop, close_loop, gains
from skyarm.studies.stability.disk_margins import LoopMargin, cut_loops
from skyarm.studies.stability.frozen_scenario import (
    LAGS,
    disturbances,
    nominal,
    without_adaptation,
)
from skyarm.studies.stability.margins import EDGE, LONGEST, Margins, delay_margin
from skyarm.studies.stability.margins import margins as margins_of_loop
from skyarm.studies.stability.open_loop import Differentiator, carry_of
from skyarm.world import NO_WIND

SETTLING = 5.0
"""Time (s) of hover before the linearisation; a whole number, and thus whole periods of
any rate."""


@immutable
class LinearisedInstant:
    """Stability margins of the loop linearised at one time of a flight, for rising and
    falling rotor speeds.

    Attributes:
        hover: True for the flight that only hovers. time: s.
        by_lag: margins with the rotors' time constant upward and with that downward.
        swings: s of further dead time from which on small swings grow, with the lag
            between both that a swing meets.
    """

    hover: bool
    time: float
    by_lag: dict[str, Margins]
    swings: float

    @property
    def delay(self) -> float:
        """Delay margin, s: the smaller one of the linearisations for rising and falling
        rotor speeds.
        """
        return min(each.delay for each in self.by_lag.values())

    @property
    def radius(self) -> float:
        """Spectral radius of the closed loop: the larger one for rising and falling
        rotor speeds.
        """
        return max(each.radius for each in self.by_lag.values())

    def gain(self, field: str) -> tuple[float, float]:
        """Gain margin (lower, upper) of all rotors or of all joints, the worst of the
        linearisations.
        """
        lows, highs = zip(
            *(getattr(each, field) for each in self.by_lag.values()), strict=True
        )
        # the factors that all of them stand
        return max(lows), min(highs)


def instant_at(
    open_loop: Callable[[str], OpenLoop],
    *,
    hover: bool,
    time: float,
    measured: bool = True,
) -> LinearisedInstant:
    """Compute the stability margins of the loop linearised at one time of a flight.

    Args:
        open_loop: the loop with the rotors' time constant upward, downward or between.
        hover: whether the flight only hovers.
        time: s.
        measured: cut the loop at the measurement too.
    """
    by_lag = {lag: margins_of_loop(open_loop(lag), measured=measured) for lag in LAGS}
    return LinearisedInstant(
        hover=hover, time=time, by_lag=by_lag, swings=delay_margin(open_loop("between"))
    )


@immutable
class Evidence:
    """Stability margins of one controller on one scenario, in hover and along the
    flight.

    Attributes:
        completed: False where the nominal flight ended early.
        left_out: fields of the disturbances without which the loop was flown and
            linearised.
    """

    controller: str
    scenario: str
    instants: tuple[LinearisedInstant, ...]
    completed: bool
    left_out: tuple[str, ...] = ()


def hovering(scenario: Scenario) -> Scenario:
    """Scenario that holds the initial reference in calm air without faults, long enough
    to settle.
    """
    start = scenario.agent.reference.at(0.0)
    x, y, z, yaw, *joints = (
        Constant(float(value)) for value in (*start.position, start.yaw, *start.joints)
    )
    return with_words(
        scenario.as_begun,
        duration=SETTLING,
        reference=Trajectory(x=x, y=y, z=z, yaw=yaw, joints=tuple(joints)),
        path_time=None,
        faults=(),
        initial=None,
        wind=NO_WIND,
        air=(),
        ground=False,
    )


def margins(
    scenario: Scenario | PathLike,
    instants: int = 4,
    progress: Callable[[int, int], object] | None = None,
) -> Evidence:
    """Stability margins of a scenario in hover and along its flight, as ``skyarm
    margins`` prints them.

    Args:
        scenario: or its name or path; on any plant, the rigid-body plant is linearised.
        instants: number of instants along the scenario, in addition to hover.
        progress: called with the number of finished instants and their total.

    Raises:
        ScenarioError: fewer than 0 instants, several vehicles, or the loop has a memory
            that its linearisation does not know.
    """
    return evidence(
        without_adaptation(as_scenario(scenario).alone("stability margins")),
        instants,
        progress,
    )


def evidence(
    scenario: Scenario,
    instants: int = 4,
    progress: Callable[[int, int], object] | None = None,
) -> Evidence:
    """Stability margins in hover and at ``instants`` equally spaced times of the
    scenario, the last at its end.

    Noise, disturbances that remember, as turbulence, and what is scheduled in flight
    are left out, on the rigid-body plant. Along a flight each instant is linearised as
    if time stood still: that every one is stable is no proof that the flight, which
    varies with time, is.

    Raises:
        ScenarioError: fewer than 0 instants.
    """
    if instants < 0:
        raise ScenarioError(f"instants = {instants}: must be at least 0")
    flights = [(True, hovering(nominal(scenario)), 1)]
    if instants:
        flights.append((False, nominal(scenario), instants))
    total = 1 + instants
    report = progress or (lambda *_: None)
    linearised: list[LinearisedInstant] = []
    report(0, total)
    for hover, flight, count in flights:
        for frozen in frozen_instants(flight, count):
            linearised.append(
                instant_at(frozen.open_loop, hover=hover, time=frozen.time)
            )
            report(len(linearised), total)
    return Evidence(
        controller=scenario.agent.controller.name,
        scenario=scenario.name,
        instants=tuple(linearised),
        completed=len(linearised) == total,
        left_out=disturbances(scenario),
    )


@immutable
class Frozen:
    """State of a closed-loop flight at one time, ready to be linearised.

    Attributes:
        time: s. differentiator: differentiator of the flight. carry: state of its loop.
        row: leaves of the inputs of the instant.
    """

    time: float
    differentiator: Differentiator
    carry: LoopState
    row: list[float]

    def open_loop(self, lag: str) -> OpenLoop:
        """Linearised open loop at this time, with the rotors' rising, falling or
        intermediate time constant.
        """
        return self.differentiator.at(self.carry, self.row, lag)


def frozen_instants(flight: Scenario, count: int) -> Iterator[Frozen]:
    """Iterate over ``count`` equally spaced times of a flight, with the state to
    linearise at each.
    """
    flight = flight.with_kind("rigid_body")
    # flown once: what compiles quickly is ready sooner
    engine = Engine(EpisodeCode(flight, commands=False, effort=0))
    inputs = engine.inputs
    differentiator = Differentiator(flight)
    for k in range(1, count + 1):
        # the instant is fed a row, so that the last one is that of the last period
        until = min(round(k * flight.steps / count), flight.steps - 1)
        while engine.tick < until:
            # the flight ended early: there are no later instants
            if not engine.fly(until):
                return
        now = carry_of(engine.first, leaves(engine.now))
        yield Frozen(
            time=float(inputs.times[until]),
            differentiator=differentiator,
            carry=now,
            row=leaves(inputs.rows_at(until, now)),
        )


def frozen_hover(scenario: Scenario) -> Frozen | None:
    """Settled hover of a scenario, ready to be linearised; None if the vehicle
    crashes.
    """
    return next(
        frozen_instants(hovering(nominal(without_adaptation(scenario))), 1), None
    )


POINTS = 500
"""Number of additional frequencies for a smooth curve."""


@positional(eq=False)
class Locus:
    """Nyquist locus of one control loop, with its disk margin.

    Attributes:
        margin: disk margin of the loop. L: open-loop response under negative feedback,
            by ascending frequency.
    """

    margin: LoopMargin
    L: Complex


def hover_loci(scenario: Scenario) -> list[Locus]:
    """Nyquist loci of a scenario in hover: the weakest loop of each kind; empty if the
    vehicle crashes.
    """
    hover = frozen_hover(scenario)
    return [] if hover is None else loci([hover.open_loop(lag) for lag in LAGS])


def loci(loops: Sequence[OpenLoop]) -> list[Locus]:
    """Nyquist loci of a loop, linearised with several lags: the weakest channel of each
    kind; empty if unstable.

    With T from what is added to a channel to the channel itself, closed, the loop under
    negative feedback is -T / (1 + T).
    """
    cuts = []
    for loop in loops:
        as_it_is = close_loop(loop)
        z = np.linalg.eigvals(as_it_is.matrix(gains(loop))).astype(complex)
        if np.abs(z).max(initial=0.0) > EDGE:
            return []
        cuts.append(cut_loops(loop, as_it_is, z, measured=True, stable=True))
    weakest: dict[tuple[str, str], Locus] = {}
    for name, port in (each for cut in cuts for each in cut.ports.items()):
        even = np.geomspace(port.frequencies[0], port.frequencies[-1], POINTS)
        every = port.response.at(np.union1d(port.frequencies, even))
        for i, margin in enumerate(port.alone(name, LONGEST, stable=True)):
            T = every[:, i, i]
            key = (name, margin.group)
            if key not in weakest or margin.disk < weakest[key].margin.disk:
                weakest[key] = Locus(margin, -T / (1.0 + T))
    return list(weakest.values())


SPEED = 1e3
"""Speed (m/s or rad/s) above which a hover has diverged."""


class SettledHover:
    """Stability margins of a scenario in settled hover, as a function of its
    parameters.

    What a law adapts slowly is held, as in all margins.

    Args:
        scenario: scenario whose hover is simulated first, with the same parameters.
        paths: paths of those numbers (:mod:`skyarm.scenario.numbers`), as
            ``controller.gains.position.x``.

    Raises:
        ScenarioError: the loop has a memory that its linearisation does not know.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str]) -> None:
        flight = hovering(nominal(without_adaptation(scenario)))
        flight = flight.with_kind("rigid_body")
        self._differentiator = Differentiator(flight, paths)
        options = LegOptions(paths=tuple(paths))
        self._leg = Leg(
            flight, stretches(flight)[0].overrides, range(flight.steps), options
        )
        inputs = episode_inputs(flight)
        self._row = inputs.rows[flight.steps - 1].tolist()
        self._time = float(self._row[0])

    def margins(self, sets: Array) -> list[LinearisedInstant | None]:
        """Stability margins for each parameter set, cut at the commands only; None if
        the hover of a set diverged.

        Args:
            sets: (sets, paths) numbers.
        """
        instants: list[LinearisedInstant | None] = []
        for settled, numbers in zip(self.settle(sets), sets.tolist(), strict=True):
            if settled is None:
                instants.append(None)
                continue
            loops = partial(self.open_loop, settled, numbers)
            instants.append(
                instant_at(loops, hover=True, time=self._time, measured=False)
            )
        return instants

    def settle(self, sets: Array, threads: int = 1) -> list[LoopState | None]:
        """Simulate hover for each parameter set (sets, paths); returns final simulation
        states, None where hover was not reached.
        """
        count = len(sets)
        parameters = self._leg.parameters(list(sets.T), count)
        carry = self._leg.begin(parameters, 0, np.zeros(count, dtype=int), None)
        # sets of gains that diverge overflow, and count as no hover
        with np.errstate(all="ignore"):
            carry, _ = self._leg.fly(carry, parameters, 0, np.arange(count), threads)
        settled = [rebuild(self._leg.first, column.tolist())[0] for column in carry.T]
        return [each if _is_hover(each) else None for each in settled]

    def open_loop(
        self, settled: LoopState, numbers: Sequence[float], lag: str
    ) -> OpenLoop:
        """Linearised open loop in the settled hover of one set of parameters."""
        return self._differentiator.at(settled, self._row, lag, numbers)


def _is_hover(settled: LoopState) -> bool:
    """True if a final simulation state is at rest and the flight did not end early."""
    if not settled.alive > 0.5:
        return False
    state = settled.agent.state
    moving = doubles([*state.velocity, *state.rate, *state.joint_rates])
    return bool(np.isfinite(moving).all() and np.abs(moving).max() < SPEED)
