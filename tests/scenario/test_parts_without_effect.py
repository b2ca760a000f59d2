"""An air, a force or a sensor that touches nothing of the flight is said in one line
with its cure.
"""

from __future__ import annotations

import dataclasses
import re
import tomllib
import warnings
from pathlib import Path
from typing import Any

import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars import maximum, sqrt
from skyarm.records.immutable import immutable
from skyarm.scenario.controller_table import under_law
from skyarm.scenario.in_flight import Change
from skyarm.scenario.without_effect import WithoutEffectWarning, without_effect
from skyarm.sensing.estimate.estimator import FULL_STATE, Estimator
from skyarm.sensing.measurement import SensorNoise
from skyarm.sensing.sensor_kinds import Heading, Position
from skyarm.vehicle.vehicle_files import list_vehicles
from skyarm.vehicle.vehicle_records import BodyDrag
from skyarm.world import (
    Air,
    Force,
    ForceWind,
    Gust,
    LinkDrag,
    MovingAir,
    RotorDrag,
    Wrench,
    low_altitude,
)

CASE = skyarm.load_scenario("case3", duration=2.0)
BIRD = CASE.plant.vehicle
UP = MovingAir(velocity_W=(0.0, 0.0, 1.5))


def _with_vehicle(scenario: skyarm.Scenario, vehicle: Any) -> skyarm.Scenario:
    return dataclasses.replace(
        scenario, plant=dataclasses.replace(scenario.plant, vehicle=vehicle)
    )


def with_area(*area: float) -> skyarm.Scenario:
    vehicle = dataclasses.replace(CASE.plant.vehicle, drag=BodyDrag(area=area))
    return _with_vehicle(CASE, vehicle)


def test_vertical_air_needs_an_area_and_the_cure_cures():
    (line,) = without_effect(dataclasses.replace(CASE, wind=UP))
    assert (
        line
        == "environment.wind: moves the air along z, where 'hummingbird_arm2_rotors'"
        " has drag by its tilt alone: hardly any effect of that; drag.area[2] of it?"
    )
    assert without_effect(dataclasses.replace(with_area(0.0, 0.0, 0.02), wind=UP)) == ()
    assert (
        without_effect(
            dataclasses.replace(CASE, wind=UP, forces=(RotorDrag(inflow=1e-4),))
        )
        == ()
    )
    assert (
        without_effect(
            dataclasses.replace(CASE, wind=UP, forces=(LinkDrag(area=(0.002, 0.002)),))
        )
        == ()
    )
    mixed = dataclasses.replace(CASE, wind=MovingAir(velocity_W=(3.0, 0.0, 1.0)))
    assert [said.partition(",")[0] for said in without_effect(mixed)] == [
        "environment.wind: moves the air along z"
    ]


def test_air_that_acts_is_not_said_nor_turbulence_beside_it():
    wind = MovingAir(velocity_W=(3.0, 0.0, 0.0), turbulence=low_altitude(6.0, 7.7, 3.0))
    for air in (
        wind,
        MovingAir(gust=Gust(peak=(0.0, 2.0, 0.0), start=30.0, duration=1.0)),
    ):
        assert without_effect(dataclasses.replace(CASE, wind=air)) == ()
    assert (
        len(
            without_effect(
                dataclasses.replace(
                    CASE, wind=dataclasses.replace(wind, velocity_W=(0.0, 0.0, 1.0))
                )
            )
        )
        == 1
    )


@immutable
class Many(Force):
    """A user's force of more random numbers than any memory holds."""

    uniforms = 10**12  # type: ignore[assignment]

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        return []


def test_a_count_of_random_numbers_beyond_measure_does_not_hold_up_the_judgement():
    beside = dataclasses.replace(CASE, wind=UP, forces=(Many(), Nudge()))
    assert [line.partition(":")[0] for line in without_effect(beside)] == [
        "environment.wind",
        "environment.forces[1]",
    ]


def test_a_force_that_is_zero_until_it_changes_in_flight_is_not_said():
    still = dataclasses.replace(CASE, wind=ForceWind(force_W=(0.0, 0.0, 0.0)))
    assert len(without_effect(still)) == 1
    later = Change(at=1.0, path="environment.wind.force.x", value=1.0)
    assert without_effect(dataclasses.replace(still, changes=(later,))) == ()


