"""``[rotor_file]``: rotors beside the bodies, from a platform of eagle-mpc or
parameters of PX4.
"""

from __future__ import annotations

import math
import struct
import sys

import numpy as np
import pytest

from skyarm.vehicle import VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import link, robot, saved

LAG = "[rotor_defaults]\ntime_constant_up = 0.02\ntime_constant_down = 0.03\n"
ALL = LAG + "thrust_coefficient = 9e-6\nmoment_coefficient = 0.015\nmax_speed = 900.0\n"
EAGLE = """platform:
    cf: 6.5e-06
    cm: 1.17e-7
    max_thrust: 7.865
    min_thrust: 0.08
    base_link_name: "hull"
    n_rotors: 2
    $rotors:
        - translation: [0.3, -0.1, 0.02]
          orientation: [0.3, 0.1, 0.2, 0.9]  # x, y, z, w
          spin_direction: [-1] # ccw
        - translation: [-0.3, 0.1, 0.02]
          orientation: [0, 0, 0, 1]
          spin_direction: [1]
"""
AIRFRAME = """#!/bin/sh
param set-default CA_ROTOR_COUNT 3
param set-default CA_ROTOR0_PX 0.3
  param set-default CA_ROTOR0_PY 0.4
# param set-default CA_ROTOR0_KM -9
param set CA_ROTOR1_PX -0.5
param set-default CA_ROTOR1_KM -0.05
param set-default CA_ROTOR2_PX 0.1
param set-default CA_ROTOR2_PZ -0.2
param set-default CA_ROTOR2_AX 0.6
param set-default CA_ROTOR2_AZ -0.8
param set-default CA_ROTOR2_KM 0.01
"""


def flying(tmp_path, file, text, more="", tables=ALL):
    saved(tmp_path, robot(link("hull", mass=1.2)))
    if isinstance(text, str):
        saved(tmp_path, text, file)
    table = (
        'schema = 1\nname = "v"\nurdf = "r.urdf"\n[rotor_file]\nfile ='
        f' "{file}"\n{more}'
    )
    return load_vehicle(saved(tmp_path, table + tables, "v.toml"))


def test_a_platform_of_eagle_mpc(tmp_path):
    first, second = flying(tmp_path, "p.yaml", EAGLE, tables=LAG).rotors
    assert (first.name, first.direction, second.direction) == ("rotor_0", 1, -1)
    assert list(first.position) == [0.3, -0.1, 0.02]
    x, y, z, w = np.array([0.3, 0.1, 0.2, 0.9]) / math.sqrt(0.95)
    by_hand = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    assert list(first.axis) == pytest.approx(by_hand, abs=1e-15)
    assert first.thrust_coefficient == 6.5e-06
    assert first.moment_coefficient == pytest.approx(0.018, rel=1e-14)
    assert first.max_speed == pytest.approx(1100.0, rel=1e-14)
    assert (first.time_constant_up, first.time_constant_down) == (0.02, 0.03)


@pytest.mark.parametrize("text", ["65e-7", "65E-7", "+65.e-7", ".65e-5", "6.5E-06"])
def test_numbers_without_a_point_or_sign_are_numbers(tmp_path, text):
    for rotor in flying(
        tmp_path, "p.yaml", EAGLE.replace("6.5e-06", text), tables=LAG
    ).rotors:
        assert (
            rotor.thrust_coefficient == float(text) == pytest.approx(6.5e-06, rel=1e-15)
        )
    with pytest.raises(
        VehicleError, match=r"platform\.cf = '65e-7': must be a finite number"
    ):
        flying(tmp_path, "p.yaml", EAGLE.replace("6.5e-06", '"65e-7"'), tables=LAG)


def test_its_torque_is_that_of_its_own_formula(tmp_path):
    """Torque on the base by eagle-mpc's code: p x f + spin cm / cf f."""
    for rotor, spin in zip(
        flying(tmp_path, "p.yaml", EAGLE, tables=LAG).rotors, (-1, 1), strict=True
    ):
        assert -rotor.direction * rotor.moment_coefficient == pytest.approx(
            spin * 1.17e-7 / 6.5e-06, rel=1e-14
        )


@pytest.mark.parametrize(
    ("bits", "reversed_ones"), [("", []), ("0", []), ("5", [0, 2]), ("255", [0, 1, 2])]
)
def test_reversible_motors_of_px4(tmp_path, bits, reversed_ones):
    """CA_R_REV of PX4's module.yaml: a bit for each motor, the lowest for the first."""
    text = AIRFRAME + (f"param set-default CA_R_REV {bits}\n" if bits else "")
    rotors = flying(tmp_path, "4000_frame", text, "arm_length = 0.25\n").rotors
    assert [k for k, each in enumerate(rotors) if each.reversible] == reversed_ones


