"""Rotor speeds beyond a rotor's range: refused where they are stated, raised and
counted where a law gives them.
"""

from __future__ import annotations

import dataclasses
import re

import mujoco
import numpy as np
import pytest

import skyarm
from skyarm.control.law_checks import LawError
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.rotor import push
from skyarm.envs.action_kinds import Turn, within_limits
from skyarm.links.ros.ros_link import command_of
from skyarm.log.metrics.score import score
from skyarm.log.ros.message_bytes import MessageError
from skyarm.plant.mujoco_export import mjcf_text
from skyarm.simulate.examine import check_law

TOP, FALL = 838.0, 9.8
BIRD = skyarm.load_scenario("case1", controller="paper_pd", duration=0.05)


def with_rotors(scenario: skyarm.Scenario, **changes: object) -> skyarm.Scenario:
    """The scenario whose plant has other rotors."""
    vehicle = scenario.plant.vehicle
    rotors = tuple(dataclasses.replace(each, **changes) for each in vehicle.rotors)
    plant = dataclasses.replace(
        scenario.plant, vehicle=dataclasses.replace(vehicle, rotors=rotors)
    )
    return dataclasses.replace(scenario, plant=plant)


@dataclasses.dataclass(frozen=True)
class Fixed:
    """Constants of a law that gives the same speeds in every period."""

    model: Model
    speeds: tuple[float, ...]


def law(memory, measurement, reference, dt, *, par):
    """Speeds of the constants, joints free."""
    return memory, Command(
        rotor_speeds=par.speeds, efforts=(0.0,) * par.model.vehicle.n
    )


def flown(speeds, scenario: skyarm.Scenario = BIRD) -> skyarm.Log:
    par = Fixed(scenario.controller.par.model, tuple(map(float, speeds)))
    mine = skyarm.Controller(name="fixed", law=law, par=par)
    return skyarm.Session(scenario.with_controller(mine), machine_code=False).run()


def drawn(count: int) -> list[list[float]]:
    """Commands of four speeds of which one to four are negative or too high."""
    rng = np.random.default_rng(90)
    rows = []
    for _ in range(count):
        row = rng.uniform(200.0, 700.0, 4)
        beyond = rng.permutation(4)[: rng.integers(1, 5)]
        row[beyond] = np.where(rng.random(len(beyond)) < 0.5, -1.0, 1.0) * rng.uniform(
            TOP * 1.001, 3e3, len(beyond)
        )
        row[beyond[0]] = rng.choice([-1e-6, -400.0, TOP + 1e-6, 2e3])
        rows.append(row.tolist())
    return rows


def test_a_stated_command_beyond_a_rotors_range_is_refused_at_every_door() -> None:
    session, vehicle = skyarm.Session(BIRD), BIRD.plant.vehicle
    words = r"= -?\S+: must be from 0 to 838 rad/s, the range of rotor '\w+'"
    for row in drawn(100):
        with pytest.raises(
            skyarm.ScenarioError, match=rf"^command\.rotor_speeds\[\d\] {words}"
        ):
            session.step(Command(rotor_speeds=tuple(row), efforts=(0.0, 0.0)))
        with pytest.raises(skyarm.ScenarioError, match=rf"^rotors\[\d\] {words}"):
            session.step(rotors=row)
        with pytest.raises(MessageError, match=rf"^rotor speeds\[\d\] {words}"):
            command_of([*row, 0.0, 0.0], vehicle)
    assert session.tick == 0
    start = BIRD.with_initial(
        dataclasses.replace(session.state, rotor_speeds=tuple(drawn(1)[0]))
    )
    with pytest.raises(ValueError, match=rf"^initial\.rotor_speeds\[\d\] {words}"):
        skyarm.run(start)
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"one that turns backwards states reversible = true$",
    ):
        session.step(rotors=[-1.0, 400.0, 400.0, 400.0])
    assert session.step(rotors=[0.0, TOP, 400.0, 0.0])
    session.change({"plant.vehicle.rotors.1.max_speed": 500.0})
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"^rotors\[1\] = 838\.0: must be from 0 to 500 rad/s",
    ):
        session.step(rotors=[0.0, TOP, 400.0, 0.0])


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_computed_command_acts_within_the_range_and_counts_as_saturation(
    plant: str,
) -> None:
    scenario = skyarm.load_scenario(
        "case1", controller="paper_pd", duration=0.015, plant=plant
    )
    for row in drawn(100)[:: 25 if plant == "rigid_body" else 50]:
        log, able = flown(row, scenario), flown(np.clip(row, 0.0, TOP), scenario)
        assert log.rotor_commands[-1].tolist() == row, "the log has what the law gave"
        assert np.array_equal(log.position, able.position)
        assert np.array_equal(log.rotor_speeds, able.rotor_speeds)
        assert ((log.rotor_speeds >= 0.0) & (log.rotor_speeds <= TOP)).all()
        assert score(log, ("rotor_saturation",))["rotor_saturation"] == 1.0
        assert log.shortfall.saturation is not None
        assert log.shortfall.saturation.share == 1.0
        assert log.shortfall.saturation.counts