@pytest.mark.parametrize(
    ("path", "forces"),
    [
        ("environment.forces.0.area.0", (LinkDrag(area=(0.0, 0.0)),)),
        ("plant.vehicle.drag.area.2", ()),
        pytest.param(
            "environment.forces.0.inflow",
            (RotorDrag(inflow=0.0),),
            marks=pytest.mark.thorough,
        ),
        pytest.param("plant.drag.area.2", (), marks=pytest.mark.thorough),
    ],
)
def test_air_that_is_felt_once_a_drag_changes_in_flight_is_not_said(path, forces):
    still = dataclasses.replace(CASE, wind=UP, forces=forces)
    assert [line.partition(":")[0] for line in without_effect(still)][:1] == [
        "environment.wind"
    ]
    assert (
        without_effect(
            dataclasses.replace(still, changes=(Change(at=0.5, path=path, value=1e-4),))
        )
        == ()
    )
    wind = Change(at=0.5, path="environment.wind.velocity.z", value=1.0)
    assert (
        without_effect(dataclasses.replace(still, changes=(wind,)))[:1]
        == without_effect(still)[:1]
    )


@immutable
class Thermal(Air):
    """A user's air: it rises by and by, not at the first instant."""

    strength: float = 1.0
    place: float = 0.0

    def velocity(self, memory: Any, t: Any, position_W: Vec3) -> Vec3:
        return Vec3(0.0 * self.strength, 0.0, self.strength * t * t)


@immutable
class Nudge(Force):
    """A user's force of a size that may be none."""

    size: float = 0.0

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        return [Wrench(force_W=Vec3(self.size * t, 0.0, 0.0))]


def test_parts_of_a_user_are_judged_by_what_they_do():
    air, force = without_effect(
        dataclasses.replace(CASE, air=(Thermal(),), forces=(Nudge(),))
    )
    assert air.startswith("environment.air[0]: moves the air along z, ")
    assert force.startswith(
        "environment.forces[0]: moves no air and exerts no force along the reference; "
    )
    good = dataclasses.replace(
        with_area(0.0, 0.0, 0.02), air=(Thermal(),), forces=(Nudge(size=0.1),)
    )
    assert without_effect(good) == ()


@immutable
class Growing(Force):
    """A user's force that is none at first and grows in its memory."""

    def start(self, period: float, draws: Any) -> Any:
        return (0.0,)

    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Any) -> Any:
        return (memory[0] + dt,)

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        return [Wrench(torque_W=Vec3(memory[0], 0.0, 0.0))]


def test_a_memory_goes_on_and_turbulence_counts_where_no_air_is_felt():
    assert without_effect(dataclasses.replace(CASE, forces=(Growing(),))) == ()
    rotors = [
        dataclasses.replace(each, drag_coefficient=0, rolling_moment_coefficient=0)
        for each in BIRD.rotors
    ]
    wind = MovingAir(turbulence=low_altitude(6.0, 7.7, 3.0))
    smooth = dataclasses.replace(
        _with_vehicle(CASE, dataclasses.replace(BIRD, rotors=tuple(rotors))), wind=wind
    )
    (line,) = without_effect(smooth)
    assert line.startswith("environment.wind: moves the air along x, y, z, where ")
    assert "has no drag: no effect of that; " in line


@immutable
class Righting(Force):
    """A user's torque against tilt alone: none on a level reference."""

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        at = motion.state.quaternion
        return [Wrench(torque_W=Vec3(-at.x, -at.y, 0.0))]


@immutable
class Fence(Force):
    """A user's wall beyond the reference, which a passage would latch on."""

    def start(self, period: float, draws: Any) -> Any:
        return (0.0,)

    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Any) -> Any:
        return (maximum(memory[0], state.position.x - 5.0),)

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        return [Wrench(force_W=Vec3(-maximum(memory[0], 0.0), 0.0, 0.0))]


@immutable
class Kick(Force):
    """A user's force for 12 ms."""

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        return [
            Wrench(
                force_W=Vec3(
                    maximum(0.0, t - 7.0112) * maximum(0.0, 7.0232 - t), 0.0, 0.0
                )
            )
        ]


@pytest.mark.parametrize("force", [Righting(), Fence(), Kick()])
def test_a_force_that_may_act_where_it_is_not_looked_at_is_not_called_idle(
    force, monkeypatch
):
    monkeypatch.setattr("skyarm.scenario.without_effect.INSTANTS", 100)
    long = dataclasses.replace(CASE, forces=(force,), duration=300.0)
    assert without_effect(long) == ()
    (line,) = without_effect(
        dataclasses.replace(long, wind=ForceWind(force_W=(0.0, 0.0, 0.0)))
    )
    assert line.startswith(
        "environment.wind: moves no air and exerts no force along the reference; "
    )


@immutable
class Broken(Force):
    """A user's force that cannot be evaluated."""

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        raise ArithmeticError


@immutable
class Dividing(Force):
    """A user's drag, which no float is where no air moves."""

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        air = motion.velocity() - motion.air_velocity()
        return [Wrench(force_W=air * (1.0 / sqrt(air.dot(air))))]


