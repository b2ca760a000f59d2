"""A law outside of the simulator commands what it commands inside."""

import dataclasses
import math

import numpy as np
import pytest

from skyarm import Session, load_scenario
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.links.outside.outside_law import LoopSettings, OutsideLaw
from skyarm.links.outside.rate_commands import IdealRateLoop
from skyarm.records.leaves import leaves, rebuild
from skyarm.simulate.inputs import episode_inputs

SETTINGS = LoopSettings(
    period=0.005, rate_loop=IdealRateLoop(bandwidth=(18.0, 18.0, 6.0)), full_thrust=20.0
)


def references(scenario):
    inputs = episode_inputs(scenario)
    return lambda k: rebuild(
        inputs.reference_example, iter(inputs.held_leaves[k].tolist())
    )


@pytest.mark.parametrize(
    "name", ["paper_ct", pytest.param("centroidal_tip", marks=pytest.mark.thorough)]
)
def test_the_same_controller_commands_the_same_as_in_the_simulator(name):
    """Fed with the measurements of a flight it gives that flight's commands."""
    scenario = load_scenario("case3", controller=name, duration=0.6)
    # the model is the plant, so that the modelled speeds of the rotors are the true
    # ones
    model = Model(vehicle=scenario.plant.vehicle, gravity=scenario.plant.gravity)
    par = dataclasses.replace(scenario.controller.par, model=model)
    scenario = dataclasses.replace(
        scenario, controller=dataclasses.replace(scenario.controller, par=par)
    )
    session, reference = Session(scenario), references(scenario)
    law = OutsideLaw(scenario.controller, SETTINGS, reference(0))
    for k in range(100):
        seen = session.measurement
        blind = dataclasses.replace(seen, rotor_speeds=(0.0,) * len(seen.rotor_speeds))
        found = law.step(blind, reference(k)).law
        session.step()
        row = session.log
        assert found.rotor_speeds == pytest.approx(
            row.rotor_commands[-1].tolist(), rel=1e-9
        ), k
        assert found.efforts == pytest.approx(
            row.efforts[-1].tolist(), rel=1e-7, abs=1e-9
        ), k


def test_floats_and_machine_code_agree():
    scenario = load_scenario("case3")
    plain = dataclasses.replace(scenario.controller, compiled=False)
    reference = references(scenario)
    laws = [
        OutsideLaw(each, SETTINGS, reference(0))
        for each in (scenario.controller, plain)
    ]
    rng = np.random.default_rng(1)
    session = Session(scenario)
    seen = session.measurement
    for k in range(20):
        moved = dataclasses.replace(
            seen,
            position=seen.position
            + type(seen.position)(*rng.normal(0, 0.1, 3).tolist()),
        )
        a, b = (leaves(law.step(moved, reference(k))) for law in laws)
        assert [*map(float, a)] == pytest.approx([*map(float, b)], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("compiled", [True, False])
def test_reset_returns_to_the_first_state(compiled):
    scenario = load_scenario("case3", controller="centroidal_tip")
    reference = references(scenario)
    law = OutsideLaw(
        dataclasses.replace(scenario.controller, compiled=compiled),
        SETTINGS,
        reference(0),
    )
    seen = Session(scenario).measurement
    first = leaves(law.step(seen, reference(1500)))
    for _ in range(5):
        last = leaves(law.step(seen, reference(1500)))
    assert last != first
    law.reset()
    assert leaves(law.step(seen, reference(1500))) == first


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("name", "needs"), [("indi", True), ("centroidal", False), ("paper_ct", False)]
)
def test_a_law_that_hovers_otherwise_without_an_accelerometer_needs_it(
    name, needs, compiled
):
    scenario = load_scenario("case3", controller=name)
    reference = references(scenario)(0)
    law = OutsideLaw(
        dataclasses.replace(scenario.controller, compiled=compiled), SETTINGS, reference
    )
    seen = Session(scenario).measurement
    first = leaves(law.step(seen, reference))
    assert law.needs_accelerometer(reference) == needs
    assert leaves(law.step(seen, reference)) == first  # the trial is forgotten


def no_number(memory, measurement, reference, dt, *, par):
    """Law that divides by the specific force."""
    share = measurement.specific_force.z / measurement.specific_force.z
    return memory, Command(
        rotor_speeds=tuple(share * w for w in measurement.rotor_speeds),
        efforts=(0.0, 0.0),
    )


def test_a_law_without_a_number_where_no_accelerometer_is_needs_it():
    scenario = load_scenario("case3")
    controller = dataclasses.replace(scenario.controller, law=no_number, memory=())
    reference = references(scenario)(0)
    assert OutsideLaw(controller, SETTINGS, reference).needs_accelerometer(reference)


def faster(memory, measurement, reference, dt, *, par):
    """Law that commands 10 rad/s more than it measures."""
    return memory, Command(
        rotor_speeds=tuple(w + 10.0 for w in measurement.rotor_speeds),
        efforts=(0.0, 0.0),
    )


@pytest.mark.parametrize("compiled", [True, False])
def test_a_law_measures_rotors_that_lag_behind_its_commands(compiled):
    scenario = load_scenario("case3")
    controller = dataclasses.replace(
        scenario.controller, law=faster, memory=(), compiled=compiled
    )
    law, seen = (
        OutsideLaw(controller, SETTINGS, references(scenario)(0)),
        Session(scenario).measurement,
    )
    rotor = controller.par.model.vehicle.rotors[0]
    share = 1.0 - math.exp(-SETTINGS.period / float(rotor.time_constant_up))
    speeds = [
        law.step(seen, references(scenario)(0)).law.rotor_speeds[0] for _ in range(4)
    ]
    assert np.diff(speeds) == pytest.approx([10.0 * share] * 3)
