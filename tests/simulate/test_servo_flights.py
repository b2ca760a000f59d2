"""Flights on servos: from files, on both plants and every engine, under torque laws."""

from __future__ import annotations

import dataclasses
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.control.actuator_layer import (
    ActuatorParameters,
    plain_model,
    with_actuators,
)
from skyarm.control.catalogue import LAWS, make_controller
from skyarm.control.controller import ControllerError
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.log.metrics.score import score
from skyarm.scenario.controller_table import under_law
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state
from skyarm.simulate import Delays, run
from skyarm.simulate.batch import Batch
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.session import Session
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import MountedDrive
from support.cases import sampled
from support.components import same_logs

DATA = Path(__file__).parents[1] / "data"
CASE = load_scenario("case3", duration=14.0)
OF_THE_PAPERS_VEHICLE = ("learned_compensator",)
"""Laws that refuse any other vehicle."""

IDEAL = PositionServo(stiffness=40.0, damping=0.5, inertia=2e-4)


@cache
def document() -> dict[str, Any]:
    return tomllib.loads((DATA / "servo_flight.toml").read_text())


def flight(**replaced: Any) -> Scenario:
    return scenario_from(document(), DATA, {"duration": 0.4, **replaced})


def on_servos(scenario: Scenario, drive: Any) -> Scenario:
    """Both joints of truth and belief on a drive."""
    mounted = tuple(
        MountedDrive(name=link.joint.name, drive=drive)
        for link in scenario.plant.vehicle.links
    )
    world = dataclasses.replace(
        scenario.plant,
        vehicle=dataclasses.replace(scenario.plant.vehicle, drives=mounted),
    )
    model = scenario.controller.par.model
    model = dataclasses.replace(
        model, vehicle=dataclasses.replace(model.vehicle, drives=mounted)
    )
    controller = with_actuators(scenario.controller, model, 0.005)
    return dataclasses.replace(scenario, plant=world, controller=controller)


def tip_error(scenario: Scenario) -> float:
    return score(run(scenario))["ee_error_mean"]


def test_a_vehicle_file_carries_its_servos():
    scenario = flight()
    assert [each.name for each in scenario.plant.vehicle.drives] == [
        "shoulder",
        "elbow",
    ]
    assert all(isinstance(drive, PositionServo) for drive in scenario.agent.all_drives)
    assert isinstance(scenario.controller.par, ActuatorParameters)
    log = run(scenario)
    assert log.status == "completed"
    assert np.abs(log.efforts[:, 0]).max() < 0.5, (
        "setpoints in rad, not torques of the 2 N m that hold the arm"
    )
    assert same_logs(log, run_in_python(scenario))