@pytest.mark.parametrize("part", [Broken(), Dividing()])
def test_a_part_that_cannot_be_evaluated_may_feel_air_and_hides_no_other_force(part):
    beside = dataclasses.replace(CASE, wind=UP, forces=(part, Nudge()))
    assert [line.partition(":")[0] for line in without_effect(beside)] == [
        "environment.forces[1]"
    ]


@immutable
class HeadingsOnly(Estimator):
    """A user's estimator that reads the full state and one sensor, by ``get``."""

    def step(self, memory: Any, readings: Any, command: Any, dt: float) -> Any:
        assert readings.get("compass") is not None
        return memory, readings[FULL_STATE]


def test_a_sensor_that_only_the_log_reads_is_said():
    compass, satellites = (
        skyarm.NamedSensor(name="compass", sensor=Heading()),
        skyarm.NamedSensor(name="satellites", sensor=Position()),
    )
    both = dataclasses.replace(CASE, sensors=(compass, satellites))
    assert [line.partition(":")[0] for line in without_effect(both)] == [
        "sensors.compass",
        "sensors.satellites",
    ]
    (line,) = without_effect(dataclasses.replace(both, estimator=HeadingsOnly()))
    assert (
        line
        == "sensors.satellites: only the log has its readings, the law does not; an"
        " [estimator] for it?"
    )


PAGE = (Path(__file__).resolve().parents[2] / "docs" / "sensors.md").read_text("utf-8")
ESTIMATED = tomllib.loads(
    re.findall(r'```toml title="estimated\.toml"\n(.*?)```', PAGE, re.DOTALL)[0]
)


def test_noise_and_age_of_a_full_state_that_no_estimator_reads_are_said():
    full = ESTIMATED | {
        "delays": {"measurement": 0.02},
        "sensors": ESTIMATED["sensors"] | {"position": 0.01},
    }
    own, late = skyarm.scenario_from(ESTIMATED), skyarm.scenario_from(full)
    assert without_effect(own) == ()
    lines = [line.partition("; ")[0] for line in without_effect(late)]
    words = "is of the full state, which the [estimator] does not read"
    assert lines == [f"sensors.position: {words}", f"delays.measurement: {words}"]
    assert late.controller.par == own.controller.par, "the estimate is of the present"
    assert (
        under_law(late, "centroidal_joint").controller.par
        == under_law(own, "centroidal_joint").controller.par
    )
    without = {word: table for word, table in full.items() if word != "estimator"}
    assert skyarm.scenario_from(without).controller.par != own.controller.par, (
        "a late state is predicted over"
    )
    compass = (skyarm.NamedSensor(name="compass", sensor=Heading()),)
    noisy = dataclasses.replace(
        CASE,
        sensors=compass,
        estimator=HeadingsOnly(),
        noise=SensorNoise(position=0.01),
    )
    assert without_effect(noisy) == (), "it reads the state"


def test_loading_a_file_warns_once_and_a_calm_one_does_not(tmp_path):
    text = VERTICAL
    (tmp_path / "lift.toml").write_text(text)
    with pytest.warns(
        WithoutEffectWarning, match="^lift: environment.wind: moves the air along z, "
    ) as caught:
        skyarm.load_scenario(tmp_path / "lift.toml")
    assert len(caught) == 1
    (tmp_path / "calm.toml").write_text(text.replace("1.5", "0.0"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        skyarm.load_scenario(tmp_path / "calm.toml")


VERTICAL = """schema = 1
name = "lift"
duration = 1.0
plant = { vehicle = "hummingbird" }
controller = { preset = "centroidal_joint" }
reference = { base = { kind = "hover", position = [0.0, 0.0, 1.0] } }
environment = { wind = { mode = "moving_air", velocity = [0.0, 0.0, 1.5] } }
"""


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name", [name for name in list_vehicles() if name != "hummingbird_arm2"]
)
def test_vertical_air_is_reported_of_shipped_vehicles_of_upright_rotors_without_area(
    name, tmp_path
):
    vehicle = skyarm.load_vehicle(name)
    still = '{ kind = "constant", value = 0.0 }'
    joints = f", joints = [{', '.join([still] * vehicle.n)}]" if vehicle.n else ""
    text = VERTICAL.replace('"hummingbird"', f'"{name}"').replace(
        "1.0] } }", f"1.0] }}{joints} }}"
    )
    (tmp_path / "lift.toml").write_text(text)
    felt = any(vehicle.drag.area) or name == "tilted_hexarotor"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        skyarm.load_scenario(tmp_path / "lift.toml")
    assert len(caught) == (not felt)
