"""Air, forces, sensors, an estimator, drives and endings of a user's own, all at once,
on every engine.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.algebra.scalars.philox import normal
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import JointDrive, NamedSensor
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate import Delays, ScenarioError, run
from skyarm.simulate.batch import Batch
from skyarm.simulate.loop import run_in_python
from skyarm.world import MovingAir, dryden
from skyarm.world.wind import wind_from
from support.components import (
    Blend,
    Ceiling,
    Fix,
    Lag,
    RandomPush,
    Shear,
    Tether,
    Turbulence,
    equal_logs,
    same_logs,
)

TURBULENT = wind_from(
    {"mode": "moving_air", "turbulence": {"altitude": 6.0, "wind_20ft": 7.7}}, "wind"
)

EVERYTHING = dataclasses.replace(
    load_scenario("case2", duration=0.5),
    wind=TURBULENT,
    air=(Turbulence(sigma=0.5), Shear(rate=0.4)),
    forces=(
        RandomPush(sigma=0.2),
        Tether(
            anchor=Vec3(0.3, 0.2, 1.5),
            point=Vec3(0.0, 0.0, -0.1),
            body=1,
            stiffness=0.3,
        ),
    ),
    sensors=(NamedSensor(name="fix", sensor=Fix(rate=20.0, delay=0.01, sigma=0.01)),),
    estimator=Blend(gain=0.02),
    drives=(JointDrive(joint="joint1", drive=Lag(lag=0.01)),),
    endings=(Ceiling(height=3.0),),
    noise=SensorNoise(position=0.002, rate=0.01),
    delays=Delays(measurement=0.005, command=0.002),
    seed=11,
    episode=3,
)


@pytest.fixture(scope="module")
def flown():
    log = run(EVERYTHING)
    assert log.status == "completed", log.info["cause"]
    return log


def test_machine_code_flies_the_bits_of_python_floats(flown):
    assert same_logs(flown, run_in_python(EVERYTHING))


WITHOUT = {
    "air": {"air": ()},
    "one_air": {"air": EVERYTHING.air[:1]},
    "forces": {"forces": ()},
    "push": {"forces": EVERYTHING.forces[1:]},
    "estimator": {"estimator": dataclasses.replace(EVERYTHING.estimator, gain=0.0)},
    "drives": {"drives": ()},
}


@pytest.mark.parametrize("what", sorted(WITHOUT))
def test_each_of_them_is_felt(flown, what):
    assert not same_logs(flown, run(dataclasses.replace(EVERYTHING, **WITHOUT[what])))


def test_both_plants_fly_it(flown):
    pytest.importorskip("mujoco")
    theirs = run(dataclasses.replace(EVERYTHING, kind="mujoco"))
    assert theirs.status == "completed"
    # the same draws and memories; MuJoCo's plant holds forces for a millisecond, and
    # the noise is fed back
    assert np.abs(theirs.position - flown.position).max() < 1e-3
    assert np.abs(flown.position - flown.position[0]).max() > 0.01


PATHS = {
    "environment.air.0.sigma": 0.5,
    "environment.air.1.rate": 0.4,
    "environment.forces.0.sigma": 0.2,
    "environment.forces.1.stiffness": 0.3,
    "environment.forces.1.anchor.x": 0.3,
    "sensors.fix.sigma": 0.01,
    "estimator.gain": 0.02,
    "plant.drives.joint1.lag": 0.01,
    "endings.0.height": 3.0,
    "sensors.position": 0.002,
}


def at(scenario, path):
    """The record's own field, by hand."""
    return {
        "environment.air.0.sigma": lambda s: s.air[0].sigma,
        "environment.air.1.rate": lambda s: s.air[1].rate,
        "environment.forces.0.sigma": lambda s: s.forces[0].sigma,
        "environment.forces.1.stiffness": lambda s: s.forces[1].stiffness,
        "environment.forces.1.anchor.x": lambda s: s.forces[1].anchor.x,
        "sensors.fix.sigma": lambda s: s.sensors[0].sensor.sigma,
        "estimator.gain": lambda s: s.estimator.gain,
        "plant.drives.joint1.lag": lambda s: s.drives[0].drive.lag,
        "endings.0.height": lambda s: s.endings[0].height,
        "sensors.position": lambda s: s.noise.position,
    }[path](scenario)


@pytest.mark.parametrize("path", sorted(PATHS))
def test_numbers_of_added_components_have_paths(path):
    assert number_at(EVERYTHING, path) == PATHS[path]
    changed = with_numbers(EVERYTHING, {path: 0.125})
    assert {name: at(changed, name) for name in PATHS} == PATHS | {path: 0.125}


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("environment.air.2.sigma", r"no '2' here; there are 0, 1$"),
        ("environment.air.0.gain", r"no 'gain' here; there are sigma, time$"),
        ("environment.forces.1.anchor", r"must lead to a number"),
        ("environment.forces.push.sigma", r"no 'push' here"),
        ("sensors.gps.sigma", r"no 'gps' here"),
        ("sensors.fix.walk", r"no 'walk' here; there are rate, delay, sigma$"),
        ("estimator.sensor", r"must lead to a number, not to str$"),
        ("plant.drives.joint2.lag", r"no 'drives' here|no 'joint2' here"),
        ("endings.1.height", r"no '1' here; there are 0$"),
    ],
)
def test_a_path_to_nothing_says_what_there_is(path, words):
    with pytest.raises(ScenarioError, match=words):
        with_numbers(EVERYTHING, {path: 1.0})


