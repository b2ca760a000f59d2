"""Sensors beside the full state, and the estimator: when each reading is taken, how old
it is when it is seen.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from skyarm.algebra.scalars.philox import normals, uniforms
from skyarm.dynamics.actuators import Command
from skyarm.plant.compiled import Steps
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import NamedSensor
from skyarm.sensing.estimate.estimator import Estimator
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate import Delays, ScenarioError, run
from skyarm.simulate.draws import draw_plan
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.loop_state import InputRow
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages
from support.components import Blend, Fix, telling, with_law

BASE = load_scenario("case1", duration=0.2)


def with_sensors(scenario=BASE, **sensors: Any):
    return dataclasses.replace(
        scenario,
        sensors=tuple(
            NamedSensor(name=name, sensor=each) for name, each in sensors.items()
        ),
    )


@dataclass(frozen=True, kw_only=True)
class Listening(Estimator):
    """Keeps what it is given, in floats."""

    heard: Any

    def step(self, memory, readings, command, dt):
        self.heard.append((dict(readings), command, dt))
        return memory, readings["state"]


def heard_in_floats(scenario, periods):
    """What the estimator is given in each period, by the stages in Python floats,
    untraced.
    """
    heard: list[Any] = []
    scenario = dataclasses.replace(scenario, estimator=Listening(heard=heard))
    stages = Stages(scenario)
    period, now = (
        make_period(stages, RigidBodySteps(stages, lambda _: Steps(1))),
        first_loop_state(scenario),
    )
    heard.clear()
    samples = []
    for k in range(periods):
        keys = (scenario.seed, scenario.episode)
        drawn = [
            float(u)
            for channel, n in stages.draws.channels
            for u in uniforms(*keys, channel, k, n)
        ]
        now, sample = period(
            now, (InputRow(time=k / 200, reference=scenario.reference.at(0.0)),), drawn
        )
        assert sample.alive == 1.0
        samples.append(sample.agent)
    return heard, samples


@pytest.mark.parametrize("late", [0, 1, 2, 5])
@pytest.mark.parametrize("every", [1, 2, 4, 10])
def test_readings_are_taken_at_the_sensors_instants_held_and_as_late_as_its_latency(
    every, late
):
    rate = 0.0 if every == 1 else 200.0 / every
    heard, samples = heard_in_floats(
        with_sensors(fix=Fix(rate=rate, delay=0.005 * late)), 25
    )
    for k, (readings, _, _) in enumerate(heard):
        # until the first reading has arrived that one is seen
        taken = max(0, k - late) // every * every
        time, count, *position, dt = readings["fix"]
        assert time == taken / 200
        assert count == taken // every
        assert dt == pytest.approx(every / 200, rel=1e-15)
        assert position == list(samples[taken].state.position)
        assert readings["state"] == samples[k].measurement
        assert dict(samples[k].readings) == {"fix": readings["fix"]}


def test_a_rate_equal_to_the_loops_is_no_rate():
    plain, named = (
        heard_in_floats(with_sensors(fix=Fix(rate=rate, sigma=0.1)), 6)[0]
        for rate in (0.0, 200.0)
    )
    assert [readings["fix"] for readings, _, _ in plain] == [
        readings["fix"] for readings, _, _ in named
    ]


def test_a_slow_sensors_noise_is_drawn_at_its_own_instants():
    scenario = with_sensors(fix=Fix(rate=50.0, sigma=0.1))
    scenario = dataclasses.replace(scenario, seed=5, episode=2)
    (channel, count), *rest = draw_plan(scenario).channels
    assert count == 4
    assert not rest
    heard, samples = heard_in_floats(scenario, 9)
    for k in (0, 4, 8):
        noise = normals(uniforms(5, 2, channel, k, 4).tolist())[:3]
        wanted = [
            p + 0.1 * x for p, x in zip(samples[k].state.position, noise, strict=True)
        ]
        assert list(heard[k][0]["fix"][2:5]) == wanted
    assert heard[3][0]["fix"] == heard[0][0]["fix"]


def test_the_estimator_is_given_the_command_that_acts_and_the_period():
    speeds = [451.0, 452.0, 453.0, 454.0, 455.0, 456.0]
    issued = iter(speeds)

    def law(memory, measurement, reference, dt, *, par):
        return memory, Command(rotor_speeds=(next(issued),) * 4, efforts=(0.0, 0.0))

    late = dataclasses.replace(with_law(BASE, law), delays=Delays(command=0.010))
    heard, samples = heard_in_floats(late, 6)
    standing = samples[0].state.rotor_speeds[0]
    # two periods late, and before this period's arrives: three back
    assert [command.rotor_speeds[0] for _, command, _ in heard] == [
        standing
    ] * 3 + speeds[:3]
    assert {dt for _, _, dt in heard} == {0.005}


ENGINES = [(run, "rigid_body"), (run_in_python, "rigid_body"), (run, "mujoco")]


@dataclass(frozen=True, kw_only=True)
class Telling(Estimator):
    """Puts a fix's time, number and height in the place of the measured position, and
    its own count of periods in the place of the measured velocity."""

    def start(self, vehicle):
        return (0.0,)

    def step(self, memory, readings, command, dt):
        full, fix = readings["state"], readings["fix"]
        position = dataclasses.replace(full.position, x=fix[0], y=fix[1], z=fix[4])
        velocity = dataclasses.replace(full.velocity, x=memory[0])
        return (memory[0] + 1.0,), dataclasses.replace(
            full, position=position, velocity=velocity
        )


@pytest.mark.parametrize(("fly", "plant"), ENGINES, ids=["code", "py", "mujoco"])
def test_every_engine_hands_the_law_what_the_estimator_made(fly, plant):
    if plant == "mujoco":
        pytest.importorskip("mujoco")
    heard = telling(
        lambda m: (
            100.0 * m.position.x,
            m.position.y,
            m.position.z,
            m.velocity.x / 100.0,
        )
    )
    base = dataclasses.replace(
        with_law(load_scenario("case1", duration=0.2), heard), kind=plant
    )
    log = fly(
        dataclasses.replace(
            with_sensors(base, fix=Fix(rate=50.0, delay=0.010)), estimator=Telling()
        )
    )
    assert log.status == "completed"
    k = np.arange(40)
    taken = np.maximum(0, k - 2) // 4 * 4
    wanted = [0.5 * taken, taken // 4, log.position[taken, 2], k / 100.0]
    np.testing.assert_allclose(
        log.rotor_commands, 450.0 + np.stack(wanted, axis=1), rtol=0.0, atol=1e-12
    )


def test_a_delay_of_the_full_state_is_not_the_named_sensors():
    heard, samples = heard_in_floats(
        dataclasses.replace(
            with_sensors(fix=Fix(delay=0.005)), delays=Delays(measurement=0.015)
        ),
        8,
    )
    for k, (readings, _, _) in enumerate(heard):
        assert readings["state"] == samples[k].measurement
        assert readings["state"].position == samples[max(0, k - 3)].state.position
        assert readings["fix"][0] == max(0, k - 1) / 200


NOISY = dataclasses.replace(
    load_scenario("case2", duration=0.5),
    noise=SensorNoise(position=0.002, rate=0.01),
    estimator=Blend(),
    seed=3,
)
FIX = Fix(rate=20.0, sigma=0.05, delay=0.01)


def test_another_sensor_changes_no_others_draws():
    """The full flight is the same to the bit, whichever other sensors tick beside,
    before and after.
    """
    alone = run(with_sensors(NOISY, fix=FIX))
    other = Fix(sigma=1.0)
    for both in ({"fix": FIX, "other": other}, {"other": other, "fix": FIX}):
        log = run(with_sensors(NOISY, **both))
        assert log.readings["other"]["value"].std() > 0.5
        assert all(
            array.tobytes() == log[name].tobytes()
            for name, array in alone.arrays().items()
        )
    # and they are draws: another name draws other numbers, another deviation flies
    # otherwise
    renamed = dataclasses.replace(
        with_sensors(NOISY, mast=FIX), estimator=Blend(sensor="mast")
    )
    weaker = with_sensors(NOISY, fix=dataclasses.replace(FIX, sigma=0.04))
    for scenario in (renamed, weaker):
        assert not np.array_equal(alone.position, run(scenario).position)


def test_sensors_of_two_names_draw_independent_numbers():
    heard, samples = heard_in_floats(
        with_sensors(a=Fix(sigma=1.0), b=Fix(sigma=1.0)), 60
    )
    noise = {
        name: (
            np.array([readings[name][2:5] for readings, _, _ in heard])
            - np.array([list(sample.state.position) for sample in samples])
        )
        for name in "ab"
    }
    # 180 pairs of unit draws: a correlation of 0.3 is four deviations
    assert abs(np.corrcoef(noise["a"].ravel(), noise["b"].ravel())[0, 1]) < 0.3
    assert not np.array_equal(noise["a"], noise["b"])


@pytest.mark.parametrize(
    ("sensor", "words"),
    [
        (
            Fix(rate=30.0),
            r"^sensors\.fix\.frequency = 30: must divide rates\.control = 200 Hz$",
        ),
        (
            Fix(rate=400.0),
            r"^sensors\.fix\.frequency = 400: must divide rates\.control",
        ),
        (Fix(rate=-10.0), r"^sensors\.fix\.frequency = -10.*must be at least 0"),
        (
            Fix(delay=0.003),
            (
                r"^sensors\.fix\.latency = 0\.003: must be a whole number of control"
                r" periods"
            ),
        ),
        (Fix(delay=-0.005), r"^sensors\.fix\.latency = -0\.005.*must be at least 0"),
        (Fix(rate=float("nan")), r"^sensors\.fix\.frequency = nan"),
        (Fix(rate="fast"), r"^sensors\.fix\.frequency = 'fast'"),
    ],
)
def test_clocks_that_do_not_tick_with_the_loop_are_refused(sensor, words):
    with pytest.raises(ScenarioError, match=words):
        run(with_sensors(fix=sensor))


def test_names_of_sensors_are_words_and_taken_once():
    for name in ("state", "two words", "", 3):
        with pytest.raises(
            ScenarioError, match=r"^sensors: name = .*must be a word, and not 'state'"
        ):
            NamedSensor(name=name, sensor=Fix())
    twice = (NamedSensor(name="fix", sensor=Fix()),) * 2
    with pytest.raises(ScenarioError, match=r"^sensors\.fix: the name is taken$"):
        run(dataclasses.replace(BASE, sensors=twice))
    with pytest.raises(ScenarioError, match=r"^sensors\.fix = .*must be a Sensor$"):
        NamedSensor(name="fix", sensor=3.0)
