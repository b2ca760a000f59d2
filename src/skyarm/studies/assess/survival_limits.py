"""Check by short flights: the largest blow, lateness of the commands and load in motion
that a law survives.

The scenario's vehicle hovers in calm air and swings slowly along x. Each number is cut
into sections, up to the first one in which a flight is lost; all flights are one batch.
Several vehicles that hold a body fly their own scenario.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.control.controller import ControllerError
from skyarm.log.metrics.shortfall import LARGEST_ERROR, TILTED
from skyarm.log.metrics.windows import LAST, Window, Windows
from skyarm.records.arrays import AnyArray, Mask
from skyarm.reference import Constant, Product, Ramp, Sine, Sum, Windowed
from skyarm.scenario.numbers import number_at
from skyarm.scenario.paths import LATE
from skyarm.scenario.scenario_record import Scenario, ScenarioError, with_words
from skyarm.simulate.loop import run
from skyarm.studies.assess.finding import FAULT, NOTE, OK, Finding
from skyarm.studies.flights import Work
from skyarm.studies.flights.fly import fly
from skyarm.studies.stability.flight_margins import hovering
from skyarm.world import NO_WIND, Disturbance, TimedPayload
from skyarm.world.signal_vector import SignalVector

QUESTION = "flight in calm air"

LAST_ERROR, LAST_TILT = "ee_error_last_mean_continuous", "tilt_rms"
"""Metrics: mean tip error and RMS tilt of the last seconds."""

START, DURATION = 3.0, 13.0
"""Time (s) at which the base is hit, or a load is taken; and duration (s) of a flight:
5 s later the last 5 s begin."""

NEAR = 0.05
"""Mean tip error (m) that a flight with a blow may have in its last seconds beyond that
of the flight without one."""

SWING = Product(
    Sine(amplitude=0.2, frequency_hz=0.25),
    Ramp(start=0.5, duration=2.0, height=1.0, shape="quintic"),
)
"""Motion of the base along x, m: at most 0.3 m/s and 0.5 m/s^2, so that the law moves
but is at no limit."""

LONGEST = 30.0
"""Time (s) for which several vehicles are flown together at most."""

FASTEST, LATEST, HEAVIEST = 5.0, 0.1, 0.5
"""Largest change of speed (m/s), lateness (s) and load (of the vehicle's mass) that are
flown: beyond any law's."""

KINDS = {
    "blow": ("N s", 1.0, "within a control period, in any of six directions"),
    "lateness": ("ms", 1e3, "of the commands, of which the law is not told"),
    "load in motion": ("kg", 1.0, "at the tip, of which the law is not told"),
}
"""What is flown -> its unit, factor from SI, and words."""

SECTIONS = 40
"""Number of sections into which each is cut: steps of 2.5 %, less than what laws differ
by."""


def lost(
    metrics: Mapping[str, AnyArray],
    completed: Mask,
    near: AnyArray | float = LARGEST_ERROR,
) -> Mask:
    """True for each flight that an ending ended, or that is tilted or away from its
    reference in its last seconds.

    Args:
        metrics: columns with the mean tip error and RMS tilt of the last seconds.
        completed: true for each flight that came to its end.
        near: largest mean tip error of a flight that is not lost, m; one or of each.
    """
    there = (metrics[LAST_ERROR] <= near) & (metrics[LAST_TILT] <= TILTED)
    gone: Mask = ~(completed & there)
    return gone


def survival_limits(scenario: Scenario) -> list[Finding]:
    """Check results for the largest blow, lateness and load in motion; a fault if calm
    air is not survived.

    Args:
        scenario: vehicle, law, sensors and delays, of one vehicle.
    """
    mass = float(scenario.agent.vehicle.mass)
    name = scenario.agent.controller.name
    most = {
        "blow": FASTEST * mass,
        "lateness": LATEST,
        "load in motion": HEAVIEST * mass,
    }
    try:
        limits = largest(scenario, most)
    except (ScenarioError, ControllerError, NoMachineCodeError) as error:
        return [Finding(QUESTION, NOTE, f"not known: {error}")]
    if not limits:
        text = f"{name} is lost while it swings slowly in calm air"
        return [
            Finding(QUESTION, FAULT, text, "controller", "another law or other gains")
        ]
    findings = list[Finding]()
    for kind, (unit, factor, words) in KINDS.items():
        value, end = factor * limits[kind], factor * most[kind]
        text = (
            f"{name} survives {value:.3g} {unit} {words}; {end:.3g} {unit} is the most"
            " that is flown"
        )
        findings.append(
            Finding(f"largest {kind}", NOTE, text, value=value, limit=end, unit=unit)
        )
    return findings


def flight_together(scenario: Scenario) -> list[Finding]:
    """Check result of several vehicles that hold a body, from their own flight in calm
    air: a fault if it is lost.

    Loops that are stable alone may shake each other through the body.
    """
    try:
        duration = min(scenario.duration, LONGEST)
        windows = Windows(last=LAST)
        log = run(
            with_words(
                scenario, duration=duration, windows=windows, wind=NO_WIND, air=()
            )
        )
    except (ScenarioError, ControllerError) as error:
        return [Finding(QUESTION, NOTE, f"not known: {error}")]
    missed = [] if log.status == "completed" else [str(log.info["cause"])]
    for name, own in log.agents.items():
        missed += [
            f"{name}: {each}"
            for each in own.shortfall.unreached
            # as in a flight of one vehicle, which is lost by its place
            if each.reference in ("position", "tip")
        ]
    if scenario.team:
        off = float(np.mean(log.team_position_error[log.time > log.time[-1] - LAST]))
        missed += [f"the body is {off:.3g} m off"] if off > LARGEST_ERROR else []
    if not missed:
        return [Finding(QUESTION, OK, f"they fly together for {log.time[-1]:.3g} s")]
    text = f"lost in calm air by {log.time[-1]:.3g} s: {missed[0]}"
    return [
        Finding(
            QUESTION,
            FAULT,
            text,
            "agents",
            "a lighter body, carrying = 0.85 or other gains",
        )
    ]


def largest(scenario: Scenario, most: Mapping[str, float]) -> dict[str, float]:
    """Largest value of each kind up to which all flights survive; empty if a flight
    with none of them is lost.

    Args:
        scenario: scenario of one vehicle.
        most: kind -> largest value that is flown: N s, s and kg.

    Raises:
        ScenarioError, ControllerError: no batch flies the scenario. NoMachineCodeError:
            no compiler.
    """
    flown = hit_while_swinging(scenario)
    rate = scenario.rates.control
    blow = f"environment.forces.{len(flown.environment.forces) - 1}.force"
    # an impulse within one period is that many times as large a force
    factors = [
        ("blow", f"{blow}.{axis}.value", sign * rate)
        for axis in "xyz"
        for sign in (1.0, -1.0)
    ]
    factors += [
        ("lateness", LATE, 1.0),
        ("load in motion", f"payloads.{len(scenario.agent.payloads)}.mass", 1.0),
    ]
    # the first flight has none of them
    count = 1 + len(factors) * SECTIONS
    steps = np.arange(1, SECTIONS + 1) / SECTIONS
    columns = {path: np.full(count, number_at(flown, path)) for _, path, _ in factors}
    for k, (kind, path, factor) in enumerate(factors):
        columns[path][1 + k * SECTIONS :][:SECTIONS] += factor * most[kind] * steps
    work = Work(
        label=QUESTION,
        scenario=flown,
        columns=columns,
        episodes=np.zeros(count, dtype=int),
        metrics=(LAST_ERROR, LAST_TILT),
        windows=Windows(steady=Window(DURATION - LAST, DURATION), last=LAST),
        seed=scenario.seed,
        # the code flies one batch of one check: it is made four times as fast, chosen
        effort=0,
    )
    rows = fly(work)
    # a blow may leave little more error than the calm flight has
    near = {"blow": rows[LAST_ERROR][0] + NEAR}
    most_off = np.repeat(
        [near.get(kind, LARGEST_ERROR) for kind, _, _ in factors], SECTIONS
    )
    calm, *gone = lost(
        rows, rows["status"] == "completed", np.append(LARGEST_ERROR, most_off)
    )
    if calm:
        return {}
    limits = dict(most)
    # the first lost section ends what is survived; of six directions the worst counts
    for (kind, _, _), flags in zip(
        factors, np.reshape(gone, (-1, SECTIONS)), strict=True
    ):
        survived = int(np.argmax([*flags, True])) / SECTIONS
        limits[kind] = min(limits[kind], most[kind] * survived)
    return limits


def hit_while_swinging(scenario: Scenario) -> Scenario:
    """Hover of a scenario, without its world, in which its base swings; blow, lateness
    and load are zero.
    """
    hover = hovering(scenario)
    x = Sum((hover.agent.reference.x, SWING))
    pulse = Windowed(Constant(0.0), START, START + scenario.rates.period)
    delays = hover.agent.delays
    return with_words(
        hover,
        duration=DURATION,
        world=None,  # the swing would end in its walls
        reference=replace(hover.agent.reference, x=x),
        forces=(
            *hover.environment.forces,
            Disturbance(force=SignalVector(x=pulse, y=pulse, z=pulse)),
        ),
        payloads=(*hover.agent.payloads, TimedPayload(mass=0.0, pick=START)),
        # the memory of commands must reach back as far as the latest that is flown
        delays=replace(delays, longest_command=delays.longest + LATEST),
    )
