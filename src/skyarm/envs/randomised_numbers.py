"""Domain randomisation: scenario parameters that are drawn anew for every episode."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping

import numpy as np

from skyarm.algebra.scalars.philox import uniforms
from skyarm.records.arrays import Array
from skyarm.records.files import errors_as, shown
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.lane_numbers import (
    LaneRules,
    require_draws,
    require_paths,
    require_within_queue,
)
from skyarm.studies.sweep.design import FIRST_CHANNEL
from skyarm.studies.sweep.distributions import Distribution, Values, distribution_from
from skyarm.studies.sweep.expressions import (
    Expression,
    derived_from,
    is_own_name,
    with_derived,
)
from skyarm.studies.sweep.plan import fastest_plant

EDGE = 2.0**-53
"""Smallest uniform random number that is ever drawn; one minus it is the largest."""

MOST_CORNERS = 6
"""Number of paths up to which all combinations of their ends are evaluated; beyond, all
low, all high, and each end alone."""


@immutable
class Randomised:
    """Scenario parameters that are drawn for every episode, each with its distribution.

    Attributes:
        vary: path, or name of its own -> distribution. stiffest: the scenario that
            needs the shortest integration steps.
        derived: path -> its expression of what is drawn.
    """

    vary: Mapping[str, Distribution]
    stiffest: Scenario
    derived: Mapping[str, Expression]

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of the randomised parameters, such as plant.payload.mass, derived ones
        last.
        """
        return _paths((*self.vary, *self.derived))

    def draw(self, seeds: Array, episodes: Array) -> list[Array]:
        """Draw the randomised parameters of several episodes, one array per parameter.

        They are those of a sweep with this seed, whose ``[vary]`` has the same paths in
        the same order.
        """
        drawn = dict[str, Array]()
        for index, (name, distribution) in enumerate(self.vary.items()):
            unit = uniforms(seeds[:, None], episodes, FIRST_CHANNEL + index, 0, 1)[:, 0]
            drawn[name] = distribution.quantile(unit)
        values = with_derived(drawn, self.derived)
        return [values[path] for path in self.paths]


def _paths(names: Iterable[str]) -> tuple[str, ...]:
    """Paths among drawn and derived numbers; the others are names of their own."""
    return tuple(name for name in names if not is_own_name(name))


def read_randomised(
    scenario: Scenario,
    table: Mapping[str, Entry] | None,
    derived: Mapping[str, str] | None = None,
) -> Randomised:
    """Read the tables of randomised and derived parameters and check each over its
    whole range.

    Raises:
        ScenarioError: one line with path, value and what is allowed.
    """
    if table is not None and not isinstance(table, Mapping):
        raise ScenarioError(
            f"randomise = {shown(table)}: must be a table of paths, each with a"
            " distribution"
        )
    vary: dict[str, Distribution] = {}
    for path, given in (table or {}).items():
        if not isinstance(path, str):
            raise ScenarioError(
                f"randomise: path = {shown(path)}: must be text, as"
                " 'plant.payload.mass'"
            )
        with errors_as(ScenarioError):
            vary[path] = distribution_from(given, f'randomise."{path}"')
    with errors_as(ScenarioError):
        return _check(scenario, vary, derived_from(derived or {}, tuple(vary)))


def with_fixed(
    randomised: Randomised, scenario: Scenario, paths: Iterable[str]
) -> Randomised:
    """Randomised parameters plus further parameters that are constant and can be
    changed later.

    Raises:
        ScenarioError: no such path, or one that is drawn already.
    """
    vary = dict(randomised.vary)
    if isinstance(paths, (str, Mapping)) or not isinstance(paths, Iterable):
        raise ScenarioError(f"numbers = {shown(paths)}: must be a list of paths")
    for path in paths:
        if not isinstance(path, str) or path in vary:
            raise ScenarioError(
                f"numbers: path = {shown(path)}: must be text, and none that is named"
                " already"
            )
        with errors_as(ScenarioError, "numbers: "):
            vary[path] = Values((float(number_at(scenario, path)),))
    return _check(scenario, vary, randomised.derived)


def _check(
    scenario: Scenario,
    vary: Mapping[str, Distribution],
    derived: Mapping[str, Expression],
) -> Randomised:
    """Check that a scenario is valid over the ranges of its randomised parameters."""
    paths = _paths((*vary, *derived))
    with errors_as(ScenarioError, "randomise: "):
        require_paths(scenario, paths)
        require_draws(scenario, paths)
        drawn = {name: _ends(distribution) for name, distribution in vary.items()}
        every = with_derived(_corners(drawn), derived)
        corners = {path: every[path] for path in paths}
        require_within_queue(scenario, corners)
        # rules are checked where the numbers are largest, before lanes fly with them
        LaneRules(scenario, paths).require(corners)
        ends = {path: (float(x.min()), float(x.max())) for path, x in corners.items()}
        stiffest = fastest_plant(scenario, ends)
    return Randomised(vary=vary, stiffest=stiffest, derived=derived)


def _ends(distribution: Distribution) -> tuple[float, float]:
    """Least and greatest value of a distribution."""
    low, high = distribution.quantile(np.array([EDGE, 1.0 - EDGE])).tolist()
    values = getattr(distribution, "values", None)
    # a list has no order, so its quantiles' ends are not its least and greatest
    return (min(values), max(values)) if values else (low, high)


def _corners(ends: Mapping[str, tuple[float, float]]) -> dict[str, Array]:
    """Extreme combinations of the randomised parameters for validity checks, by
    parameter path.
    """
    if not ends:
        return {}
    if len(ends) <= MOST_CORNERS:
        rows = np.array([*itertools.product(*ends.values())])
    else:
        # all combinations grow as powers of two
        low, high = np.array([*ends.values()]).T
        alone = np.eye(len(ends), dtype=bool)
        # in this order since messages name the lane
        pairs = np.stack([np.where(alone, high, low), np.where(alone, low, high)], 1)
        rows = np.vstack([low, high, *pairs])
    return dict(zip(ends, rows.T, strict=True))