def test_both_plants_fly_the_same_servos():
    """By one integrator, with a servo without rounding, whose steps would come at other
    instants.
    """
    smooth = {
        f"plant.drives.{joint}.resolution": 0.0 for joint in ("shoulder", "elbow")
    }
    ours = dataclasses.replace(
        with_numbers(flight(duration=2.0), smooth), integrator="rk4_staged"
    )
    theirs = dataclasses.replace(ours, kind="mujoco")
    a, b = run(ours), run(theirs)
    assert np.ptp(a.joints[:, 0]) > 0.3
    np.testing.assert_allclose(a.joints, b.joints, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(a.position, b.position, rtol=0.0, atol=1e-6)


def test_numbers_of_a_carried_servo_vary_by_path_and_a_batch_is_a_loop():
    scenario = flight(duration=0.2)
    path = "plant.drives.shoulder.stiffness"
    assert (
        number_at(scenario, path)
        == number_at(scenario, "plant.vehicle.drives.shoulder.drive.stiffness")
        == 6.9
    )
    values = np.array([4.0, 6.9])
    found = (
        Batch(scenario, (path,), bit_exact=True)
        .fly({path: values})
        .metrics["ee_error_mean"]
    )
    singles = [
        score(run(with_numbers(scenario, {path: float(value)})))["ee_error_mean"]
        for value in values
    ]
    np.testing.assert_allclose(found, singles, rtol=1e-12)
    assert abs(singles[0] - singles[1]) > 1e-6


@pytest.mark.thorough
def test_a_torque_law_loses_little_on_well_damped_servos():
    """Tip error of the centroidal law on Case 3, which the plain torque joints fly at
    1.5 mm.
    """
    centroidal = under_law(CASE, "centroidal_tip")
    plain = tip_error(centroidal)
    servo = tip_error(on_servos(centroidal, IDEAL))
    assert servo < 1.1 * plain
    held = tip_error(on_servos(centroidal, dataclasses.replace(IDEAL, latency=0.004)))
    assert held < 1.3 * plain, "the belief follows the latency"


def test_the_layer_stays_when_the_law_changes():
    changed = under_law(flight(), "paper_ct")
    assert isinstance(changed.controller.par, ActuatorParameters)
    assert changed.controller.name == "paper_ct" or "hybrid" in changed.controller.name
    with pytest.raises(
        ControllerError, match=r"^servos = true: law .* has its actuators already$"
    ):
        with_actuators(changed.controller, changed.controller.par.model, 0.005)
    bare = load_vehicle("hummingbird_arm2_rotors")
    model = dataclasses.replace(changed.controller.par.model, vehicle=bare)
    with pytest.raises(
        ControllerError, match=r"^servos = true: the nominal vehicle must have drives"
    ):
        with_actuators(make_controller("decoupled_pd", model), model, 0.005)


def on_torques(law: str) -> Scenario:
    """The same arm without servos."""
    tables = document() | {"controller": {"law": law, "servos": False}}
    found = scenario_from(tables, DATA, {"duration": 0.5})
    bare = dataclasses.replace(found.plant.vehicle, drives=())
    return dataclasses.replace(
        found, plant=dataclasses.replace(found.plant, vehicle=bare)
    )


@pytest.mark.filterwarnings("ignore:.*flies .* with its defaults")
@pytest.mark.parametrize("law", sampled(tuple(LAWS), 40, keep=("centroidal", "indi")))
def test_every_law_flies_servo_joints_nearly_as_torque_joints(law):
    if law in OF_THE_PAPERS_VEHICLE:
        plain = under_law(load_scenario("case3", duration=0.5), law)
        servo, torque = run(on_servos(plain, IDEAL)), run(plain)
    else:
        servo, torque = run(under_law(flight(duration=0.5), law)), run(on_torques(law))
    assert servo.status == torque.status == "completed"

    def worst(log: Any) -> float:
        return float(np.abs(log.joints - log.joints_reference).max())

    assert worst(servo) < worst(torque) + 0.05


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            'kind = "position"',
            r"drives\.elbow\.kind = 'position': did you mean 'position_servo'\?",
        ),
        ("stiffness = -1.0", r"drives\.elbow\.stiffness = -1\.0: must be "),
        ("stiff = 1.0", r"drives\.elbow\.stiff = 1\.0: "),
    ],
)
def test_a_wrong_servo_is_one_line_with_file_and_field(tmp_path, change, words):
    text = (DATA / "servo_arm.toml").read_text().split("[drives.elbow]")
    field = change.split(" ", maxsplit=1)[0]
    table = (
        text[1].replace('kind = "position_servo"', change)
        if field == "kind"
        else text[1]
    )
    table = table.replace("stiffness = 6.9", change) if field == "stiffness" else table
    table = (
        table.replace("gear = 257.4", f"gear = 257.4\n{change}")
        if field == "stiff"
        else table
    )
    (tmp_path / "v.toml").write_text("[drives.elbow]".join((text[0], table)))
    with pytest.raises(VehicleError, match=words) as found:
        load_vehicle(tmp_path / "v.toml")
    assert "\n" not in str(found.value)


