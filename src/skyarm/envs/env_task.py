"""Learning task: a scenario with its actions, observations, rewards and randomised
parameters.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from skyarm.envs.action_kinds import ACTIONS, Actions
from skyarm.envs.observed_quantities import OBSERVED, USUAL, Observed
from skyarm.envs.randomised_numbers import Randomised, read_randomised
from skyarm.envs.reward_terms import REWARDS, USUAL_REWARD, RewardTerm
from skyarm.records.files import PathLike, must_be_one_of, shown
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.examine import require_shapes
from skyarm.simulate.lane_numbers import require_no_pictures, require_rigid_body

Info = dict[str, Any]
"""Information of a reset or a step next to its numbers, as in Gymnasium."""

Kind = TypeVar("Kind", Actions, Observed, RewardTerm)

PRECISIONS = ("single", "double", "bit_exact")


@immutable
class LearningTask:
    """Definition of a learning environment: scenario, actions, observation, reward and
    randomised parameters.

    Attributes:
        scenario: scenario to simulate; its law is evaluated only if the actions build
            on it.
        actions: kind of actions. observation, reward: their parts.
        randomised: numbers that are drawn anew for every episode.
        precision: "single", "double", or "bit_exact" (double without fused
            multiply-add).
    """

    scenario: Scenario
    actions: Actions
    observation: tuple[Observed, ...]
    reward: tuple[RewardTerm, ...]
    randomised: Randomised
    precision: str

    @property
    def setpoints(self) -> tuple[bool, ...]:
        """One flag per joint: True if a drive's setpoint commands it, False if a torque
        or force does.
        """
        return self.scenario.agent.commands_setpoints


def make_task(
    scenario: Scenario | PathLike,
    *,
    actions: Actions | str = "rotors_and_joints",
    observation: Iterable[Observed | str] = USUAL,
    reward: Iterable[RewardTerm | str] = USUAL_REWARD,
    randomise: Mapping[str, Entry] | None = None,
    derived: Mapping[str, str] | None = None,
    controller: str | None = None,
    duration: float | None = None,
    precision: str = "single",
) -> LearningTask:
    """Make a learning task from its arguments, after a check of every argument.

    Args:
        scenario: record, name or path of a file.
        actions: a record, or a name of :data:`skyarm.envs.action_kinds.ACTIONS`.
        observation: records, or names of
            :data:`skyarm.envs.observed_quantities.OBSERVED`.
        reward: records, or names of :data:`skyarm.envs.reward_terms.REWARDS`.
        randomise: path -> distribution, as ``[vary]`` of a study:
            ``{"plant.payload.mass": {"uniform": [0.0, 0.1]}}``.
        derived: path -> expression of what is drawn, as ``[derived]`` of a study, for
            numbers that change together.
        controller: law in place of the scenario file's.
        duration: duration in place of the scenario file's, s.
        precision: precision of all numbers, one of ``PRECISIONS``.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    flown = _scenario(scenario, controller, duration)
    if precision not in PRECISIONS:
        raise ScenarioError(
            f"precision = {shown(precision)}:"
            f" {must_be_one_of(dict.fromkeys(PRECISIONS), precision)}"
        )
    kind = _record_of("actions", actions, ACTIONS, Actions)
    seen = _several("observation", observation, OBSERVED, Observed, "quantity")
    # whose slower path a policy would meet in flight alone
    if flown.agent.path_time is not None:
        raise ScenarioError("reference.governor: must be left out of an environment")
    if kind.asks_law:
        flown.agent.controller.require_compiled(
            f"an environment with actions {type(kind).__name__}"
        )
    else:
        # a law that is not asked ends no episode where it is not defined
        flown = flown.with_controller(replace(flown.agent.controller, margin=None))
    require_shapes(flown)
    randomised = read_randomised(flown, randomise, derived)
    _require_sensors(flown, seen, randomised.paths)
    rewarded = _several("reward", reward, REWARDS, RewardTerm, "term")
    return LearningTask(
        scenario=flown,
        actions=kind,
        observation=seen,
        reward=rewarded,
        randomised=randomised,
        precision=precision,
    )


SHAPING = re.compile(
    r"^world\.mechanisms|\.(size|angles|vertices|collisions|joint\.(position|axis))\b"
    r"|\.shield\b"
)
"""Paths of numbers that change what a camera sees, but for poses."""

SHIELDED = re.compile(r"\.rotors\.[^.]+\.(position|axis)\b")
"""Paths that also do where a rotor has a shield."""


