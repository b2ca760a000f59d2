"""An envelope flown: a batch is a loop of flights, cells are kept, files are whole."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import skyarm
from skyarm.dynamics.array_front import frame_pose_world
from skyarm.scenario.numbers import with_numbers
from skyarm.studies.compare.envelope import Envelope, axis_flights
from skyarm.studies.compare.envelope_axes import AXES, PLANTS, TIP, VEHICLES, widen
from skyarm.studies.compare.perturbed_plants import Spread, draw
from skyarm.studies.compare.run_suite import fly_suite
from skyarm.studies.trial.facts import PAPER, setting_of
from skyarm.vehicle.vehicle_files import load_vehicle
from support.studies import cell_of

QUICK = Envelope(
    laws=("paper_pd", "paper_ct"),
    axes=("circle", "step", "measurement_delay"),
    quick=True,
)
FILES = ["envelope.json", "envelope.png", "flights.parquet", "report.html", "tables.md"]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A quick envelope and its folder."""
    folder = tmp_path_factory.mktemp("envelope")
    told = []
    return (
        fly_suite(QUICK, folder, progress=lambda *heard: told.append(heard[:2])),
        folder,
        told,
    )


def test_every_file_is_there_and_holds_what_was_flown(flown):
    found, folder, told = flown
    assert sorted(path.name for path in folder.iterdir() if path.is_file()) == FILES
    assert json.loads((folder / "envelope.json").read_text()) == found
    assert found["laws"] == ["paper_pd", "paper_ct"]
    assert list(found["axes"]) == ["circle", "step", "measurement_delay"]
    assert found["axes"]["measurement_delay"]["values"] == [0.0, 30.0]
    for axis in found["axes"].values():
        assert [len(points) for points in axis["laws"].values()] == [
            len(axis["values"])
        ] * 2
    # one cell a batch, one for each value where values are no data
    assert told[-1] == (8, 8)
    assert len(list((folder / "rows").iterdir())) == 8


def test_a_lane_is_the_flight_of_its_value_with_the_tip_of_a_level_base(flown):
    found, _, _ = flown
    axis, setting = AXES["circle"], QUICK.setting
    (planned_cell,) = axis_flights("paper_ct", QUICK.axis("circle"), setting)
    easiest = planned_cell.scenario()
    speed = planned_cell.points[-1]
    log = skyarm.run(with_numbers(easiest, axis.numbers_of(setting, speed)))
    vehicle = setting.truth
    level = np.zeros((len(log.time), 4))
    level[:, 0] = 1.0
    at = axis.scenario(setting, speed).reference.at(log.time)
    wanted = np.stack([np.broadcast_to(c, log.time.shape) for c in at.position], axis=1)
    joints = np.stack([np.broadcast_to(c, log.time.shape) for c in at.joints], axis=1)
    tip, _ = frame_pose_world(vehicle, log.position, log.quaternion, log.joints)
    goal, _ = frame_pose_world(vehicle, wanted, level, joints)
    error = np.linalg.norm(tip - goal, axis=1)[log.time >= 7.0]
    point = found["axes"]["circle"]["laws"]["paper_ct"][-1]
    assert point["tip_mean"] == pytest.approx(error.mean(), rel=1e-6)
    assert point["tip_max"] == pytest.approx(error.max(), rel=1e-6)
    assert point["tip_max"] > point["tip_mean"] > 0.3
    change = np.diff(log.rotor_commands, axis=0, prepend=log.rotor_commands[:1])[
        log.time >= 7.0
    ]
    assert point["jitter"] == pytest.approx(np.sqrt(np.mean(change**2)), rel=1e-6)
    sent = log.rotor_commands[log.time >= 7.0]
    assert point["limited"] == pytest.approx(
        ((sent <= 0.0) | (sent > 838.0 - 1e-6)).any(axis=1).mean(), abs=1e-9
    )


