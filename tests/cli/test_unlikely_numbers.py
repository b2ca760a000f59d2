"""Numbers in other units are told of in one line and never refused; nothing shipped is
suspected.
"""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path
from typing import Any

import pytest
from command_files import CASE1, VEHICLE, succeeded

from skyarm.algebra import Sym3, Vec3
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import list_scenarios, load_scenario
from skyarm.scenario.unlikely_numbers import unlikely_in_vehicle, unlikely_numbers
from skyarm.studies.compare.suite import PAPER_CASES
from skyarm.studies.sweep.study_file import list_studies, load_study
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from support.cases import sampled
from support.commands import skyarm

BIRD = load_vehicle("hummingbird_arm2_rotors")
OCTO = load_vehicle("octo_coaxial_two_arms")


@pytest.mark.parametrize("name", list_vehicles())
def test_no_shipped_vehicle_is_suspected(name: str) -> None:
    assert unlikely_in_vehicle(load_vehicle(name)) == ()


@pytest.mark.parametrize("name", sampled(list_scenarios(), 100, keep=PAPER_CASES))
def test_no_shipped_scenario_is_suspected(name: str) -> None:
    assert unlikely_numbers(load_scenario(name)) == ()


@pytest.mark.parametrize("name", list_studies())
def test_no_shipped_study_is_suspected(name: str) -> None:
    for scenario in load_study(name).scenarios.values():
        assert unlikely_numbers(scenario) == ()


def joint(vehicle: Any, index: int, **fields: Any) -> Any:
    links = list(vehicle.links)
    links[index] = dataclasses.replace(
        links[index], joint=dataclasses.replace(links[index].joint, **fields)
    )
    return dataclasses.replace(vehicle, links=tuple(links))


def rotors(vehicle: Any, **fields: Any) -> Any:
    return dataclasses.replace(
        vehicle,
        rotors=tuple(dataclasses.replace(each, **fields) for each in vehicle.rotors),
    )


def base(vehicle: Any, **fields: Any) -> Any:
    return dataclasses.replace(
        vehicle, base=dataclasses.replace(vehicle.base, **fields)
    )


PRISMATIC = next(
    i for i, link in enumerate(OCTO.links) if link.joint.kind == "prismatic"
)
RPM = 60.0 / (2.0 * math.pi)

