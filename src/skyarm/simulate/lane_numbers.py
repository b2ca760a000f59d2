"""Argument checks of batches: counts, masks, and the parameter values of each
flight.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from skyarm.dynamics.actuators.drive import Drive
from skyarm.plant.largest_step import STATED, largest_stable_step
from skyarm.plant.surroundings import AnyComponent
from skyarm.records.arrays import Array, doubles
from skyarm.records.files import shown
from skyarm.records.leaves import Place, field_names, part, replace_at
from skyarm.records.path_names import agent_of, word_of
from skyarm.scenario.in_flight import measured_paths, require_changes
from skyarm.scenario.numbers import (
    is_same_load,
    number_at,
    require_apart,
    with_numbers,
)
from skyarm.scenario.paths import (
    LATE,
    alone,
    delay_words,
    is_below,
    places_of,
    prefix_of,
)
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.scenario_record import Scenario, ScenarioError, whole
from skyarm.simulate.draws import draws_needed


def require_count(field: str, value: object, least: int = 1) -> int:
    """Return ``value`` if it is a whole number of at least ``least``; else raise
    ScenarioError.

    Raises:
        ScenarioError: it is none, or less than ``least``.
    """
    number = whole(value)
    if number is None or number < least:
        raise ScenarioError(
            f"{field} = {shown(value)}: must be a whole number, at least {least}"
        )
    return number


def require_rigid_body(scenario: Scenario) -> None:
    """Refuse a scenario whose plant is not the rigid-body plant, the only one that
    batches compile.

    Raises:
        ScenarioError: one line.
    """
    if scenario.kind != "rigid_body":
        raise ScenarioError(
            f"plant.kind = {shown(scenario.kind)}: must be rigid_body for a batch"
        )


def require_compiled(scenario: Scenario) -> None:
    """Refuse control laws that a batch cannot compile, and endings that see pictures.

    Raises:
        ControllerError: one line about a law.
        ScenarioError: one line about an ending.
    """
    for agent in scenario.agents.values():
        agent.controller.require_compiled("a batch")
    require_no_pictures(scenario, "a batch")


def require_no_pictures(scenario: Scenario, what: str) -> None:
    """Refuse endings that see pictures, which the feature ``what`` has not.

    Raises:
        ScenarioError: one line.
    """
    for i, ending in enumerate(scenario.endings):
        if ending.sees:
            raise ScenarioError(
                f"endings[{i}]: sees {', '.join(ending.sees)}, {what} has no pictures;"
                " fly it by skyarm.run or a Session"
            )


def require_kind(field: str, value: object, kind: type) -> None:
    """Raise ScenarioError unless an argument is None or an instance of the given class.

    Raises:
        ScenarioError: something else.
    """
    if not isinstance(value, (kind, type(None))):
        raise ScenarioError(
            f"{field} = {shown(value)}: must be {kind.__name__} or None"
        )


def require_paths(scenario: Scenario, paths: object) -> tuple[str, ...]:
    """Check a list of distinct parameter paths, such as plant.gravity, and return it as
    a tuple.

    Raises:
        ScenarioError: one name alone, whose letters would be taken for names; no names;
            two names of one number; or the latency of a servo, as the code's queue has
            one length.
    """
    if (
        isinstance(paths, str)
        or not isinstance(paths, Collection)
        or not all(isinstance(path, str) for path in paths)
    ):
        raise ScenarioError(
            f"paths = {shown(paths)}: must be a list of paths of numbers, as"
            " 'plant.gravity'"
        )
    require_apart(scenario, tuple(paths))
    for path in paths:
        if word_of(path).startswith(("plant.", "model.")) and path.endswith(".latency"):
            words = (
                "says how many setpoints are on their way, the same for all episodes;"
                " fly one study for each"
            )
            raise ScenarioError(f"path = {path!r}: {words}")
    return tuple(paths)


def require_values(values: object) -> Mapping[str, ArrayLike]:
    """Return ``values`` if it maps parameter paths to values; else raise ScenarioError.

    Raises:
        ScenarioError: no mapping.
    """
    if not isinstance(values, Mapping):
        raise ScenarioError(
            f"values = {shown(values)}: must be a mapping of paths to the numbers of"
            " the lanes"
        )
    return values


def checked_array(
    field: str,
    given: object,
    shapes: Collection[tuple[int, ...]],
    allowed: str,
    kinds: str = "fiu",
) -> Array:
    """Convert an argument to an array; raise ScenarioError unless it has an allowed
    shape and NumPy kind.

    Raises:
        ScenarioError: any other value; ``allowed`` describes the allowed ones.
    """
    try:
        array = np.asarray(given)
    except (TypeError, ValueError):
        raise ScenarioError(f"{field} = {shown(given)}: must be an array") from None
    # of objects and texts the value says more than the shape
    if array.dtype.kind in "OSU":
        raise ScenarioError(f"{field} = {shown(given)}: must be {allowed}")
    if array.dtype.kind not in kinds or array.shape not in shapes:
        raise ScenarioError(
            f"{field}: {array.dtype} of shape {array.shape}, must be {allowed}"
        )
    return array


def lane_mask(mask: object, lanes: int) -> Array:
    """Boolean array (lanes,) that selects lanes of a batch; None selects all, integer
    indices are refused.
    """
    if mask is None:
        return np.ones(lanes, dtype=bool)
    return checked_array(
        "mask", mask, [(lanes,)], f"True or False for each of {lanes} lanes", "b"
    )


def lane_columns(
    scenario: Scenario,
    paths: Sequence[str],
    values: Mapping[str, ArrayLike],
    episodes: Array | None,
) -> tuple[list[Array], int]:
    """Check the parameter values of a batch; return one array per parameter path and
    the number of flights.

    Raises:
        ScenarioError: a path that is missing or not of this batch, columns of different
            lengths, or a delay beyond the longest.
    """
    if set(require_values(values)) != set(paths):
        odd = sorted(set(values) ^ set(paths))
        raise ScenarioError(
            f"values: {odd[0]!r} must be there exactly if it is a path of the batch"
        )
    count = np.size(values[paths[0]]) if paths else 1
    if episodes is not None:
        count = len(episodes)
    named = {
        path: checked_array(
            f"values[{path!r}]",
            values[path],
            [(count,)],
            f"one number for each of {count} lanes",
        )
        for path in paths
    }
    columns = [column.astype(float) for column in named.values()]
    require_within_queue(scenario, dict(zip(paths, columns, strict=True)))
    return columns, count


LONGEST = "delays.longest_command"


def require_within_queue(scenario: Scenario, columns: Mapping[str, Array]) -> None:
    """Refuse varied command delays that exceed the longest delay the command queue was
    made for.

    Args:
        scenario: scenario with the longest delay of its queue.
        columns: path -> numbers of the lanes; other paths than delays pass.

    Raises:
        ScenarioError: a delay below 0, or delays that together are beyond the longest;
            names the path.
    """
    for name, agent in scenario.agents.items():
        one = scenario.of(name)
        longest = agent.delays.longest_command
        named = {
            word_of(path): path
            for path in columns
            if agent_of(path) in ("", name) and columns[path].size
        }
        varied = [path for path in delay_words() if path in named]
        if longest is None or not varied:
            continue
        delays = {
            path: (
                columns[named[path]]
                if path in named
                else doubles([number_at(one, path)])
            )
            for path in delay_words()
        }
        for path, delay in delays.items():
            # both wait in one queue, one after the other
            late = delay if path == LATE else delays[LATE] + delay
            # in this form a NaN is refused, too
            if not (delay.min() >= 0.0 and late.max() <= longest):
                wrong = named[path if path in varied else varied[0]]
                what = "" if path == LATE else f" with {LATE}"
                raise ScenarioError(
                    f"values[{wrong!r}]: {path}{what} must be from 0 to {LONGEST} ="
                    f" {longest!r}"
                )


TRIAL_NOISE = 1e-3
"""Noise value allowed by every field, used in trials."""

REFUSALS = (ValueError, ArithmeticError)
"""Exceptions that records raise for numbers that they refuse."""


def require_draws(scenario: Scenario, paths: Sequence[str]) -> None:
    """Refuse varied noise levels that are 0 in the scenario, since no random numbers
    are reserved for them.

    Raises:
        ScenarioError: names the path.
    """
    drawn = draws_needed(scenario)
    for path in paths:
        if (
            word_of(path).startswith("sensors.")
            # any small number will do: whether noise is there decides, not its size
            and draws_needed(with_numbers(scenario, {path: TRIAL_NOISE})) != drawn
        ):
            raise ScenarioError(
                f"paths: {path}: is 0 in this scenario, and a batch draws no numbers"
                " for noise that is not there; give it a small one there"
            )


class LaneRules:
    """Check of a batch's parameter values by building the scenarios of the flights with
    extreme values.

    What lies between numbers that passed once is not looked at again: a batch flies
    many times.

    Args:
        scenario: scenario of the batch. paths: its varied numbers.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str]) -> None:
        self._scenario = scenario
        self._paths = tuple(paths)
        self._passed: dict[str, tuple[float, float]] = {}

    def require(self, values: Mapping[str, ArrayLike]) -> None:
        """Raise ScenarioError if parameter values make the scenario of a flight of the
        batch invalid.

        Args:
            values: path -> (lanes,) or one number for all; some of the paths, the
                others are the scenario's.

        Raises:
            ScenarioError: one line with path, value and what is allowed.
        """
        named = {path: doubles(values[path]) for path in self._paths if path in values}
        if not named or not all(column.size for column in named.values()):
            return
        table = np.array(np.broadcast_arrays(*named.values())).reshape(len(named), -1)
        # no number lies above or below it
        for lane, row in np.argwhere(np.isnan(table).T):
            raise ScenarioError(
                f"values[{list(named)[row]!r}] = nan (lane {lane}): must be a number"
            )
        least, most = table.argmin(axis=1), table.argmax(axis=1)
        looked_at: dict[int, None] = {}
        rows = [*zip(named, table, least, most, strict=True)]
        for path, row, first, last in rows:
            low, high = self._passed.get(path, (np.inf, -np.inf))
            looked_at |= {
                int(k): None for k in (first, last) if not low <= row[k] <= high
            }
        # a scenario is built for each, which takes milliseconds: extremes stand for all
        for k in looked_at:
            self._check_lane(dict(zip(named, table[:, k].tolist(), strict=True)), k)
        for path, row, first, last in rows:
            low, high = self._passed.get(path, (np.inf, -np.inf))
            self._passed[path] = (
                float(min(low, row[first])),
                float(max(high, row[last])),
            )

    def _check_lane(self, numbers: dict[str, float], lane: int) -> None:
        """Build and validate the scenario of one flight; raise ScenarioError with the
        invalid parameter value.
        """
        words = self._refusal(numbers)
        if words is None:
            return
        for path, value in numbers.items():
            # the number that is wrong by itself is named, else all together
            alone = self._refusal({path: value})
            if alone is not None:
                raise ScenarioError(
                    f"values[{path!r}] = {value:g} (lane {lane}): {alone}"
                )
        raise ScenarioError(f"values of lane {lane}: {words}")

    def _refusal(self, numbers: dict[str, float]) -> str | None:
        """Error message of a scenario with the given parameter values; None if they are
        valid.
        """
        try:
            made = with_numbers(self._scenario, numbers)
            require_changes(made)
        except REFUSALS as error:
            return " ".join(str(error).split())
        return None


