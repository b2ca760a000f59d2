"""The predictive law in flights that change: a push that comes and goes, another belief, snapshots gone back to."""

from __future__ import annotations

import copy
import dataclasses
import tomllib
from importlib.resources import files

import numpy as np
import pytest

import skyarm
from flown import MODEL, cases
from skyarm.algebra import Vec3
from skyarm.control.catalogue import make_controller
from skyarm.control.laws.predictive.engine import Purpose, engine_for
from skyarm.scenario.scenario_record import Change

DT = 0.005
PUSH = (1.0, 0.1, -1.0, 0.0, 0.0)
TASK = tomllib.loads((files("skyarm.scenario") / "library/press_and_hold.toml").read_text())
PATH = {"kind": "phases", "position": [0.2, 0.0, 0.83], "phases": [{"kind": "hold", "duration": 20.0}]}
HOLD = {"tip": {**TASK["reference"]["tip"], "path": PATH}}


def held(duration, *changes):
    """A tip that waits before the wall of the shipped task, until something changes."""
    told = [{"at": at, "path": path, "value": value} for at, path, value in changes]
    more = {"controller": {"law": "nmpc"}, "reference": HOLD, "duration": duration, "changes": told}
    return skyarm.scenario_from(copy.deepcopy({**TASK, **more}))


def steps(controller, references, memory=None):
    """Memories and commands of a law that sees one measurement again and again."""
    memory, found, seen = memory or controller.memory, [], cases(1, seed=5)[0].measurement()
    for reference in references:
        memory, command = controller.law(memory, seen, reference, DT, par=controller.par)
        found.append((memory, command))
    return found


def free_and_pressing():
    free = cases(1, seed=5)[0].reference()
    return free, dataclasses.replace(free, push=PUSH)


def test_it_presses_as_wanted_where_the_push_comes_in_flight():
    log = skyarm.run(held(6.0, (0.5, "reference", TASK["reference"])))
    force = log.contact_force[:, 0]
    assert log.status == "completed"
    assert not force[log.time < 1.0].any()
    assert force[(log.time > 4.5) & (log.time < 6.0)] == pytest.approx(1.0, abs=0.02)


def test_a_push_that_comes_makes_another_engine_and_one_that_goes_is_forgotten():
    own, (free, pressing) = make_controller("nmpc", MODEL), free_and_pressing()
    (before, _), (came, _), (went, _) = steps(own, [free, pressing, free])
    assert before.engine.contact is None
    assert before.interaction is None
    assert came.engine.contact is not None
    assert came.interaction is not None
    # a plan of this period, not one that knows of no contact
    assert came.since == 1
    assert came.plan is not before.plan
    assert went.engine is before.engine
    assert went.interaction is None
    assert went.plan is not came.plan
    assert went.tip_force == Vec3(0.0, 0.0, 0.0)
    felt = dataclasses.replace(came, tip_force=Vec3(1.0, 2.0, 3.0))
    assert steps(own, [free], felt)[0][0].tip_force == Vec3(0.0, 0.0, 0.0)


@pytest.mark.parametrize("change", ["weights", "belief", "stages"])
def test_what_the_engine_was_made_for_is_what_the_law_is_told_now(change):
    free, _ = free_and_pressing()
    own = make_controller("nmpc", MODEL)
    vehicle = MODEL.vehicle
    heavier = dataclasses.replace(vehicle, base=dataclasses.replace(vehicle.base, mass=1.5 * vehicle.base.mass))
    other = {
        "weights": lambda: make_controller("nmpc", MODEL, weights=dataclasses.replace(own.par.weights, tool=5.0)),
        "belief": lambda: make_controller("nmpc", dataclasses.replace(MODEL, vehicle=heavier)),
        "stages": lambda: make_controller("nmpc", MODEL, stages=9),
    }[change]()
    ((before, _),) = steps(own, [free])
    ((after, _),) = steps(other, [free], before)
    assert after.engine is engine_for(other.par, DT)
    assert after.engine is not before.engine
    assert len(after.plan.u) == other.par.stages
    assert after.since == 1


def test_options_that_are_equal_keep_engine_and_plan():
    free, _ = free_and_pressing()
    one, twin = make_controller("nmpc", MODEL), make_controller("nmpc", MODEL)
    assert one.par is not twin.par
    ((before, _),) = steps(one, [free])
    ((after, _),) = steps(twin, [free], before)
    assert after.engine is before.engine
    assert after.plan is before.plan
    assert after.since == 2
    assert Purpose(one.par, DT, False).serves(Purpose(twin.par, DT, False))
    assert not Purpose(one.par, DT, False).serves(Purpose(one.par, 2.0 * DT, False))
    assert not Purpose(one.par, DT, False).serves(Purpose(one.par, DT, True))


def test_a_copied_memory_shares_the_engine_and_nothing_of_the_flight():
    free, pressing = free_and_pressing()
    own = make_controller("nmpc", MODEL)
    ((memory, _),) = steps(own, [pressing])
    other = copy.deepcopy(memory)
    assert other.engine is memory.engine
    assert other.purpose is memory.purpose
    assert other.plan is not memory.plan
    # what flies on with an engine leaves nothing in it
    steps(own, [free, pressing, pressing], memory)
    assert steps(own, [pressing] * 3, memory)[-1][1] == steps(own, [pressing] * 3, other)[-1][1]


def test_a_session_goes_back_to_a_snapshot_of_it():
    session = skyarm.Session(skyarm.load_scenario("case3_wind", controller="nmpc", duration=0.4))
    for _ in range(30):
        session.step()
    snapshot = session.snapshot()
    while session.step():
        pass
    first = session.log
    session.restore(snapshot)
    assert session.tick == 30
    while session.step():
        pass
    np.testing.assert_array_equal(session.log.position, first.position)
    np.testing.assert_array_equal(session.log.rotor_commands, first.rotor_commands)


def test_a_plant_that_changes_in_flight_leaves_the_law_its_memory():
    base = skyarm.load_scenario("case3", controller="nmpc", duration=0.3)
    mass = float(base.world.vehicle.base.mass)
    session = skyarm.Session(base)
    for _ in range(30):
        session.step()
    plan = session._engine._flat.memory.plan
    session.change({"plant.vehicle.base.mass": mass})
    assert session._engine._flat.memory.plan is not None
    np.testing.assert_array_equal(session._engine._flat.memory.plan.u, plan.u)
    while session.step():
        pass
    # the same mass again: the flight goes on to the bit
    np.testing.assert_array_equal(session.log.position, skyarm.run(base).position)
    change = Change(at=0.15, path="plant.vehicle.base.mass", value=1.2 * mass)
    heavier = skyarm.run(dataclasses.replace(base, changes=(change,)))
    assert heavier.status == "completed"
    assert heavier.position[-1, 2] < session.log.position[-1, 2] - 1e-4