def test_a_speed_below_rest_is_told_as_saturated_and_rest_is_not() -> None:
    assert flown((0.0,) * 4).shortfall.saturation is None
    cut = flown((400.0, -300.0, 400.0, 400.0)).shortfall.saturation
    assert cut is not None
    assert (cut.command, cut.limit, cut.share) == (-300.0, 0.0, 1.0)
    assert cut.actuator.startswith("rotor ")


def test_check_law_sees_a_first_command_out_of_range() -> None:
    def make(speed: float) -> skyarm.Controller:
        return skyarm.Controller(
            name="fixed",
            law=law,
            par=Fixed(BIRD.controller.par.model, (400.0, speed, 1.0, 1.0)),
        )

    with pytest.raises(
        LawError,
        match=(
            r"gives rotor_speeds\[1\] = -5\.0: must be from 0 to 838 .* in its first"
            r" perio"
        ),
    ):
        check_law(make(-5.0), BIRD)
    with pytest.warns(
        UserWarning,
        match=r"rotor_speeds\[1\] = 900\.0: .* a flight clips it and counts it",
    ):
        check_law(make(900.0), BIRD)
    check_law(make(TOP), BIRD)


def test_a_reversible_rotor_turns_backwards_and_pulls() -> None:
    """Four rotors at -W on a vehicle in free fall: g and the thrust together, by hand,
    once they turn steadily.
    """
    back = with_rotors(
        BIRD, reversible=True, time_constant_up=1e-4, time_constant_down=1e-4
    )
    session, speed = skyarm.Session(back), 300.0
    while session.running:
        session.step(rotors=(-speed,) * 4)
    log = session.log
    vehicle = back.plant.vehicle
    thrust = 4.0 * float(vehicle.rotors[0].thrust_coefficient) * speed**2
    fell = float(log.velocity[-1, 2] - log.velocity[-3, 2]) / float(
        log.time[-1] - log.time[-3]
    )
    assert log.rotor_speeds[-1] == pytest.approx(-speed)
    # the arm swings a little
    assert fell == pytest.approx(-FALL - thrust / float(vehicle.mass), rel=2e-2)
    assert np.abs(log.rate[-1]).max() < 1e-9, "drag torques cancel"
    with pytest.raises(
        skyarm.ScenarioError, match=re.escape("must be from -838 to 838 rad/s")
    ):
        skyarm.Session(back).step(rotors=(-839.0,) * 4)
    assert (
        score(flown((-TOP,) * 4, back), ("rotor_saturation",))["rotor_saturation"]
        == 1.0
    )
    assert (
        score(flown((-TOP / 2.0,) * 4, back), ("rotor_saturation",))["rotor_saturation"]
        == 0.0
    )
    assert float(push(vehicle.rotors[0], -2.0)) == -4.0


def test_actions_and_mujocos_controls_keep_the_range_of_a_rotor() -> None:
    """A policy's speeds are clipped, and an exported thrust is limited, both ways where
    the rotor turns both ways.
    """
    for back, least in ((False, 0.0), (True, -TOP)):
        scenario = with_rotors(BIRD, reversible=back)
        par = Fixed(skyarm.Model(vehicle=scenario.plant.vehicle), ())
        turn = Turn((), None, None, None, par, (False, False))  # type: ignore[arg-type]
        sent = within_limits(turn, (-2e3, 2e3, -1.0, 400.0), (0.0, 0.0))
        assert sent.rotor_speeds == (least, TOP, max(least, -1.0), 400.0)
        model = mujoco.MjModel.from_xml_string(
            mjcf_text(scenario.plant.vehicle, 9.8, None)
        )
        thrust = float(scenario.plant.vehicle.rotors[0].thrust_coefficient) * TOP**2
        assert model.actuator_ctrlrange[0] == pytest.approx(
            [-thrust if back else 0.0, thrust], rel=1e-5
        )
