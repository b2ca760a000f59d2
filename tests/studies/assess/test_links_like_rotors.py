"""``check`` finds rotors that stand as driven joints, and leaves arms of joints without
limits alone.
"""

from __future__ import annotations

import math

import pytest

from skyarm.studies.assess.assessment import assess_vehicle
from skyarm.studies.assess.layout import links_like_rotors
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import joint, limits, link, robot, saved

AROUND = [(0.3, 0.0), (0.0, 0.3), (-0.3, 0.0), (0.0, -0.3)]
ASIDE = [(0.3, 0.0), (0.3, 0.1), (0.3, -0.1), (0.25, 0.0)]


def spun(name, place, parent="hull", axis="0 0 1", effort=5.0, mass=0.02):
    x, y = place
    limit = f'<limit effort="{effort}" velocity="100"/>' if effort else ""
    return (
        link(name, (6e-4, 6e-4, 6e-4), mass)
        + f'<joint name="{name}_joint" type="continuous"><parent'
        f' link="{parent}"/><child link="{name}"/><origin xyz="{x} {y} 0"/><axis'
        f' xyz="{axis}"/>{limit}</joint>'
    )


def of(tmp_path, *parts):
    return load_vehicle(saved(tmp_path, robot(link("hull", mass=2.0), *parts)))


@pytest.mark.parametrize(
    "form",
    [
        "rotor{}",
        "prop_{}_link",
        "m{}_prop",
        "front_propeller_{}",
        "motor_{}",
        "FrontRotor{}",
    ],
)
def test_names_of_rotors(tmp_path, form):
    names = [form.format(k) for k in (1, 2)]
    vehicle = of(
        tmp_path,
        *(
            spun(name, place, axis="1 0 0")
            for name, place in zip(names, ASIDE, strict=False)
        ),
    )
    assert links_like_rotors(vehicle) == names


@pytest.mark.parametrize("count", [3, 4])
def test_places_of_rotors(tmp_path, count):
    turn = [2.0 * math.pi * k / count for k in range(count)]
    places = [(0.3 * math.cos(a), 0.3 * math.sin(a)) for a in turn]
    vehicle = of(tmp_path, *(spun(f"x{k}", place) for k, place in enumerate(places)))
    assert links_like_rotors(vehicle) == [f"x{k}" for k in range(count)]


@pytest.mark.parametrize(
    "parts",
    [
        [spun(f"x{k}", place) for k, place in enumerate(ASIDE)],  # fans at one side
        # wheels
        [spun(f"x{k}", place, axis="0 1 0") for k, place in enumerate(AROUND)],
        # not alike
        [spun(f"x{k}", place, mass=0.02 + 0.01 * k) for k, place in enumerate(AROUND)],
        [spun(f"x{k}", place) for k, place in enumerate(AROUND[::2])],  # two arms
        [spun("rotor", (0.1, 0.0))],  # one of them
        # an arm
        [
            spun("motor_1", (0.1, 0)),
            spun("motor_2", (0, 0), "motor_1"),
            spun("motor_3", (0, 0), "motor_2"),
        ],
        [
            link("motor_1"),
            joint("j", "hull", "motor_1", limits()),
            link("motor_2"),
            joint("k", "hull", "motor_2", limits()),
        ],
    ],
)
def test_an_arm_stays_an_arm(tmp_path, parts):
    assert links_like_rotors(of(tmp_path, *parts)) == []


def faults(vehicle):
    return {
        each.question: each
        for each in assess_vehicle(vehicle, poses=4).alarms()
        if each.level == "fault"
    }


def test_driven_ones_cannot_fly_and_the_cure_works(tmp_path):
    parts = [spun(f"rotor{k}", place) for k, place in enumerate(AROUND)]
    found = faults(of(tmp_path, *parts))
    assert "rotor0, rotor1, rotor2, rotor3" in found["rotors as joints"].text
    assert '[[rotors]] link = "rotor0"' in found["rotors as joints"].remedy
    assert 'add [[rotors]], link = "rotor0"' in found["rotors"].remedy
    assert "skyarm new vehicle NAME --from FILE" in found["rotors"].remedy
    text = (
        'schema = 1\nname = "v"\nurdf = "r.urdf"\n[rotor_defaults]\nthrust_coefficient'
        " = 1.2e-5\n"
    )
    text += "moment_coefficient = 0.03\nmax_speed = 1200.0\n"
    for k in range(4):
        text += (
            f'[[rotors]]\nname = "rotor{k}"\nlink = "rotor{k}"\ndirection ='
            f' "{("cw", "ccw")[k % 2]}"\n'
        )
    assert faults(load_vehicle(saved(tmp_path, text, "v.toml"))) == {}
    airframe = text.replace('urdf = "r.urdf"', 'urdf = "r.urdf"').replace(
        "link = ", "position = [0, 0, 0] # "
    )
    assert "rotors as joints" in faults(
        load_vehicle(saved(tmp_path, airframe, "joints.toml"))
    )


def test_the_one_that_was_forgotten_is_no_joint_of_an_arm(tmp_path):
    """Five of six stated rotors span the wrench, so that only the sixth one's name
    tells.
    """
    places = [
        (0.3 * math.cos(k * math.pi / 3), 0.3 * math.sin(k * math.pi / 3))
        for k in range(6)
    ]
    of(tmp_path, *(spun(f"rotor{k}", place) for k, place in enumerate(places)))
    text = (
        'schema = 1\nname = "v"\nurdf = "r.urdf"\n[rotor_defaults]\nthrust_coefficient'
        " = 1.2e-5\n"
    )
    text += "moment_coefficient = 0.03\nmax_speed = 1200.0\n"
    tables = [
        f'[[rotors]]\nname = "r{k}"\nlink = "rotor{k}"\ndirection ='
        f' "{("cw", "ccw")[k % 2]}"\n'
        for k in range(6)
    ]
    found = faults(load_vehicle(saved(tmp_path, text + "".join(tables[:5]), "v.toml")))
    assert "joints of rotor5 turn without limits" in found["rotors as joints"].text
    assert faults(load_vehicle(saved(tmp_path, text + "".join(tables), "v.toml"))) == {}


def test_passive_ones_are_no_fault_of_their_own(tmp_path):
    found = faults(
        of(
            tmp_path,
            *(spun(f"rotor{k}", place, effort=0) for k, place in enumerate(AROUND)),
        )
    )
    assert list(found) == ["rotors"]


def test_each_gap_is_a_fault(tmp_path):
    motor = (
        "<plugin name='m'><linkName>hull</linkName>"
        "<motorConstant>1e-5</motorConstant></plugin>"
    )
    found = faults(of(tmp_path, motor))
    assert found["rotors"].text.startswith(
        "rotors hull: the file states no direction, moment_coefficient, max_speed"
    )
    assert "skyarm new vehicle NAME --from FILE" in found["rotors"].remedy