def _require_sensors(
    flown: Scenario, seen: Sequence[Observed], paths: Sequence[str]
) -> None:
    """Refuse pictures of sensors that are not there, or named as the vector of numbers,
    and endings that see.
    """
    there = sorted(flown.agent.cameras.keys() - {"state"})
    free = {*there}
    for name in (each.sees for each in seen if each.sees):
        if name not in free:
            allowed = f"a camera, each once, here of {', '.join(there) or 'none'}"
            raise ScenarioError(f"observation: sensor = {name!r}: must be {allowed}")
        free -= {name}
        shields = flown.agent.vehicle.shields
        for path in paths:
            if not (SHAPING.search(path) or (shields and SHIELDED.search(path))):
                continue
            raise ScenarioError(
                f"randomise: path = {path!r}: must not vary where {name!r} is observed,"
                " which sees the scenario's shapes; their positions may"
            )
    require_no_pictures(flown, "an environment")


def _scenario(
    given: Scenario | PathLike, controller: str | None, duration: float | None
) -> Scenario:
    """Load the scenario of a learning task and check that it can be simulated in
    batches.
    """
    if isinstance(given, Scenario):
        if controller is not None:
            raise ScenarioError(
                f"controller = {shown(controller)}: must be left out with a scenario"
                " that is a record"
            )
        flown = given if duration is None else replace(given, duration=duration)
    else:
        flown = load_scenario(given, controller=controller, duration=duration)
    # one vehicle: an environment has one action and one observation
    require_flight(flown.alone("an environment"))
    require_rigid_body(flown)
    if scheduled_changes(flown):
        raise ScenarioError(
            "changes: must be left out of an environment; randomise varies its numbers"
        )
    if flown.agent.reference.guards:
        raise ScenarioError(
            "reference: phases that wait (until) must be left out of an environment"
        )
    return flown


def _record_of(
    field: str,
    given: Kind | str,
    registered: Mapping[str, type[Kind]],
    kind: type[Kind],
) -> Kind:
    """Return an action, observation or reward record unchanged, or make one from its
    registered name.
    """
    if isinstance(given, kind):
        return given
    if isinstance(given, str) and given in registered:
        return registered[given]()
    raise ScenarioError(
        f"{field} = {shown(given)}: {must_be_one_of(registered, given)}, or a record"
        f" {kind.__name__}"
    )


def _several(
    field: str,
    given: Iterable[Kind | str],
    registered: Mapping[str, type[Kind]],
    kind: type[Kind],
    what: str,
) -> tuple[Kind, ...]:
    """Make a tuple of observation or reward records, at least one, from records and
    registered names.
    """
    if isinstance(given, (str, Mapping)) or not isinstance(given, Iterable):
        raise ScenarioError(
            f"{field} = {shown(given)}: must be a list of names or records"
            f" {kind.__name__}"
        )
    records = tuple(
        _record_of(f"{field}[{i}]", each, registered, kind)
        for i, each in enumerate(given)
    )
    if not records:
        raise ScenarioError(f"{field} = {shown(given)}: must have at least one {what}")
    return records


def require_open(call: str, *, closed: bool) -> None:
    """Raise an error if an environment is closed.

    Raises:
        ScenarioError: one line with the call.
    """
    if closed:
        raise ScenarioError(
            f"{call}: must come before close(); this environment is closed, make"
            " another"
        )


KEYS = 2**32
"""Number of keys of the noise; a larger seed is reduced modulo this number."""


def seed_of(seed: object, field: str = "seed") -> int:
    """Check that a seed is a nonnegative whole number, and reduce it to 32 bits.

    Raises:
        ScenarioError: it is none.
    """
    if (
        isinstance(seed, (bool, np.bool_))
        or not isinstance(seed, (int, np.integer))
        or seed < 0
    ):
        raise ScenarioError(
            f"{field} = {shown(seed)}: must be a whole number, at least 0"
        )
    # keys of the noise have 32 bits, seeds of Gymnasium any number
    return int(seed) % KEYS


def seeds_of(seed: int | Sequence[int | None] | None, lanes: int) -> list[int | None]:
    """Random seeds of all parallel episodes, from one seed or a list of seeds.

    Raises:
        ScenarioError: no such seed, or a list of another length.
    """
    if seed is None:
        return [None] * lanes
    if isinstance(seed, (list, tuple, np.ndarray)):
        if len(seed) != lanes:
            raise ScenarioError(
                f"seed: a list of {len(seed)}, must be one number, or one for each of"
                f" {lanes} lanes"
            )
        return [
            None if each is None else seed_of(each, f"seed[{k}]")
            for k, each in enumerate(seed)
        ]
    first = seed_of(seed)
    # behind the largest key the smallest one follows
    return [(first + k) % KEYS for k in range(lanes)]