def test_an_overshoot_is_how_far_the_base_goes_beyond_the_step(flown):
    found, _, _ = flown
    (cell,) = axis_flights("paper_ct", QUICK.axis("step"), QUICK.setting)
    log = skyarm.run(with_numbers(cell.scenario(), {"reference.x.height": 3.0}))
    beyond = log.position[log.time > 1.0, 0].max() - 3.0
    assert found["axes"]["step"]["laws"]["paper_ct"][-1]["judged"] == pytest.approx(
        beyond, rel=1e-6
    )
    assert beyond > 0.0


def test_every_value_meets_the_same_noise():
    axis = dataclasses.replace(AXES["payload"], values=(0.0, 0.0, 0.2))
    (cell,) = axis_flights("paper_pd", axis, setting_of(PAPER, 5.0))
    lanes, alone = (
        cell_of(each).metrics["rotor_jitter"]
        for each in (cell, dataclasses.replace(cell, points=(0.0,)))
    )
    assert lanes[0] == lanes[1] == alone[0] != lanes[2]


def test_a_lane_of_wrong_plants_is_the_flight_of_one_and_values_meet_the_same_ones():
    (cell,) = axis_flights("paper_pd", AXES["wrong_plants"], setting_of(PAPER, 8.0))
    scenario = cell.scenario()
    values = cell.values(scenario)
    half, once = (
        draw(scenario, widen(Spread(), 0.5), PLANTS, seed=0),
        draw(scenario, Spread(), PLANTS, seed=0),
    )
    mass, delay = "plant.vehicle.links.1.body.mass", "delays.command"
    for path in values:
        assert np.array_equal(
            values[path][: 2 * PLANTS], np.concatenate([half[path], once[path]])
        ), path
    assert widen(Spread(), 0.5).thrust == (-0.05, 0.025)
    nominal = scenario.plant.vehicle.links[1].body.mass
    assert values[mass][:PLANTS] - nominal == pytest.approx(
        0.5 * (values[mass][PLANTS : 2 * PLANTS] - nominal)
    )
    few = dataclasses.replace(cell, points=(2.0,))
    assert np.array_equal(few.values(scenario)[mass], values[mass][-PLANTS:])
    flown = cell_of(few)
    assert flown.status.shape == (PLANTS,)
    numbers = {path: float(column[-1]) for path, column in few.values(scenario).items()}
    numbers[delay] = round(1e3 * numbers[delay]) * 1e-3
    log = skyarm.run(with_numbers(scenario, numbers))
    assert log.status == flown.status[-1]
    # a batch rounds the delay to its own step
    assert flown.metrics[TIP][-1] == pytest.approx(
        skyarm.score(log, [TIP], few.case.windows)[TIP], rel=1e-2
    )


def test_wrong_plants_of_another_vehicle_are_its_own_spread():
    (cell,) = axis_flights(
        "centroidal_tip", AXES["wrong_plants"], setting_of("hexarotor_arm6", 8.0)
    )
    scenario = cell.scenario()
    masses = cell.values(scenario)["plant.payload.mass"]
    weight = float(scenario.plant.vehicle.mass)
    assert 0.1 < masses.max() / (2.0 * 0.1 * weight / 0.806) <= 1.0
    assert masses[:PLANTS] == pytest.approx(0.25 * masses[-PLANTS:])


def test_values_seeds_and_vehicles_are_part_of_what_a_cell_is(flown):
    setting = setting_of(PAPER, 10.0)
    axis = QUICK.axis("circle")
    (one,) = axis_flights("paper_ct", axis, setting)
    (other,) = axis_flights(
        "paper_ct", dataclasses.replace(axis, values=(0.5, 2.0)), setting
    )
    (seeded,) = axis_flights("paper_ct", axis, setting, seed=1)
    (longer,) = axis_flights("paper_ct", axis, setting_of(PAPER, 12.0))
    assert len({each.work().key for each in (one, other, seeded, longer)}) == 4


