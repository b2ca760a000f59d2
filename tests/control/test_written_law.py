"""The page on the centroidal law is enough to write it again: what is written from it gives the law's commands."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import written_parts
from written_law import WrittenLaw
from written_vehicle import vehicle_of

import skyarm
from skyarm.records.leaves import rebuild
from skyarm.reference.preview import samples, samples_ahead
from skyarm.simulate.inputs import episode_inputs

LIBRARY = Path(skyarm.__file__).parent
NOISE = {"position": 1e-3, "velocity": 1e-2, "attitude": 2e-3, "rate": 1e-2, "joints": 1e-3, "joint_rates": 1e-2}
CLOSE = 1e-6


def scenario_of(case: str, *, start: float | None = None, duration: float, **tables: Any) -> skyarm.Scenario:
    """A shipped case under ``centroidal_tip``, its motion from ``start`` (s) on, with tables replaced."""
    file = tomllib.loads((LIBRARY / "scenario" / "library" / f"{case}.toml").read_text("utf-8"))
    motions = [file["reference"]["base"], *file["reference"]["joints"]]
    for motion in motions if start is not None else ():
        motion["start"] = start
    file |= {"controller": {"preset": "centroidal_tip"}, "duration": duration} | tables
    file.pop("windows")
    return skyarm.scenario_from(file)


def recorded(scenario: skyarm.Scenario) -> list[tuple[Any, Any, list[Any], Any, Any]]:
    """Of each period of a flight: measurement, reference, its samples to come, rotor speeds and efforts commanded."""
    log, inputs = skyarm.run(scenario), episode_inputs(scenario)
    assert log.status == "completed"
    seen = log.readings.get("state")
    names = ("position", "quaternion", "velocity", "rate", "joints", "joint_rates")
    rows = []
    for k, leaves in enumerate(np.array(inputs.held_leaves, dtype=float).reshape(scenario.steps, -1)):
        reference = rebuild(inputs.reference_example, iter(leaves.tolist()))
        ahead = [np.array(each, dtype=float) for each in samples_ahead(reference)]
        taken = {name: (getattr(log, name) if seen is None else seen[name])[k] for name in names}
        held = np.array(samples(reference), dtype=float)
        rows.append((SimpleNamespace(**taken), held, ahead, log.rotor_commands[k], log.efforts[k]))
    return rows


def written(scenario: skyarm.Scenario) -> WrittenLaw:
    """The law written from the page, for the model's file."""
    rates = scenario.rates
    vehicle = vehicle_of(LIBRARY / "vehicle" / "library" / "hummingbird_arm2.toml")
    return WrittenLaw(vehicle, 9.81, 1.0 / rates.control, 1.0 / rates.reference)


def differences(rows: list[Any], law: WrittenLaw) -> Any:
    """Largest relative difference in each period: of rotor speeds (of 1 rad/s at least), of efforts (of the limit)."""
    found = []
    for measurement, held, ahead, speeds, efforts in rows:
        own_speeds, own_efforts = law.step(measurement, held, ahead)
        off = (np.abs(own_speeds - speeds) / np.maximum(speeds, 1.0)).max()
        found.append(max(off, np.abs((own_efforts - efforts) / 0.5).max()))
    return np.array(found)


@pytest.fixture(scope="module")
def short() -> tuple[skyarm.Scenario, list[Any]]:
    """0.6 s of Case 3 in wind, whose circle begins with its step of 0.3 m at 0.2 s."""
    scenario = scenario_of("case3_wind", start=0.2, duration=0.6)
    return scenario, recorded(scenario)


def test_a_law_written_from_the_page_gives_the_commands_of_the_law(short: Any) -> None:
    scenario, rows = short
    assert differences(rows, written(scenario)).max() < CLOSE


def test_a_wrong_number_of_the_page_is_found(short: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario, rows = short
    monkeypatch.setattr(written_parts.NUMBERS, "shift_rate", 3.03)
    assert differences(rows[:60], written(scenario)).max() > CLOSE


UNUSED = {"arm_turn", "friction_adaptation", "low_thrust", "shift_limit", "tilt", "tip_mass_limit", "yaw_slack"}
"""Bounds that the short flight does not reach."""


@pytest.mark.thorough
@pytest.mark.parametrize("name", sorted(vars(written_parts.NUMBERS)))
def test_every_number_of_the_page_enters_the_commands(short: Any, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario, rows = short
    value = getattr(written_parts.NUMBERS, name)
    changed = tuple(1.01 * each for each in value) if isinstance(value, tuple) else 1.01 * value
    monkeypatch.setattr(written_parts.NUMBERS, name, changed)
    assert (differences(rows, written(scenario)).max() > CLOSE) == (name not in UNUSED)


@pytest.mark.thorough
@pytest.mark.parametrize("case", ["case3", "case3_wind"])
def test_it_does_over_the_whole_of_case_3(case: str) -> None:
    scenario = scenario_of(case, duration=30.0)
    found = differences(recorded(scenario), written(scenario))
    assert len(found) == 6000
    assert found.max() < CLOSE


@pytest.mark.thorough
def test_it_does_under_noise_with_commands_that_become_late() -> None:
    """20 ms from 3 s on: the lag is found, and rotors and joints are at their limits for some periods."""
    late = {"delays": {"longest_command": 0.02}, "changes": [{"at": 3.0, "path": "delays.command", "value": 0.02}]}
    scenario = scenario_of("case3", start=1.0, duration=6.0, sensors=NOISE, **late)
    assert differences(recorded(scenario), written(scenario)).max() < CLOSE