@pytest.mark.parametrize("bits", ["-1", "4096", "1.5"])
def test_a_bit_mask_of_reversible_motors_is_a_whole_number(tmp_path, bits):
    with pytest.raises(
        VehicleError, match=r"CA_R_REV = .*: must be a whole number from 0 to 4095"
    ):
        flying(
            tmp_path,
            "4000_frame",
            f"{AIRFRAME}param set-default CA_R_REV {bits}\n",
            "arm_length = 0.25\n",
        )


def test_what_a_platform_lacks_is_said(tmp_path):
    vehicle = flying(tmp_path, "p.yaml", EAGLE, tables="")
    (gap,) = vehicle.gaps
    assert (
        "states no time_constant_up (eagle-mpc's rotors have no lag),"
        " time_constant_down" in gap
    )
    assert dict(vehicle.sources)["rotors.moment_coefficient"] == "cm / cf of p.yaml"
    assert "0.08 N in p.yaml; not read" in dict(vehicle.sources)["rotors.min_thrust"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("cf: 6.5e-06", "cf: 0", "platform.cf = 0: must be"),
        ("cf: 6.5e-06", "cg: 1", "platform.cf: is missing"),
        (
            "n_rotors: 2",
            "n_rotors: 3",
            "platform.n_rotors = 3: must be the number of rotors, 2",
        ),
        ("[0.3, -0.1, 0.02]", "[0.3, -0.1, .nan]", "translation"),
        ("[0, 0, 0, 1]", "[0, 0, 0, 0]", "orientation = .*must be the four numbers"),
        (
            "spin_direction: [1]",
            "spin_direction: [2]",
            "spin_direction = .*must be .1. .cw.",
        ),
        ("platform:", "platform: [", "YAML = .*must be well-formed"),
        ("platform:", "plat:", "must state rotors: a platform of eagle-mpc"),
        ('"hull"', '"hulk"', "link = 'hulk': must be one of base"),
    ],
)
def test_a_wrong_platform_is_refused_in_one_line(tmp_path, old, new, words):
    with pytest.raises(VehicleError, match=words) as refusal:
        flying(tmp_path, "p.yaml", EAGLE.replace(old, new, 1), tables=LAG)
    assert "\n" not in str(refusal.value)


def test_without_pyyaml_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(VehicleError, match=r"file = 'p.yaml': needs the extra 'yaml'"):
        flying(tmp_path, "p.yaml", EAGLE)


def test_a_platform_alone_says_what_it_lacks(tmp_path):
    with pytest.raises(
        VehicleError,
        match=r"has no bodies; its rotors stand beside bodies .*\[rotor_file\] file = ",
    ):
        load_vehicle(saved(tmp_path, EAGLE, "p.yaml"))


def test_parameters_of_an_airframe(tmp_path):
    rotors = flying(tmp_path, "4000_frame", AIRFRAME, "arm_length = 0.25\n").rotors
    # the first by PX4's default, 0.05
    assert [each.direction for each in rotors] == [1, -1, 1]
    # forward, left, up
    places = [(0.15, -0.2, 0.0), (-0.25, 0.0, 0.0), (0.05, 0.0, 0.1)]
    assert [list(each.position) for each in rotors] == [
        pytest.approx(each, abs=1e-15) for each in places
    ]
    assert [list(each.axis) for each in rotors] == [
        [0, 0, 1],
        [0, 0, 1],
        pytest.approx([0.6, 0.0, 0.8]),
    ]


def test_parameters_of_a_ground_station(tmp_path):
    rows = [
        "# Onboard parameters",
        "#",
        "1\t1\tCA_ROTOR_COUNT\t2\t6",
        "1\t1\tCA_ROTOR0_PX\t1.0\t9",
    ]
    rows += [
        "1\t1\tCA_ROTOR1_PX\t-1.0\t9",
        "1\t1\tCA_ROTOR1_KM\t-0.05\t9",
        "1\t1\tCBRK_BUZZER\t0\t6",
    ]
    rotors = flying(tmp_path, "v.params", "\n".join(rows), "arm_length = 0.3\n").rotors
    assert [(list(each.position), each.direction) for each in rotors] == [
        ([0.3, 0, 0], 1),
        ([-0.3, 0, 0], -1),
    ]


def message(kind, body):
    return struct.pack("<H", len(body)) + kind + body