LAWS = ("controller", "controller.law")
"""Parts that are built for the controller's model as it is."""


def require_apart_from_changes(scenario: Scenario, paths: Sequence[str]) -> None:
    """Refuse to vary parameters that the scenario's scheduled changes depend on.

    Raises:
        ScenarioError: names the path and the change.
    """
    for path in paths:
        for words in _refusals(scenario, path):
            raise ScenarioError(f"path = {path!r}: {words}")


class MeasuredLimitsWarning(UserWarning):
    """Warning about gains that vary in a batch while limits of the safety layer are
    measured on the law.
    """


def warn_of_measured_limits(scenario: Scenario, paths: Sequence[str]) -> None:
    """Warn where gains vary inside a safety layer whose limits are measured: all lanes
    have those of the scenario.
    """
    for name in scenario.agents:
        # one limit and one path are enough for a warning
        for limit in measured_paths(scenario, name)[:1]:
            inside = limit.rpartition(".limits.")[0] + ".inner"
            for path in [
                path
                for path in paths
                if is_below(_changed_path(scenario, path), inside)
            ][:1]:
                words = (
                    f"path = {path!r}: varies, while {limit} of all lanes is that of"
                    " the scenario's own law"
                )
                warnings.warn(
                    f"{words}; state controller.safety.stiffness and damping",
                    MeasuredLimitsWarning,
                    # the line of the user who made the batch
                    3,
                )