def test_a_hundred_lanes_with_their_own_numbers_are_the_single_flights():
    """Every path varies at once; three lanes are flown alone, to the bit."""
    short = dataclasses.replace(EVERYTHING, duration=0.1)
    lanes, rng = 100, np.random.default_rng(1)
    values = {
        path: number * rng.uniform(0.8, 1.2, lanes) for path, number in PATHS.items()
    }
    batch = Batch(short, tuple(PATHS), bit_exact=True, effort=0)
    outcome = batch.fly(values, seed=7)
    assert set(outcome.status) == {"completed"}
    for lane in (0, 31, 99):
        numbers = {path: float(column[lane]) for path, column in values.items()}
        alone = dataclasses.replace(
            with_numbers(short, numbers), seed=7, episode=lane, duration=0.105
        )
        last = run(alone)
        found = [
            float(c[lane]) for c in (*outcome.state.position, *outcome.state.joints)
        ]
        assert found == [*last.position[20].tolist(), *last.joints[20].tolist()]
    assert len(set(outcome.state.position.z.tolist())) == lanes


CALM = dataclasses.replace(
    EVERYTHING,
    forces=(),
    drives=(),
    endings=(),
    wind=TURBULENT,
    air=(Turbulence(),),
    duration=0.25,
)


def test_another_component_changes_no_others_draws():
    """A force that draws and pushes nothing, and one that draws nothing: the flight
    stays the same, value by value.
    """
    alone = run(CALM)
    assert equal_logs(
        alone,
        run(
            dataclasses.replace(
                CALM, forces=(RandomPush(sigma=0.0), RandomPush(sigma=0.0))
            )
        ),
    )
    still = Shear(rate=0.0)
    assert equal_logs(alone, run(dataclasses.replace(CALM, air=(still, *CALM.air))))
    # the other's draws are there
    assert not equal_logs(
        alone, run(dataclasses.replace(CALM, forces=(RandomPush(sigma=0.1),)))
    )


def test_the_wind_of_the_library_keeps_its_draws_whatever_is_added():
    """Dryden turbulence, drawn here from its channel, is what is left when the added
    air's part is taken away.
    """
    log, calm = run(CALM), dataclasses.replace(CALM, wind=MovingAir())
    first, second = (
        Vec3(*normal(11, 3, 1, 2**32 - back, 3).tolist()) for back in (1, 2)
    )
    memory, blowing = dryden.start(first, second, 0.005, par=TURBULENT.turbulence), []
    for k in range(len(log.time)):
        memory, velocity = dryden.step(
            memory,
            Vec3(*normal(11, 3, 1, k, 3).tolist()),
            0.005,
            par=TURBULENT.turbulence,
        )
        blowing.append([float(c) for c in velocity])
    np.testing.assert_allclose(
        log.air_velocity - run(calm).air_velocity, blowing, rtol=0.0, atol=1e-14
    )


@pytest.mark.thorough
def test_two_components_of_one_kind_draw_independent_numbers():
    one = dataclasses.replace(
        CALM, wind=MovingAir(), air=(Turbulence(time=1e-3),), duration=2.0
    )
    both = dataclasses.replace(one, air=(Turbulence(time=1e-3), Turbulence(time=1e-3)))
    first = run(one).air_velocity
    second = run(both).air_velocity - first
    # white in time: 1200 pairs of draws; 0.12 is four deviations of their correlation
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.12
    for each in (first, second):
        assert each.std() == pytest.approx(0.5, rel=0.1)


def test_an_episode_and_a_seed_of_their_own_draw_their_own_turbulence():
    flights = [
        run(dataclasses.replace(CALM, **keys))
        for keys in ({}, {"seed": 12}, {"episode": 4})
    ]
    assert len({log.air_velocity.tobytes() for log in flights}) == 3


def test_a_turbulence_of_a_users_own_is_stationary_from_the_first_period_on():
    """An ensemble of starts: 4000 lanes, each the second of a flight of one period."""
    from skyarm.simulate.draws import start_draws

    scenario = dataclasses.replace(CALM, wind=MovingAir())
    drawn = start_draws(scenario, 5, np.arange(4000))
    assert [row.shape for row in drawn] == [(4000, 0), (4000, 8)]
    memory = np.array(
        [Turbulence().start(0.005, tuple(row)) for row in drawn[1].tolist()]
    )
    assert memory.std() == pytest.approx(1.0, rel=0.03)
    assert abs(memory.mean()) < 0.04
    # every episode alone draws what it draws among others
    alone = start_draws(scenario, 5, 17)[1]
    assert alone.tolist() == drawn[1][17].tolist()


def test_components_must_be_of_their_kind():
    for field, value, words in (
        ("air", (3,), r"air\[0\] = 3: must be a Component$"),
        ("forces", Tether(), r"forces = .*must be a tuple of Component$"),
        ("endings", (Shear(),), r"endings\[0\] = .*must be a Ending$"),
        ("drives", (Lag(),), r"drives\[0\] = .*must be a JointDrive$"),
    ):
        with pytest.raises(ScenarioError, match=f"^{words}"):
            dataclasses.replace(EVERYTHING, **{field: value})
    with pytest.raises(ScenarioError, match=r"^estimator = .*must be a Estimator"):
        dataclasses.replace(EVERYTHING, estimator=Shear())