def test_parameters_of_a_log(tmp_path):
    """A ULog: header, flag bits, parameters; format by PX4's description of ULog
    files.
    """
    data = (
        b"ULog\x01\x12\x35\x01"
        + struct.pack("<Q", 1_000_000)
        + message(b"B", bytes(40))
    )
    values = {
        "CA_ROTOR_COUNT": 2,
        "CA_ROTOR0_PY": 0.5,
        "CA_ROTOR1_PY": -0.5,
        "CA_ROTOR1_KM": -0.25,
        "MAV_TYPE": 2,
    }
    for name, value in values.items():
        whole = isinstance(value, int)
        key = f"{'int32_t' if whole else 'float'} {name}".encode()
        data += message(
            b"P", bytes([len(key)]) + key + struct.pack("<i" if whole else "<f", value)
        )
    (tmp_path / "log.ulg").write_bytes(data)
    rotors = flying(tmp_path, "log.ulg", None, "arm_length = 0.2\n").rotors
    assert [(list(each.position), each.direction) for each in rotors] == [
        ([0, -0.2, 0], 1),
        ([0, 0.2, 0], -1),
    ]


def test_what_parameters_lack_is_said(tmp_path):
    (gap,) = flying(tmp_path, "4000_frame", AIRFRAME, tables="").gaps
    assert "thrust_coefficient (CA_ROTOR*_CT is per squared output, not speed)" in gap
    assert "moment_coefficient (CA_ROTOR*_KM counts by its sign only), max_speed" in gap
    assert (
        "position ([rotor_file] arm_length, m, scales them: the longest arm is 0.5 in"
        " the file)" in gap
    )


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            "param set-default CA_ROTOR0_KM 0\n",
            r"rotors rotor_0: the file states no direction",
        ),
        (
            "param set-default CA_ROTOR1_TILT 1\n",
            r"rotors rotor_1: the file states no tilt \(CA_ROTOR\*_TILT names a",
        ),
        (
            "param set-default CA_ROTOR_COUNT 4\n",
            r"CA_ROTOR_COUNT = '4': stands twice, with 3 before",
        ),
        (
            "param set-default CA_ROTOR0_AZ ${A}\n",
            r"CA_ROTOR0_AZ = '\$\{A\}': must be a finite number",
        ),
        (
            "param set-default CA_ROTOR0_AZ 0\n",
            r"CA_ROTOR0_AX, AY, AZ = .*must have a direction",
        ),
    ],
)
def test_wrong_parameters_are_refused_in_one_line(tmp_path, more, words):
    with pytest.raises(VehicleError, match=words):
        flying(tmp_path, "4000_frame", AIRFRAME + more, "arm_length = 0.25\n")


@pytest.mark.parametrize(
    ("file", "text", "more", "words"),
    [
        (
            "p.yaml",
            EAGLE,
            "arm_length = 0.3\n",
            r"rotor_file.arm_length = 0.3: unknown field",
        ),
        ("4000_frame", AIRFRAME, "arm_length = -1\n", r"rotor_file.arm_length = -1"),
        (
            "4000_frame",
            "param set SIM 1\n",
            "",
            r"rotor_file.file = '4000_frame': must state rotors",
        ),
        (
            "4000_frame",
            "param set CA_ROTOR0_PX 1\n",
            "",
            r"CA_ROTOR_COUNT = 0.0: must be 1 ... 12",
        ),
        ("nowhere.params", None, "", r"rotor_file.file = 'nowhere.params': "),
        ("log.ulg", "no log", "", r"file = 'log.ulg': must be a log of PX4"),
    ],
)
def test_a_wrong_rotor_file_is_refused(tmp_path, file, text, more, words):
    with pytest.raises(VehicleError, match=words):
        flying(tmp_path, file, text, more)


def test_bodies_with_rotors_take_no_rotor_file(tmp_path):
    saved(tmp_path, AIRFRAME, "frame")
    motor = (
        "<plugin"
        " name='m'><linkName>hull</linkName><motorConstant>1e-5</motorConstant>"
        "</plugin>"
    )
    saved(tmp_path, robot(link("hull"), motor))
    text = 'schema = 1\nname = "v"\nurdf = "r.urdf"\n[rotor_file]\nfile = "frame"\n'
    with pytest.raises(
        VehicleError, match="must be left out: the file of the bodies states rotors"
    ):
        load_vehicle(saved(tmp_path, text, "v.toml"))


def test_a_wrong_platform_names_its_own_file(tmp_path):
    (tmp_path / "p.yaml").write_text("platform: {cf: -1, cm: 1, max_thrust: 3}")
    with pytest.raises(
        VehicleError, match=r"p\.yaml: platform\.cf = -1: must be above 0"
    ):
        load_vehicle(tmp_path / "p.yaml")