def test_a_drive_of_no_joint_of_the_vehicle_is_refused(tmp_path):
    text = (
        (DATA / "servo_arm.toml")
        .read_text()
        .replace("[drives.elbow]", "[drives.wrist]")
    )
    (tmp_path / "v.toml").write_text(text)
    with pytest.raises(
        VehicleError, match=r"drives = 'wrist': must be one of shoulder, elbow, once"
    ):
        load_vehicle(tmp_path / "v.toml")


def test_the_layer_knows_the_believed_servo_only():
    """Another true servo leaves the first command as it is; another believed one, half
    as stiff, bends twice as far.
    """
    scenario = dataclasses.replace(flight(duration=0.05), ground=False)
    out = dataclasses.replace(
        scenario, initial=dataclasses.replace(first_state(scenario), joints=(0.6, -0.4))
    )
    first = run(out).efforts[0]
    true = run(with_numbers(out, {"plant.drives.shoulder.stiffness": 3.45})).efforts[0]
    believed = run(
        with_numbers(out, {"model.vehicle.drives.shoulder.drive.stiffness": 3.45})
    ).efforts[0]
    np.testing.assert_array_equal(true, first)
    assert believed[1] == first[1]
    # what is left of the position is the prediction of a few milliseconds
    assert believed[0] - 0.6 == pytest.approx(2.0 * (first[0] - 0.6), rel=0.05)


def test_a_believed_integral_is_taken_off_again():
    """A servo with an integral gives the law's torque, too, as long as the belief
    follows it.
    """
    centroidal = under_law(CASE, "centroidal_tip")
    lasting = dataclasses.replace(IDEAL, stiffness=10.0, damping=0.3)
    plain = tip_error(on_servos(centroidal, lasting))
    integrating = tip_error(
        on_servos(centroidal, dataclasses.replace(lasting, integral=100.0))
    )
    assert integrating == pytest.approx(plain, rel=0.1)


def test_a_belief_without_the_servos_must_be_meant(tmp_path):
    """Torques would reach them as angles."""
    text = (DATA / "servo_arm.toml").read_text()
    bare = text.split("[drives.shoulder]")[0] + "[rotor" + text.split("\n[rotor", 1)[1]
    (tmp_path / "bare.toml").write_text(bare.split("[sources]")[0])
    (tmp_path / "servo_arm.toml").write_text(text)
    tables = document() | {"model": {"vehicle": "bare.toml"}}
    with pytest.raises(
        ScenarioError,
        match=r"^controller\.servos: is missing; plant\.vehicle = 'servo_arm'",
    ):
        scenario_from(tables, tmp_path)
    meant = scenario_from(
        tables | {"controller": {"law": "centroidal", "servos": False}}, tmp_path
    )
    assert not isinstance(meant.controller.par, ActuatorParameters)
    said = dict(tomllib.loads(text)["drives"]["elbow"])
    half = tables | {
        "model": {"vehicle": "bare.toml", "drives": {"shoulder": said, "elbow": said}}
    }
    believed = scenario_from(half, tmp_path)
    assert number_at(believed, "model.vehicle.drives.shoulder.drive.inertia") == 5e-4


def hearing_late(latency: float, duration: float = 0.15, **replaced: Any) -> Scenario:
    """The arm out of its place, with true servos of some latency."""
    scenario = dataclasses.replace(flight(duration=duration), ground=False, **replaced)
    paths = {
        f"plant.drives.{joint}.latency": latency for joint in ("shoulder", "elbow")
    }
    out = dataclasses.replace(first_state(scenario), joints=(0.6, -0.4))
    return with_numbers(dataclasses.replace(scenario, initial=out), paths)


