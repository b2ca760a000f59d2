"""Termination conditions of a flight: evaluation in the loop, cause in words, and
statuses of a batch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from skyarm.algebra import Scalar, Vec3
from skyarm.algebra.scalars import logical_and
from skyarm.control.law_estimates import observed_push
from skyarm.dynamics import State
from skyarm.dynamics.state import example_state
from skyarm.records.arrays import AnyArray, Array
from skyarm.records.files.user_code import failure, require_result
from skyarm.records.immutable import positional
from skyarm.records.leaves import rebuild
from skyarm.records.path_names import word_of
from skyarm.reference.trajectory import failure_words
from skyarm.scenario.endings import BUILT_IN, PHASE_FAILED, Ending, not_finite
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop_state import Clock
from skyarm.simulate.pictures import Images, images_of

SLACK = 1e-5
"""Distance (m, rad or 1) inside a limit up to which a lane may be that machine code,
with other rounding, found outside. Chosen, far above rounding, and a hundred times it
passes the tests: only lanes that stopped are asked, and an ending that is met without
it comes first. With 0 such a lane has diverged."""


@positional
class Ended:
    """Early end of a flight: status, cause in words, time in s."""

    status: str
    cause: str
    time: float


RUNNING = "running"
"""Status in the log of a running episode."""


def running_status(scenario: Scenario, tick: int) -> Ended | None:
    """Early end with status "running" for the log of an unfinished flight; None once
    its duration is reached.
    """
    return (
        Ended(RUNNING, "", tick / scenario.rates.control)
        if tick < scenario.steps
        else None
    )


def endings_of(scenario: Scenario) -> tuple[Ending, ...]:
    """List all termination conditions of a scenario: the built-in ones, then the
    user's.
    """
    return (*BUILT_IN, *scenario.endings)


def healthy(
    scenario: Scenario, state: State, goal: Vec3, images: Images = ()
) -> Scalar:
    """True while no termination condition is met; a state with NaN meets one."""
    fine: Scalar = True
    for ending in endings_of(scenario):
        # without slack: these are the bits that decide
        fine = both_hold(fine, _is_fine(ending, scenario, state, goal, images))
    return fine


def _is_fine(
    ending: Ending, scenario: Scenario, state: State, goal: Vec3, images: Images
) -> Scalar:
    """True while a termination condition is not met, also by the pictures that it
    sees.
    """
    seen = {"images": images_of(ending.sees, images)} if ending.sees else {}
    return ending.fine(scenario, state, goal, 0, **seen)


def both_hold(a: Scalar, b: Scalar) -> Scalar:
    """Logical and of two conditions; a constant True is dropped."""
    if a is True:
        return b
    return a if b is True else logical_and(a, b)


def find_ending(
    scenario: Scenario,
    time: float,
    x: Sequence[float],
    goal: Sequence[float],
    images: Images = (),
) -> Ended | None:
    """First termination condition that a state meets, as status, cause and time; None
    if it meets none.
    """
    state = rebuild(example_state(*scenario.agent.vehicle.sizes), x)
    for ending in endings_of(scenario):
        # in the order of the loop: the first ending that is met names the flight's end
        if not _is_fine(ending, scenario, state, Vec3(*goal), images):
            try:
                cause = ending.cause(scenario, state, Vec3(*goal))
                require_result(ending.cause, cause, isinstance(cause, str), "a text")
            except Exception as error:  # a flight that has been flown is kept
                if ending in BUILT_IN:
                    raise
                cause = failure(error) or str(error)
            return Ended(ending.status, cause, time)
    return None


def failed_phase(scenario: Scenario, time: float, clock: Clock) -> Ended | None:
    """Early end of a flight because a mandatory phase of its task timed out, or
    None.
    """
    if not clock or float(clock.failed) < 0.5:
        return None
    # the clock has gone on to the next guard
    guard = scenario.agent.reference.guards[round(float(clock.guard)) - 1]
    words = failure_words(scenario.agent.reference, guard)
    if (
        guard.force is not None
        and not guard.sensed
        and observed_push(scenario.agent.controller.memory) is None
    ):
        words += f"; law {scenario.agent.controller.name} observes no force"
    return Ended(PHASE_FAILED, words, time)


def ending_of_command(
    scenario: Scenario, time: float, command: Sequence[float]
) -> Ended | None:
    """Early end of a flight because a commanded number is infinite or NaN, or None."""
    cause = not_finite(scenario.agent.vehicle, command)
    return None if cause is None else Ended("diverged", cause, time)


def columns_below(
    values: Mapping[str, Array], prefixes: tuple[str, ...]
) -> dict[str, Array]:
    """Varied numbers whose path begins with one of some prefixes, of any vehicle."""
    return {
        path: column
        for path, column in values.items()
        if word_of(path).startswith(prefixes)
    }


OF_CAUSES = ("plant.vehicle.", "endings.", "world.")
"""Prefixes of the paths of numbers that decide when an episode ends."""


class LaneEnd(NamedTuple):
    """One vehicle at the end of each flight of a batch.

    Attributes:
        state: last state of each lane, its scalars (lanes,).
        goals: (lanes, 3) position of the held reference at that time, m.
        failed: True where a phase of its task failed; None of a vehicle whose phases do
            not wait.
    """

    state: State
    goals: Array
    failed: AnyArray | None


def statuses(
    scenario: Scenario,
    values: Mapping[str, Array],
    ends: Sequence[LaneEnd],
    ended: Array,
) -> Array:
    """Termination status of each flight of a batch, from the final states of its
    vehicles.

    Args:
        scenario: scenario of the batch.
        values: path -> (lanes,), its varied numbers.
        ends: end of each vehicle.
        ended: True where the lane stopped before its time. A lane that flew to the end
            is looked at once more, as a single run does after its last step.
    """
    # limits, the places of rotors and joints, and the endings' own numbers are all that
    # the causes depend on
    numbers = columns_below(values, OF_CAUSES)
    lanes = len(ended)
    with np.errstate(all="ignore"):
        varied = with_numbers(scenario, numbers)
        every = endings_of(varied)
        names = np.array(
            ["completed", *(ending.status for ending in every), PHASE_FAILED]
        )
        # a command that is not finite leaves a sound state behind
        number = np.where(ended, 1, 0)
        for end in ends:
            if end.failed is not None:
                number = np.where(end.failed, len(names) - 1, number)
        # as in a single run, the first vehicle that meets an ending says which
        # later writing wins, so the last vehicle and its last ending come first
        each = [*zip(map(varied.of, varied.agents), ends, strict=True)][::-1]
        # with slack where a lane ended; an ending that is met exactly overwrites that
        for slack, asked in ((SLACK, ended), (0, np.ones(lanes, dtype=bool))):
            for (one, end), index in (
                product(each, range(len(every), 0, -1)) if asked.any() else ()
            ):
                fine = every[index - 1].fine(one, end.state, Vec3(*end.goals.T), slack)
                number = np.where(
                    asked & ~np.broadcast_to(np.asarray(fine), (lanes,)), index, number
                )
    return names[number]