def _changed_path(scenario: Scenario, path: str) -> str:
    """Path that a change sets whose value varies; any other path as it is."""
    values = {
        f"changes.{i}.value": change.path for i, change in enumerate(scenario.changes)
    }
    return values.get(path, path)


def _refusals(scenario: Scenario, path: str) -> Iterator[str]:
    for name, agent in scenario.agents.items():
        for i, each in enumerate(agent.payloads):
            starts = {
                f"{prefix_of(scenario, name)}payloads.{of}" for of in (i, each.name)
            }
            if (
                each in agent.modelled_payloads
                and path.removesuffix(".pick").removesuffix(".drop") in starts
            ):
                words = (
                    "must not vary in a batch, whose flights change their models"
                    " together"
                )
                yield f"{words}; fly each by itself, or say believed = false"
    for i, change in enumerate(scheduled_changes(scenario)):
        where = f"changes[{i}].path = {change.path!r}"
        adds = is_same_load(scenario, path, change.path)
        if i >= len(scenario.changes):
            where = (
                f"{change.path!r}, which payloads set at {change.at:g} s (believed ="
                " true)"
            )
            if adds:
                yield f"adds to {where}; vary their mass"
            continue
        if path == f"changes.{i}.value" and word_of(change.path).startswith(STATED):
            yield (
                "must not vary, since a largest integration step may follow from"
                f" {where}"
            )
        if adds:
            yield (
                f"adds to {where}; vary changes.{i}.value, and set the payload of the"
                " start by a change at 0"
            )
        of_it = agent_of(path) in ("", agent_of(change.path))
        if (
            word_of(change.path) in LAWS
            and of_it
            and word_of(path).startswith("model.")
        ):
            yield f"must not vary, since the law of {where} is made for one belief"


