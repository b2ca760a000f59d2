"""A flight with everything that this world may do to it: payloads, signals, a stuck
joint, aerodynamic forces.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib

import numpy as np
import pytest

import skyarm
from skyarm.plant.loads import loaded_vehicle
from skyarm.plant.rigid_body import after_impact
from skyarm.records.leaves import leaves
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.loop import run_in_python

EVERYTHING = """
schema = 1
name = "everything_happens"
duration = 1.2
[plant]
vehicle = "hummingbird_arm2_rotors"
[controller]
preset = "centroidal_joint"
[reference.base]
kind = "signals"
z = 0.5
x = { kind = "ramp", start = 0.1, duration = 1.0, height = 0.2, shape = "quintic" }
[environment.wind]
mode = "moving_air"
velocity = [1, 0, 0]
gust = [
  { velocity = [1, 0, 0], start = 0.2, duration = 0.3 },
  { velocity = [0, 1, 0], start = 0.4, duration = 0.3, shape = "one_minus_cosine" },
]
[[environment.air]]
kind = "air_signals"
velocity_W = [{ kind = "ramp", start = 0.5, duration = 0.2, height = 0.5 }, 0, 0]
noise = { velocity = [0.1, 0.1, 0.1], bandwidth_hz = 1.0 }
[[environment.forces]]
kind = "disturbance"
frame = "tip"
axes = "frame"
force = [0, { kind = "sine", amplitude = 0.2, frequency_hz = 1.0 }, 0.1]
torque = [0, 0.01, 0]
noise = { force = [0.05, 0, 0.05], torque = [0, 0.001, 0], bandwidth_hz = 3.0 }
[[environment.forces]]
kind = "ground_effect"
radius = 0.1
[[environment.forces]]
kind = "link_drag"
area = [0.002, 0.001]
[[environment.forces]]
kind = "rotor_drag"
inflow = 1e-5
lift = 1e-3
[[environment.faults]]
rotor = "front"
effectiveness.kind = "sum"
effectiveness.signals = [
    1.0, { kind = "sine", amplitude = -0.1, frequency_hz = 1.0 },
]
[[environment.faults]]
joint = "joint2"
stuck = true
start = 0.7
[[payloads]]
name = "parcel"
mass = 0.05
inertia = [1e-4, 2e-4, 2.5e-4]
com = [0.01, 0, -0.02]
pick = { within = 0.1, of = [0.12, 0, 0.2], after = 0.1 }
drop = 0.9
[[payloads]]
mass = 0.02
com = [0.01, 0.02, 0]
pick = 0.3
[[payloads]]
kind = "hanging"
mass = 0.03
pick = 0.4
drop = 1.0
"""


@pytest.fixture(scope="module")
def scenario():
    return scenario_from(tomllib.loads(EVERYTHING), "test")


@pytest.fixture(scope="module")
def log(scenario):
    return skyarm.run(scenario)


def test_python_floats_fly_the_same_bits(scenario, log):
    again = run_in_python(scenario)
    assert log.status == "completed"
    for name, array in log.arrays().items():
        assert np.array_equal(array, again.arrays()[name]), name


def test_both_plants_agree_where_both_take_the_same_steps(scenario):
    """Fourth order in the same steps of 2 ms: what is left is rounding, and the
    exponential map's own error (1e-9).
    """
    fast = dataclasses.replace(
        scenario, rates=skyarm.Rates(physics=500, control=500, reference=50)
    )
    ours = skyarm.run(fast)
    theirs = skyarm.run(
        dataclasses.replace(fast, kind="mujoco", integrator="rk4_staged")
    )
    assert ours.status == theirs.status == "completed"
    for name in ("position", "quaternion", "velocity", "rate", "joints", "joint_rates"):
        assert np.abs(getattr(ours, name) - getattr(theirs, name)).max() < 1e-6, name
    assert np.array_equal(ours.payload_mass, theirs.payload_mass)


def test_the_log_keeps_what_is_held(log):
    t, held = log.time, log.payload_mass
    away = np.linalg.norm(log.tip - [0.12, 0.0, 0.2], axis=1)
    picked = t[np.flatnonzero((away <= 0.1) & (t >= 0.1))[0]]
    assert 0.15 < picked < 0.6
    assert np.array_equal(held[:, 0], np.where((t >= picked) & (t < 0.9), 0.05, 0.0))
    assert np.array_equal(held[:, 1], np.where(t >= 0.3, 0.02, 0.0))
    assert np.array_equal(held[:, 2], np.where((t >= 0.4) & (t < 1.0), 0.03, 0.0))


def test_a_stuck_joint_stays_where_it_was(log):
    stuck = log.time > 0.7
    # 1e12 kg m^2 under torques of 0.1 N m for half a second
    assert np.ptp(log.joints[stuck, 1]) < 1e-12
    assert np.abs(log.joint_rates[stuck, 1]).max() < 1e-12
    assert np.ptp(log.joints[~stuck, 1]) > 1e-4
    assert np.ptp(log.joints[stuck, 0]) > 1e-4


def test_a_log_in_a_file_is_the_same_flight(log, tmp_path):
    log.save_npz(tmp_path / "log.npz")
    read = skyarm.Log.load_npz(tmp_path / "log.npz")
    assert np.array_equal(read.payload_mass, log.payload_mass)
    assert skyarm.run(read.scenario).info["digest"] == log.info["digest"]
    log.save_csv(tmp_path / "log.csv")
    head = (tmp_path / "log.csv").read_text().partition("\n")[0]
    masses = [each for each in head.split(",") if "payload_mass" in each]
    assert masses == [
        "payload_mass_parcel [kg]",
        "payload_mass_1 [kg]",
        "payload_mass_2 [kg]",
    ]


PATHS = {
    "payloads.0.mass": 0.04,
    "payloads.parcel.com.x": 0.02,
    "payloads.0.inertia.z": 2e-4,
    "payloads.0.pick_place.within": 0.11,
    "payloads.0.drop": 0.8,
    "payloads.1.pick": 0.2,
    "payloads.2.cord": 0.4,
    "environment.forces.0.force.y.amplitude": 0.1,
    "environment.forces.disturbance.noise.bandwidth_hz": 2.0,
    "environment.forces.ground_effect.radius": 0.11,
    "environment.forces.link_drag.area.0": 0.004,
    "environment.forces.rotor_drag.inflow": 2e-5,
    "environment.air.0.velocity_W.x.height": 1.0,
    "environment.wind.gusts.1.peak.y": 2.0,
    "environment.faults.0.signal.signals.1.amplitude": -0.2,
    "environment.faults.1.start": 0.5,
}


def test_a_batch_with_all_numbers_by_path_is_a_loop_of_single_flights(scenario, log):
    batch = skyarm.Batch(scenario, tuple(PATHS), bit_exact=True, effort=0)
    own = [number_at(scenario, path) for path in PATHS]
    found = batch.fly(
        {
            path: np.array([a, b])
            for (path, b), a in zip(PATHS.items(), own, strict=True)
        }
    )
    # the noise of the second lane
    other = skyarm.run(dataclasses.replace(with_numbers(scenario, PATHS), episode=1))
    assert np.abs(other.position - log.position).max() > 1e-3
    for i, each in enumerate((log, other)):
        for name, value in skyarm.score(each).items():
            if name in found.metrics and math.isfinite(value):
                assert found.metrics[name][i] == pytest.approx(
                    value, rel=1e-9, abs=1e-12
                ), name


def test_what_is_not_used_is_not_there(scenario):
    """Without any of it the loop carries, logs and is told no number more than one that
    never heard of it.
    """
    plain = dataclasses.replace(
        scenario, payloads=(), faults=(), air=(), forces=(), wind=skyarm.MovingAir()
    )
    first = first_loop_state(plain)
    assert first.memories == ((),)
    around = first_surroundings(plain, first)
    assert around.of(0).effectiveness is None
    assert leaves(around) == [0.0]  # the time
    assert (
        after_impact(plain.plant.vehicle, first.agent.state, around.of(0))
        is first.agent.state
    )
    assert loaded_vehicle(plain.plant.vehicle, around.of(0)) is plain.plant.vehicle
    faulty = dataclasses.replace(
        plain, faults=(skyarm.Fault(rotor="front", effectiveness=0.5),)
    )
    told = first_surroundings(faulty, first).of(0).effectiveness
    assert told.stuck == ()
    assert (
        "payload_mass"
        not in skyarm.run(dataclasses.replace(plain, duration=0.1)).arrays()
    )


def test_a_number_of_a_payload_may_change_in_flight(scenario):
    change = skyarm.Change(at=0.5, path="payloads.parcel.drop", value=0.6)
    fewer = dataclasses.replace(
        scenario, changes=(change,), faults=(), forces=(), air=(), duration=0.8
    )
    log = skyarm.run(fewer)
    held = log.payload_mass[:, 0] > 0
    assert log.time[held].max() == pytest.approx(0.595)
