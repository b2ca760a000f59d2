"""Trials of the survive suite: blows, failing sensors, wrong and stiff plants, landings
and half turns of any vehicle.

The trials are in ``library/survive_trials.toml``, whose first lines say what its words
mean.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

from skyarm.log.metrics.shortfall import LARGEST_ERROR
from skyarm.records.immutable import immutable
from skyarm.records.leaves import parts
from skyarm.reference import Constant
from skyarm.scenario.controller_table import controller_by_name
from skyarm.scenario.scenario_record import Scenario, with_words
from skyarm.studies.compare.cell_flights import Document
from skyarm.studies.compare.faulty_sensors import FaultySensors
from skyarm.studies.compare.suite import library_rows
from skyarm.studies.trial.facts import PAPER, TrialSetting, setting_of
from skyarm.studies.trial.trial import Maker, Trial, with_entries

MODEL = "hummingbird_arm2"
"""Nominal model of the paper's vehicle; that of another vehicle is the vehicle."""

HEIGHT = 4.34
"""Height (m) of the base: skids are 1.19 m above the surfaces of the landing, which
goes down by 1.2 m, so that they meet them and rest there."""


def faulty_sensors(built: Scenario, setting: TrialSetting, value: float) -> Scenario:
    """Scenario whose sensors can fail, beside their noise."""
    return with_words(built, noise=FaultySensors(**parts(built.agent.noise)))


MADE: Mapping[str, Maker] = {"faulty_sensors": faulty_sensors}
"""Makers of trials that no entries of a file describe."""


@immutable
class SurviveTrial(Trial):
    """Trial of the survive suite, values from mild to hard.

    Attributes:
        group: name of the trials whose flights share a program. duration: s.
        each: numbers of each flight at a value, as of a trial.
        known: entries with which the law is made in place of the scenario's.
        near: largest mean tip error at the end of a flight that is not lost, m.
    """

    group: str
    duration: float
    arm: str = "bent"
    each: Sequence[Mapping[str, str]] = ({},)
    known: Document = field(default_factory=dict)
    near: float = LARGEST_ERROR

    makers = MADE

    def setting(self, vehicle: str, plant: str) -> TrialSetting:
        """Vehicle by name or file in a hover with its own model."""
        usual = setting_of(vehicle, self.duration, plant)
        high = replace(usual.hover.agent.reference, z=Constant(HEIGHT))
        document = {
            "name": self.group,
            "plant": {"vehicle": vehicle},
            # every flight replaces it by the law on trial
            "controller": {"law": "centroidal"},
            # a flight is judged by where it ends, not by how deep it falls before
            "environment": {"ground": False},
        }
        model = {"model": {"vehicle": MODEL}} if vehicle == PAPER else {}
        return replace(
            usual, document=document | model, hover=usual.hover.with_reference(high)
        )

    def under(self, setting: TrialSetting, law: str, value: float) -> Scenario:
        """Scenario that the flights at a value have in common, under a law.

        Raises:
            ControllerError: the law does not fit the vehicle.
        """
        # the law is made of what it may know, and flies what is there
        known = replace(self, entries=with_entries(self.entries, self.known))
        return self.scenario(setting, value).with_controller(
            controller_by_name(known.scenario(setting, value), law)
        )

    def flights(self, setting: TrialSetting, value: float) -> list[dict[str, float]]:
        """Numbers of the flights at a value: parameter path -> number."""
        return [
            replace(self, numbers=numbers).numbers_of(setting, value)
            for numbers in self.each
        ]


TRIALS: Mapping[str, SurviveTrial] = {
    trial["name"]: SurviveTrial(
        **{key: each for key, each in group.items() if key != "trials"} | trial
    )
    for group in library_rows("survive_trials")
    for trial in group["trials"]
}
"""Trials by name."""