def require_short_steps(
    scenario: Scenario, values: Mapping[str, ArrayLike], largest: float | None
) -> None:
    """Refuse parameter values for which the integration steps of the compiled code are
    too long.

    Every lane is looked at with all of its numbers: of stiffness and mass each may be
    within what others fly.

    Args:
        scenario: scenario of the batch.
        values: path -> (lanes,) or one number for all; all that differ from the
            scenario's.
        largest: longest step that the batch was compiled for, s; None for any.

    Raises:
        ScenarioError: names the paths and the values.
    """
    for (agent, place), fields in _paths_by_record(scenario, values).items():
        record = part(scenario.of(agent), place)
        columns = [
            np.ravel(each)
            for each in np.broadcast_arrays(
                *(np.asarray(values[path]) for path in fields)
            )
        ]
        shortest, stiffest = math.inf, dict[str, float]()
        # many lanes have the same numbers, of which one look is enough
        for numbers in np.unique(np.array(columns, dtype=float), axis=1).T.tolist():
            named = dict(zip(fields, numbers, strict=True))
            inside = {inner: named[path] for path in fields for inner in fields[path]}
            borne = _stable_step(record, inside, named, scenario.integrator == "euler")
            if borne is not None and borne < shortest:
                shortest, stiffest = borne, named
        # 1e-9: the same number may come out of another order of operations
        if stiffest and (largest is None or shortest < largest * (1.0 - 1e-9)):
            compiled = (
                "steps of any length"
                if largest is None
                else f"steps of up to {largest:g} s"
            )
            these = "this number" if len(stiffest) == 1 else "these numbers"
            raise ScenarioError(
                f"{_list_values(stiffest)}: requires steps of {shortest:g} s, and the"
                f" batch was compiled for {compiled}; compile it from a scenario with"
                f" {these}, or give it as stiffest"
            )


def _paths_by_record(
    scenario: Scenario, values: Mapping[str, ArrayLike]
) -> dict[tuple[str, Place], dict[str, list[Place]]]:
    """Group varied parameters by the air model, force or joint drive whose integration
    step they may limit.

    The key is a vehicle's name, and the place of the model or drive in the scenario of
    that vehicle's flight.
    """
    groups: dict[tuple[str, Place], dict[str, list[Place]]] = {}
    for path in values:
        one, word = alone(scenario, path)
        for place in places_of(one, word) if word.startswith(STATED) else ():
            # from the number outwards: the innermost record that limits steps
            heads = (place[:k] for k in range(len(place), 0, -1))
            head = next(
                (each for each in heads if _limits_step(type(part(one, each)))), None
            )
            if head is not None:
                (name,) = one.agents
                groups.setdefault((name, head), {}).setdefault(path, []).append(
                    place[len(head) :]
                )
    return groups


def _limits_step(kind: type) -> bool:
    """True if parameters of a class may limit the integration step."""
    return getattr(kind, "largest_step", None) is not None or "largest_step" in (
        field_names(kind) or ()
    )


def _stable_step(
    record: AnyComponent | Drive,
    numbers: Mapping[Place, float],
    named: Mapping[str, float],
    euler: bool,
) -> float | None:
    """Longest stable integration step (s) of an air model, force or drive with new
    parameters; None if unlimited.
    """
    try:
        other = replace_at(record, numbers)
        stated = largest_stable_step(other, euler=euler)
        if stated is None:
            return None
        # NaN is refused as well
        if not stated > 0.0:
            raise ValueError(f"largest_step = {shown(stated)}: must be above 0")
        return float(stated)
    except (ValueError, TypeError, ArithmeticError) as error:
        raise ScenarioError(f"{_list_values(named)}: {error}") from error


def _list_values(named: Mapping[str, float]) -> str:
    """Text for error messages that lists parameter paths with their values."""
    return ", ".join(f"values[{path!r}] = {value:g}" for path, value in named.items())
