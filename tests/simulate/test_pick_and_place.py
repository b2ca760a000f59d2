"""A payload picked up and put down along phases of the tip, from one file, on both
plants.
"""

import copy
import dataclasses
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.reference import Trajectory
from skyarm.reference.signals import Constant
from skyarm.reference.task_records import Guard
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.scenario_record import with_words
from skyarm.simulate.reference_clock import Waits
from skyarm.world import TimedPayload
from support.cases import sampled

FILE = Path(__file__).resolve().parents[2] / "examples" / "pick_and_place.toml"
DOCUMENT = tomllib.loads(FILE.read_text("utf-8"))


@pytest.mark.parametrize("kind", sampled(["rigid_body", "mujoco"], 2))
def test_three_hundred_grams_are_picked_at_8_s_and_placed_at_14_s(kind):
    # the rest of the flight, back to where nothing is held, is left out
    log = skyarm.run(skyarm.load_scenario(FILE, plant=kind, duration=15.0))
    assert log.status == "completed"
    error = np.linalg.norm(log.tip - log.tip_reference, axis=1)
    assert error.max() < 20e-3
    held = log.payload_mass[:, 0]
    for instant, place in ((8.0, [1.0, 0.2, 0.5]), (14.0, [0.6, -0.262, 0.5])):
        k = round(instant * 200)
        assert error[k - 1 : k + 1].max() < 5e-3
        np.testing.assert_allclose(log.tip[k], place, atol=5e-3)
        assert held[k + 2] != held[k - 2]
    assert set(held) == {0.0, 0.3}


STIFF = copy.deepcopy(DOCUMENT)
STIFF["reference"]["tip"]["base_share"] = 1.0  # nothing to plan


def changed(**phase):
    document = copy.deepcopy(STIFF)
    document["reference"]["tip"]["path"]["phases"][2] |= phase
    return document


def test_a_guard_moves_the_instants_of_payloads_and_what_the_law_is_told():
    vehicle = {"vehicle": "hummingbird_arm2_rotors"}
    phases = [
        {
            "kind": "go_to",
            "position": [0.2, 0.0, 0.7],
            "duration": 0.6,
            "until": {"error": 1e-12, "timeout": 0.5},
        },
        {
            "kind": "pick",
            "payload": "box",
            "position": [0.2, 0.0, 0.65],
            "approach": [0, 0, 0.05],
            "dwell": 0.4,
        },
    ]
    tip = {
        "posture": [0.4, -0.8],
        "path": {"kind": "phases", "position": [0.0, 0.0, 0.7], "phases": phases},
    }
    document = {
        "name": "w",
        "duration": 3.0,
        "plant": vehicle,
        "controller": {"preset": "paper_ct"},
    }
    document |= {
        "reference": {"tip": tip},
        "payloads": [{"name": "box", "mass": 0.02, "believed": True}],
    }
    planned = skyarm.scenario_from(document)
    log = skyarm.run(planned)
    (box,) = planned.payloads
    taken = log.time[np.flatnonzero(log.payload_mass[:, 0])[0]]
    assert taken == pytest.approx(box.pick + 0.5, abs=5e-3)
    # the law's belief follows: a law that was told at the planned instant, or never,
    # sends other commands
    assert not scheduled_changes(planned)
    assert box.believed
    for time, held in (
        (box.pick - 1e-3, 0.0),
        (box.pick, 0.02),
        (1.9, 0.02),
        (2.0, 0.0),
    ):
        told = Waits(
            dataclasses.replace(planned, payloads=(dataclasses.replace(box, drop=2.0),))
        )
        par = told.with_task_loads(planned.controller.par, time)
        assert (
            par.model.vehicle.mass - planned.controller.par.model.vehicle.mass
            == pytest.approx(held, abs=1e-12)
        )
    for other in (
        dataclasses.replace(box, believed=False),
        dataclasses.replace(box, mass=0.03),
    ):
        unlike = skyarm.run(dataclasses.replace(planned, payloads=(other,)))
        apart = np.abs(unlike.rotor_commands - log.rotor_commands).max(axis=1) > 1e-6
        assert log.time[np.flatnonzero(apart)[0]] == pytest.approx(taken, abs=6e-3)
    np.testing.assert_allclose(
        log.tip_reference[round(taken * 200)], [0.2, 0.0, 0.65], atol=1e-9
    )


def test_only_a_payload_of_the_task_is_told_by_the_task():
    box, bag = (TimedPayload(name=name, mass=0.1, pick=1.0) for name in ("box", "bag"))
    waiting = Trajectory(
        joints=(Constant(0.0),) * 2, guards=(Guard(at=1.0, error=0.1, loads=("box",)),)
    )
    believed = tuple(dataclasses.replace(each, believed=True) for each in (box, bag))
    planned = skyarm.load_scenario("case1")
    flown = with_words(planned, reference=waiting, payloads=believed)
    assert flown.agent.modelled_payloads == believed[1:]
    assert [each.believed for each in flown.as_begun.payloads] == [True, False]
    assert [(each.at, each.value) for each in scheduled_changes(flown)] == [(1.0, 0.1)]
    assert len(scheduled_changes(with_words(planned, payloads=believed[:1]))) == 1


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (
            changed(payload="bux"),
            (
                "reference.tip.path.phases[2].payload = 'bux': did you mean 'box'? must"
                " be the name"
            ),
        ),
        (
            STIFF | {"payloads": []},
            "reference.tip.path.phases[2].payload = 'box': must be the name of one of",
        ),
        (
            STIFF | {"payloads": [{"name": "box", "mass": 0.3, "pick": 1.0}]},
            (
                "payloads[0].pick = 1.0: must be left out, reference.tip.path.phases[2]"
                " says when"
            ),
        ),
        (STIFF | {"payloads": 3}, "payloads = 3: must be a list of tables"),
    ],
)
def test_a_payload_that_does_not_fit_gets_one_line(document, message):
    with pytest.raises(skyarm.ScenarioError) as caught:
        skyarm.scenario_from(document)
    assert str(caught.value).startswith(message)
