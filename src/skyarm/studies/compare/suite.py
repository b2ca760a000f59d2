"""Cases and conditions of the comparison: those of Barakou et al. 2026 and harder ones,
perfect to perturbed.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib import resources
from typing import Any

from skyarm.log.metrics.windows import Windows
from skyarm.records.files import Fields
from skyarm.records.immutable import immutable
from skyarm.records.read_table import record_from
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Delays, Scenario, with_words
from skyarm.studies.compare.perturbed_plants import Spread
from skyarm.studies.trial.trial import DELAY, NOISE
from skyarm.world import ForceWind

GROUND = False
"""Setting without a ground: the suite measures tracking, and a flight below z = 0
continues."""


def library_rows(name: str) -> Iterator[dict[str, Any]]:
    """Yield the tables of a TOML file shipped with the comparison, such as one per
    controller, with lists as tuples.
    """
    file = resources.files("skyarm.studies.compare") / "library" / f"{name}.toml"
    # a file has one array of tables, whatever its name
    (rows,) = tomllib.loads(file.read_text("utf-8")).values()
    for row in rows:
        yield {
            key: tuple(each) if isinstance(each, list) else each
            for key, each in row.items()
        }


@immutable
class Case:
    """Case of the comparison: a shipped scenario with its wind direction, unmodelled
    payload and metric windows.

    Attributes:
        name: short name. windows: windows of the metrics.
        title: one line, of the comparison. scenario: shipped scenario it starts from.
        wind: angle of its wind from the x axis about the vertical, rad.
        payload: point mass that the model of the controller lacks, kg.
    """

    name: str
    title: str = ""
    scenario: str = ""
    wind: float = 0.0
    payload: float = 0.0
    windows: Windows = Windows()

    def build(self) -> Scenario:
        """Scenario of the case with perfect sensors and a placeholder controller."""
        shipped = load_scenario(self.scenario)
        world = shipped.agent.plant
        if self.payload:
            world = replace(world, vehicle=world.vehicle.with_payload(self.payload))
        wind = turn_wind(force_wind(shipped), self.wind)
        return with_words(
            shipped, name=self.name, plant=world, wind=wind, ground=GROUND
        )


def force_wind(scenario: Scenario) -> ForceWind:
    """Wind of a scenario if it is modelled as a force, otherwise a wind of zero
    force.
    """
    return scenario.wind if isinstance(scenario.wind, ForceWind) else ForceWind()


def turn_wind(wind: ForceWind, angle: float) -> ForceWind:
    """Wind with its mean rotated about the vertical by an angle, and an unchanged
    gust.
    """
    # zeros that are whole numbers, and fold away in compiled code, stay so
    if not angle:
        return wind
    return replace(
        wind,
        force_W=wind.force_W.about_z(angle),
        air_velocity_W=wind.air_velocity_W.about_z(angle),
    )


CASES: Mapping[str, Case] = {
    row["name"]: Case(
        **row
        | {"windows": record_from(Windows, Fields(row.get("windows", {}), "windows"))}
    )
    for row in library_rows("paper_cases")
}
"""Cases by name, in the order of the tables."""

PAPER_CASES = ("case1", "case2", "case2_gust", "case3", "case3_wind")


@immutable
class Condition:
    """Condition of a comparison: sensor noise, delays and perturbed plants.

    Attributes:
        name: short name. title: one line. noisy: sensor noise and :data:`DELAY`;
            entrants use their gains for it.
        episodes: flights of each case. cases: names, of the comparison.
        spread: model mismatch of the plants; None for the unperturbed plant.
    """

    name: str
    title: str = ""
    noisy: bool = False
    episodes: int = 1
    cases: tuple[str, ...] = ()
    spread: Spread | None = None

    def apply(self, scenario: Scenario) -> Scenario:
        """Apply the sensor noise and the delays of a comparison's condition to the
        scenario of a case.
        """
        # a spread has a delay of its own, from none at all
        delays = Delays(measurement=DELAY if self.noisy and not self.spread else 0.0)
        if self.spread and self.spread.delay:
            delays = Delays(longest_command=self.spread.delay)
        return with_words(
            scenario, delays=delays, noise=NOISE if self.noisy else scenario.agent.noise
        )


def conditions(plants: int = 1000, seeds: int = 8) -> dict[str, Condition]:
    """All conditions of the comparison by name, from perfect state to noisy perturbed
    plants.

    Args:
        plants: perturbed plants.
        seeds: noisy flights of the truth.
    """
    # of 1000 plants a success rate of one half is known to 3 % (95 %)
    every = tuple(CASES)
    listed = (
        Condition(name="perfect", title="perfect state", cases=every),
        Condition(
            name="noisy",
            title="noise and one period of delay",
            noisy=True,
            episodes=seeds,
            cases=every,
        ),
        Condition(
            name="plants",
            title=(
                "perturbed plants, perfect state, delay 0 to 10 ms that nobody knows of"
            ),
            episodes=plants,
            cases=PAPER_CASES,
            spread=Spread(),
        ),
        Condition(
            name="plants_noisy",
            title="perturbed plants, noise, delay 0 to 10 ms",
            noisy=True,
            episodes=plants,
            cases=PAPER_CASES,
            spread=Spread(),
        ),
    )
    return {each.name: each for each in listed}