SLIPS = {
    "rev/min": (
        rotors(BIRD, max_speed=838.0 * RPM),
        r"^rotors: max_speed = 8002.* lifts 272 times the weight; rad/s",
    ),
    "grams": (base(BIRD, mass=716.0), r"^mass = 716.* kg: .*kg, not g"),
    "thrust per rev/min": (
        rotors(BIRD, thrust_coefficient=8.5e-6 / RPM**2),
        r"lifts 0\.0325 times the weight",
    ),
    "degrees up": (
        joint(BIRD, 0, upper=90.0),
        r"^links\[\w+\]\.joint\.upper = 90 rad: .*not degrees",
    ),
    "degrees down": (
        joint(BIRD, 1, lower=-90.0),
        r"^links\[\w+\]\.joint\.lower = -90 rad: .*not degrees",
    ),
    "millimetres of travel": (
        joint(OCTO, PRISMATIC, upper=300.0),
        r"\.upper = 300 m: is more than 10; m, not mm",
    ),
    "newton millimetres": (
        joint(BIRD, 0, effort_limit=5e5),
        r"^links\[\w+\]\.joint\.effort_limit = 5.* N m: .*N mm",
    ),
    "kg cm^2": (
        base(BIRD, inertia=Sym3(70.0, 70.0, 120.0)),
        (
            r"^base\.inertia = 120 kg m\^2: is that of its 0\.\d+ kg 1\d\.\d m away,"
            r" and the vehicle reaches"
        ),
    ),
    "millimetres": (
        joint(BIRD, 1, position=Vec3(0.0, 0.0, -150.0)),
        r"^links\[\w+\]\.joint\.position = 150 m: .*mm",
    ),
    "milliseconds": (
        rotors(BIRD, time_constant_up=12.5),
        r"^rotors\[front\]\.time_constant_up = 12\.5 s: .*not ms",
    ),
    "millimetres of torque": (
        rotors(BIRD, moment_coefficient=16.0),
        r"^rotors\[front\]\.moment_coefficient = 16 m: ",
    ),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_a_slip_of_units_in_a_vehicle_is_one_line(slip: str) -> None:
    vehicle, words = SLIPS[slip]
    lines = unlikely_in_vehicle(vehicle)
    assert any(re.search(words, line) for line in lines), lines
    assert all("\n" not in line for line in lines)


def test_bounds_leave_what_flies_alone() -> None:
    turn = 2.0 * math.pi
    for vehicle in (
        joint(BIRD, 0, lower=-turn, upper=turn),
        joint(BIRD, 0, upper=math.inf),
        rotors(BIRD, max_speed=math.inf),
        rotors(BIRD, max_speed=838.0 * (19.9 / 2.98) ** 0.5),
        base(BIRD, mass=45.0),
        dataclasses.replace(BIRD, rotors=()),
    ):
        assert unlikely_in_vehicle(vehicle) == ()


CASE, WINDY = load_scenario("case3"), load_scenario("case3_wind")


def of_numbers(**values: float) -> Any:
    return with_numbers(
        WINDY if any("wind" in path for path in values) else CASE,
        {path.replace("__", "."): value for path, value in values.items()},
    )


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"sensors__position": 2.0}, r"^sensors\.position = 2 m: .* m, not mm"),
        ({"sensors__attitude": 1.0}, r"^sensors\.attitude = 1 rad: .*not degrees"),
        ({"sensors__rate": 10.0}, r"^sensors\.rate = 10 rad/s"),
        (
            {"initial__joints__0": 45.0},
            r"^initial\.joints\[0\] = 45 rad: .*not degrees",
        ),
        ({"initial__rate__x": 90.0}, r"^initial\.rate = 90 rad/s"),
        ({"initial__position__x": 3000.0}, r"^initial\.position = 3000 m"),
        ({"reference__base__radius": 3000.0}, r"^reference\.base reaches 300\d m"),
        (
            {"reference__joints__0__amplitude": 30.0},
            r"^reference\.joints\[0\] reaches -?30 rad: .*not degrees",
        ),
        ({"plant__gravity": 981.0}, r"^plant\.gravity = 981 m/s\^2"),
        ({"model__gravity": 981.0}, r"^model\.gravity = 981 m/s\^2"),
        (
            {"plant__payload__mass": 50.0},
            r"^plant\.vehicle of 50\.\d+ kg, model\.vehicle of 0\.8",
        ),
        (
            {"environment__wind__force_W__x": 900.0},
            r"^environment\.wind\.force_W = 900 N: is more than 500",
        ),
        (
            {"environment__wind__air_velocity_W__x": 90.0},
            r"^environment\.wind\.air_velocity_W = 90 m/s: .*not km/h",
        ),
        (
            {"plant__vehicle__rotors__front__time_constant_up": 12.5},
            r"^plant: rotors\[front\]\.time_constant_up",
        ),
        (
            {"model__vehicle__rotors__front__time_constant_up": 12.5},
            r"^model: rotors\[front\]\.time_constant_up",
        ),
    ],
)
def test_a_slip_of_units_in_a_scenario_is_one_line(
    values: dict[str, float], words: str
) -> None:
    lines = unlikely_numbers(of_numbers(**values))
    assert any(re.search(words, line) for line in lines), lines


def test_delays_and_yaws_are_looked_at(tmp_path: Path) -> None:
    late = dataclasses.replace(
        CASE, delays=dataclasses.replace(CASE.delays, measurement=5.0, command=2.0)
    )
    assert [line.split(":")[0] for line in unlikely_numbers(late)] == [
        "delays.measurement = 5 s",
        "delays.command = 2 s",
    ]
    text = CASE1.replace(
        "[reference.base]", "[reference]\nyaw = 90.0\n[reference.base]"
    )
    (tmp_path / "yaw.toml").write_text(text)
    (line,) = unlikely_numbers(load_scenario(tmp_path / "yaw.toml"))
    assert line.startswith("reference.yaw = 90 rad at the start")