@pytest.mark.parametrize(
    ("plant", "delays"),
    [("rigid_body", Delays(command=0.008)), ("mujoco", Delays(joints=0.002))],
    ids=["all", "joints"],
)
def test_a_servo_hears_a_late_command_as_it_hears_with_a_latency(plant, delays):
    """Parts of a period count on the way to the servo, too."""
    late, rotors = delays.command + delays.joints, Delays(rotors=delays.command)
    log = run_in_python(hearing_late(0.0, kind=plant, delays=delays))
    latent = run_in_python(hearing_late(late, kind=plant, delays=rotors))
    np.testing.assert_allclose(log.joints, latent.joints, rtol=0.0, atol=1e-9)
    assert np.ptp(latent.joints, axis=0).min() > 0.01


def test_a_law_that_is_called_reaches_its_servos_as_late():
    traced = hearing_late(0.0, delays=Delays(joints=0.002))
    called = dataclasses.replace(
        traced, controller=dataclasses.replace(traced.controller, compiled=False)
    )
    np.testing.assert_allclose(
        run(called).joints, run(traced).joints, rtol=0.0, atol=1e-9
    )


def test_varied_delays_reach_the_servos_of_a_batch():
    lanes = (0.0, 0.002, 0.007)
    scenario = hearing_late(0.0, 0.05, delays=Delays(longest_command=0.01))
    flown = Batch(scenario, ("delays.joints",), metrics=(), effort=0).fly(
        {"delays.joints": np.array(lanes)}
    )
    found = np.array(flown.state.joints)
    for lane, late in enumerate(lanes):
        latent = (
            Batch(hearing_late(late, 0.05), metrics=(), effort=0).fly({}).state.joints
        )
        # other lengths of integration steps
        np.testing.assert_allclose(
            found[:, lane], np.ravel(latent), rtol=0.0, atol=5e-6
        )
    assert np.abs(np.diff(found)).max(axis=0).min() > 1e-4


OWN = "plant.drives.shoulder.latency"


@pytest.mark.parametrize(
    ("path", "named"),
    [(OWN, "plant"), ("model.vehicle.drives.shoulder.drive.latency", "model")],
)
def test_the_latency_of_a_servo_holds_for_the_whole_flight(path, named):
    """A queue of another length began as it was at the start of the flight: a jump by
    all that the joint had moved.
    """
    words = (
        rf"{named}\.drives\.shoulder\.latency = 0\.006: must be as the session began,"
        r" since setpoints are on"
    )
    tables = document() | {"changes": [{"at": 0.02, "path": path, "value": 0.006}]}
    with pytest.raises(ScenarioError, match=rf"changes\[0\]: {words}") as found:
        scenario_from(tables, DATA, {"duration": 0.1})
    assert "\n" not in str(found.value)
    session = Session(flight(duration=0.1), machine_code=False)
    session.step()
    with pytest.raises(ScenarioError, match=words):
        session.change({path: 0.006})


@pytest.mark.parametrize("fly", [Batch, Session])
def test_a_latency_is_no_number_of_compiled_code(fly):
    """It says how many setpoints are on their way: a sentence with the path, before
    anything is compiled.
    """
    path = "model.vehicle.drives.elbow.drive.latency"
    for each in (OWN, path):
        with pytest.raises(
            ScenarioError,
            match=rf"^path = '{each}': says how many setpoints are on their way",
        ):
            fly(flight(duration=0.1), paths=(each,))


def test_a_believed_latency_by_path_is_one_of_the_file():
    """The queue of the belief is as long as its new latency says, not as long as it
    was.
    """
    scenario = flight(duration=0.05)
    longer = with_numbers(
        scenario,
        {
            f"model.vehicle.drives.{j}.drive.latency": 0.012
            for j in ("shoulder", "elbow")
        },
    )
    model = longer.controller.par.model
    again = with_actuators(
        make_controller("centroidal", plain_model(model)), model, 0.005
    )
    assert longer.controller.memory.drives == again.memory.drives
    assert [len(held.waiting) for held in again.memory.drives] == [3, 3]
    assert [len(held.waiting) for held in scenario.controller.memory.drives] == [1, 1]