def test_a_law_that_does_not_fit_a_vehicle_is_told_and_the_others_fly_on():
    asked = Envelope(
        laws=("paper_ct", "centroidal_tip"),
        axes=("circle",),
        vehicle="crazyflie_arm1",
        quick=True,
    )
    todo, refused = asked.plan_cells()
    assert {each.entrant.name for each in todo} == {"centroidal_tip"}
    assert "2 values, must be 1" in refused["paper_ct"]


def test_joints_with_servos_do_not_fly_the_lag_of_torques():
    asked = Envelope(vehicle="quadrotor_roll_arm2", quick=True)
    assert set(AXES) - set(asked.flyable_axes) == {"joint_lag", *VEHICLES}


def test_other_vehicles_fly_their_axes_with_gains_for_them():
    asked = Envelope(
        laws=("paper_ct", "centroidal_tip"), axes=("circle", *VEHICLES), quick=True
    )
    todo, refused = asked.plan_cells()
    assert refused == {}
    flown = {(each.case.name, each.entrant.name): each for each in todo}
    for vehicle in VEHICLES:
        tuned, own = flown[vehicle, "paper_ct"], flown[vehicle, "centroidal_tip"]
        assert tuned.entrant.law == "hybrid_computed_torque_tuned"
        assert (
            tuned.scenario().plant.vehicle
            == own.scenario().plant.vehicle
            == load_vehicle(vehicle)
        )
    assert flown["circle", "paper_ct"].entrant.law == "paper_ct"
    assert flown["circle", "paper_ct"].scenario().plant.vehicle == load_vehicle(PAPER)
    alone = dataclasses.replace(asked, vehicle="pelican_arm2", axes=VEHICLES)
    with pytest.raises(
        ValueError, match="--only: must name trials that the vehicle flies"
    ):
        fly_suite(alone, None)


@pytest.mark.thorough
def test_commands_that_become_late_are_on_time_before():
    """A lane is the flight with a change at 8 s; until then all lanes are the flight
    without delay, to the bit.
    """
    axis = dataclasses.replace(AXES["delay_in_flight"], values=(0.0, 0.02))
    (cell,) = axis_flights("paper_pd", axis, setting_of(PAPER, 8.3))
    scenario = cell.scenario()
    (path,) = cell.values(scenario)
    logs = [skyarm.run(with_numbers(scenario, {path: late})) for late in (0.0, 0.02)]
    early = logs[0].time < 8.0
    same = [
        np.array_equal(logs[0].position[at], logs[1].position[at])
        for at in (early, ~early)
    ]
    assert same == [True, False]
    for value, log in zip(cell_of(cell).metrics[TIP], logs, strict=True):
        assert value == pytest.approx(
            skyarm.score(log, [TIP], cell.case.windows)[TIP], rel=1e-6
        )


@pytest.mark.thorough
def test_in_processes_the_numbers_are_the_same(flown, tmp_path):
    found, _, _ = flown
    assert fly_suite(QUICK, tmp_path, workers=2) == found


@pytest.mark.thorough
@pytest.mark.parametrize(
    "vehicle", ["crazyflie_arm1", "hexarotor_arm6", "quadrotor_roll_arm2"]
)
def test_every_axis_flies_on_any_vehicle_with_an_arm(vehicle, tmp_path):
    envelope = Envelope(laws=("centroidal_tip",), vehicle=vehicle, quick=True)
    found = fly_suite(envelope, tmp_path, workers=2)
    assert list(found["axes"]) == list(envelope.flyable_axes)
    for name in ("circle", "vertical", "swing", "payload", "noise"):
        easiest, hardest = found["axes"][name]["laws"]["centroidal_tip"]
        assert not easiest["lost"], name
        # the Crazyflie's single joint swings at any of the frequencies with less than 1
        # mm at the tip
        assert (
            hardest["lost"]
            or hardest["judged"] > easiest["judged"]
            or easiest["judged"] < 1e-3
        ), name