def test_commands_warn_and_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "v.toml").write_text(
        re.sub(r"max_speed = \S+", "max_speed = 8000.0", VEHICLE)
    )
    (tmp_path / "s.toml").write_text(
        CASE1.replace('"hummingbird_arm2_rotors"', '"v.toml"')
    )
    said = "rotors: max_speed = 8000 rad/s: lifts"
    shown = skyarm("show", "v.toml")
    assert shown.code == 0
    assert shown.err.startswith(f"skyarm: warning: hummingbird_arm2_rotors: {said}")
    for words in (
        ("run", "s.toml", "--duration", "0.1"),
        ("margins", "s.toml", "--instants", "0"),
    ):
        ended = skyarm(*words)
        assert ended.code == 0, ended.err
        assert ended.err.startswith(f"skyarm: warning: case1: plant: {said}")
        assert ended.err.count("\n") == 1


def test_a_vehicle_that_is_wrong_throughout_gets_a_few_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = re.sub(r"time_constant_(up|down) = \S+", r"time_constant_\1 = 20.0", VEHICLE)
    far = re.compile(r"position = \[(.*?)\]")
    text = far.sub(
        lambda found: (
            "position ="
            f" [{', '.join(f'{1e3 * float(c)}' for c in found[1].split(','))}]"
        ),
        text,
    )
    (tmp_path / "v.toml").write_text(
        re.sub(r"moment_coefficient = \S+", "moment_coefficient = 16.0", text)
    )
    lines = skyarm("show", "v.toml").err.splitlines()
    assert len(lines) == 6


def test_show_prints_limits_inertias_and_motor_constants_with_units() -> None:
    text = succeeded(skyarm("show", "hexarotor_arm6", columns=160))
    flat = " ".join(text.split())
    assert re.search(r"^elbow +0 1 0 +0 0 -0\.22 +-2\.4 +2\.4 +4 ", text, re.MULTILINE)
    for part in (
        "effort limit, N m or N",
        "0.0005 0.00051 4e-05",
        "0.062 0.064 0.108",
        "kg m^2",
    ):
        assert part in flat, part
    for part in (
        "thrust coefficient, N s^2/rad^2 2.5e-05",
        "time constant down, s 0.05",
        "max speed, rad/s 750",
    ):
        assert part in flat, part
    prismatic = succeeded(skyarm("show", "octo_coaxial_two_arms", columns=160))
    assert re.search(r"prismatic .* 40 ", prismatic)


def test_air_that_moves_about_a_vehicle_without_drag_is_told_of() -> None:
    from skyarm.vehicle.vehicle_records import BodyDrag
    from skyarm.world import MovingAir

    calm = load_scenario("case3")
    rotors = [
        dataclasses.replace(rotor, drag_coefficient=0, rolling_moment_coefficient=0)
        for rotor in calm.plant.vehicle.rotors
    ]
    still = dataclasses.replace(
        calm.plant.vehicle, rotors=tuple(rotors), drag=BodyDrag()
    )
    calm = dataclasses.replace(
        calm, plant=dataclasses.replace(calm.plant, vehicle=still)
    )
    air = MovingAir(velocity_W=(3.0, 0.0, 0.0))
    told = unlikely_numbers(dataclasses.replace(calm, wind=air))
    assert [
        line
        for line in told
        if line.startswith("environment.wind: moves the air along x, where ")
    ]
    told = unlikely_numbers(dataclasses.replace(calm, air=(air,)))
    assert [
        line for line in told if line.startswith("environment.air[0]: moves the air")
    ]
    assert unlikely_numbers(dataclasses.replace(calm, wind=MovingAir())) == ()
    body = dataclasses.replace(
        calm.plant.vehicle, drag=BodyDrag(area=(0.01, 0.01, 0.01))
    )
    rotors = [
        dataclasses.replace(rotor, drag_coefficient=1e-5)
        for rotor in calm.plant.vehicle.rotors
    ]
    for vehicle in (
        body,
        dataclasses.replace(calm.plant.vehicle, rotors=tuple(rotors)),
    ):
        world = dataclasses.replace(calm.plant, vehicle=vehicle)
        assert unlikely_numbers(dataclasses.replace(calm, wind=air, plant=world)) == ()
