"""A check names every fault that is planted in a shipped vehicle, and none where there
is none.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from planted_faults import HEALTHY, PLANTED, Planted, document

from skyarm.studies.assess.assessment import Assessment, assess_vehicle
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import sampled

POSES = 8
"""Few: the corners of the joint ranges and the search find the worst pose of all these
arms."""


def checked(planted: Planted, name: str, folder: Path) -> Assessment:
    return assess_vehicle(planted.vehicle(name, folder), poses=POSES)


def assert_named(planted: Planted, name: str, folder: Path) -> None:
    found = checked(planted, name, folder).alarms()
    fields = [each.field for each in found]
    assert any(words in field for words in planted.fields for field in fields), (
        planted.kind,
        name,
        fields,
    )
    assert all(each.remedy for each in found)


def cases() -> list[tuple[Planted, str]]:
    """Two vehicles of each kind."""
    return [
        (planted, name)
        for planted in PLANTED
        for name in [
            *(n for n in planted.first if n in planted.vehicles),
            *planted.vehicles,
        ][:2]
    ]


@pytest.mark.parametrize(
    "place", [0, pytest.param(1, marks=pytest.mark.thorough)], ids=["first", "second"]
)
@pytest.mark.parametrize("planted", PLANTED, ids=lambda planted: planted.kind)
def test_every_kind_of_fault_is_named_in_two_vehicles(planted, place, tmp_path):
    names = [name for each, name in cases() if each is planted]
    assert len(set(names)) == 2
    assert_named(planted, names[place], tmp_path)


@pytest.mark.thorough
def test_drawn_mutations_are_named(tmp_path):
    rng = np.random.default_rng(20)
    for _ in range(4):
        planted = PLANTED[rng.integers(len(PLANTED))]
        assert_named(
            planted, planted.vehicles[rng.integers(len(planted.vehicles))], tmp_path
        )


@pytest.mark.parametrize("name", sampled(HEALTHY, 5))
def test_a_healthy_vehicle_raises_no_alarm(name):
    found = assess_vehicle(load_vehicle(name), poses=POSES)
    assert found.flies
    assert found.alarms() == []


@pytest.mark.parametrize("name", sampled(HEALTHY, len(HEALTHY)))
def test_with_all_poses_it_raises_none_either_and_takes_less_than_two_seconds(name):
    vehicle = load_vehicle(name)
    assess_vehicle(vehicle, poses=1)  # libraries load
    before = time.process_time()
    found = assess_vehicle(vehicle)
    assert time.process_time() - before < 2.0
    assert found.alarms() == []


def test_there_are_fifteen_of_them():
    assert len(HEALTHY) == 15
    assert document("pelican_arm2")["name"] == "pelican_arm2"


@pytest.mark.thorough
@pytest.mark.parametrize("planted", PLANTED, ids=lambda planted: planted.kind)
def test_every_kind_of_fault_is_named_in_every_vehicle(planted, tmp_path):
    for name in planted.vehicles:
        assert_named(planted, name, tmp_path)
