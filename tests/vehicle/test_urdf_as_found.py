"""URDF files as they are found: followers, passive joints, inertias a little off,
meshes, and what is noted of them.
"""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from skyarm.algebra import Sym3
from skyarm.plant.joint_rate import friction_rate
from skyarm.vehicle import Body, VehicleError
from skyarm.vehicle.inertia_repair import nearest_inertia
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import agrees, joint, limits, link, pinocchio_of, robot, saved


def loaded(tmp_path, text):
    return load_vehicle(saved(tmp_path, text))


def in_toml(tmp_path, text, more):
    saved(tmp_path, text)
    return load_vehicle(
        saved(tmp_path, f'schema = 1\nname = "v"\nurdf = "r.urdf"\n{more}\n', "v.toml")
    )


GRIPPER = robot(
    link("b"),
    link("arm"),
    link("left"),
    link("right"),
    link("nail"),
    joint("elbow", "b", "arm", limits()),
    joint("j_left", "arm", "left", limits(0.3, 0.9), "prismatic"),
    joint(
        "j_right",
        "arm",
        "right",
        limits() + '<mimic joint="j_left" multiplier="-1.5" offset="0.2"/>',
    ),
    joint(
        "j_nail",
        "right",
        "nail",
        limits() + '<mimic joint="j_right" multiplier="2"/>',
        "prismatic",
    ),
)


def test_followers_are_locked_where_their_leaders_limit_lets_them_rest(tmp_path):
    vehicle = loaded(tmp_path, GRIPPER)
    assert [each.joint.name for each in vehicle.links] == ["elbow", "j_left"]
    assert {frame.name for frame in vehicle.frames} == {"right", "nail"}
    assert any(
        note.startswith("joint j_right: follows j_left: fixed at -0.25")
        for note in vehicle.notes
    )
    held = {
        "elbow": (0.4, 1, 0),
        "j_left": (0.5, 1, 1),
        "j_right": (-1.5 * 0.3 + 0.2, 0, -1),
        "j_nail": (-0.5, 0, -1),
    }
    agrees(vehicle, pinocchio_of(GRIPPER, vehicle, held), [0.4, 0.5])


def test_followers_are_coupled_by_their_ratio_where_the_file_says_so(tmp_path):
    vehicle = in_toml(tmp_path, GRIPPER, 'mimic = "couple"')
    assert [(each.name, each.leader) for each in vehicle.followers] == [
        ("right", 1),
        ("nail", 1),
    ]
    right = -1.5 * 0.5 + 0.2
    moved = {
        "elbow": (0.4, 1, 0),
        "j_left": (0.5, 1, 1),
        "j_right": (right, -1.5, 1),
        "j_nail": (2 * right, -3.0, 1),
    }
    agrees(vehicle, pinocchio_of(GRIPPER, vehicle, moved), [0.4, 0.5])


def test_a_leader_that_is_fixed_or_not_there_holds_its_follower_too(tmp_path):
    fixed = GRIPPER.replace('lower="0.3" upper="0.9"', 'lower="0.3" upper="0.3"')
    for vehicle in (
        loaded(tmp_path, fixed),
        in_toml(tmp_path, fixed, 'mimic = "couple"'),
    ):
        assert [each.joint.name for each in vehicle.links] == ["elbow"]
        assert any("fixed at -0.25" in note for note in vehicle.notes)
    nobody = GRIPPER.replace('joint="j_left"', 'joint="x"')
    assert any(
        "joint j_right: follows x: fixed at 0.2" in note
        for note in loaded(tmp_path, nobody).notes
    )
    with pytest.raises(
        VehicleError,
        match=r"joint\[j_right\].mimic.joint = 'x': must be one of elbow, j_left",
    ):
        in_toml(tmp_path, nobody, 'mimic = "couple"')


@pytest.mark.parametrize("mimic", ["lock", "couple"])
def test_followers_that_lead_back_are_refused(tmp_path, mimic):
    ring = GRIPPER.replace('joint="j_left"', 'joint="j_nail"')
    with pytest.raises(VehicleError, match=r"must not lead back \(j_"):
        in_toml(tmp_path, ring, f'mimic = "{mimic}"')


@pytest.mark.parametrize(
    ("kind", "more", "says"),
    [
        ("revolute", limits(effort='effort="0"'), "of effort 0, so passive"),
        ("revolute", limits(effort=""), "without an effort, so passive"),
        ("continuous", "", "without an effort, so passive"),
        ("prismatic", "", "without an effort, so passive"),
    ],
)
def test_a_joint_without_effort_is_passive_until_a_vehicle_file_gives_it_one(
    tmp_path, kind, more, says
):
    text = robot(link("b"), link("a"), joint("swing", "b", "a", more, kind))
    vehicle = loaded(tmp_path, text)
    assert vehicle.links[0].joint.effort_limit == 0.0
    assert any(note.startswith(f"joint swing: {says}") for note in vehicle.notes)
    driven = in_toml(tmp_path, text, '[[joints]]\nname = "swing"\neffort_limit = 2.0')
    assert driven.links[0].joint.effort_limit == 2.0


SERVO = (
    '[drives.swing]\nkind = "position_servo"\nstiffness = 20.0\ninertia ='
    " 0.01\ntorque_limit = 3.0\n"
)


def test_a_drive_on_a_joint_of_effort_zero_gives_its_own_torque(tmp_path):
    text = robot(
        link("b"), link("a"), joint("swing", "b", "a", limits(effort='effort="0"'))
    )
    assert in_toml(tmp_path, text, SERVO).links[0].joint.effort_limit == 3.0
    unlimited = SERVO.replace("torque_limit = 3.0\n", "")
    assert in_toml(tmp_path, text, unlimited).links[0].joint.effort_limit == math.inf
    weaker = in_toml(
        tmp_path, text, f'{SERVO}[[joints]]\nname = "swing"\neffort_limit = 2.0'
    )
    assert weaker.links[0].joint.effort_limit == 2.0
    with pytest.raises(
        VehicleError,
        match=r"joints\[swing\].effort_limit = 0.0: must be above 0.*drives.swing",
    ):
        in_toml(
            tmp_path, text, f'{SERVO}[[joints]]\nname = "swing"\neffort_limit = 0.0'
        )


def test_names_that_share_a_note_share_a_line(tmp_path):
    chain = [
        joint(f"j{k}", "b" if k == 0 else f"l{k - 1}", f"l{k}", "", "continuous")
        for k in range(6)
    ]
    vehicle = loaded(
        tmp_path, robot(link("b"), *(link(f"l{k}") for k in range(6)), *chain)
    )
    assert [note for note in vehicle.notes if "passive" in note] == [
        "joints j0, j1, j2, j3 and 2 more: without an effort, so passive; [[joints]]"
        " effort_limit gives it a drive"
    ]


def test_what_is_not_read_is_noted_and_a_parent_world_is_known(tmp_path):
    weld = (
        '<joint name="w" type="fixed"><parent link="world"/><child link="b"/></joint>'
    )
    vehicle = loaded(
        tmp_path, robot(link("b"), weld, "<transmission/><transmission/><gazebo/>")
    )
    assert {"<transmission> (2): not read", "<gazebo> (1): not read"} <= set(
        vehicle.notes
    )
    assert (vehicle.base.mass, [frame.name for frame in vehicle.frames]) == (0.5, ["b"])


def test_blank_lines_before_the_declaration_are_skipped(tmp_path):
    text = robot(link("b"))
    assert (
        loaded(tmp_path, "\n \n<?xml version='1.0'?>\n" + text).base
        == loaded(tmp_path, text).base
    )


@pytest.mark.parametrize(
    "encoding", ["gb2312", "shift_jis", "latin-1", "UTF-8", "utf8"]
)
def test_a_file_is_read_in_the_encoding_that_it_declares(tmp_path, encoding):
    name = "caf\xe9" if encoding in ("latin-1", "UTF-8", "utf8") else "\u5c71"
    text = f'<?xml version="1.0" encoding="{encoding}"?>' + robot(
        link("hull"), link(name), joint("j", "hull", name, "")
    )
    (tmp_path / "r.urdf").write_bytes(text.encode(encoding))
    assert [each.name for each in load_vehicle(tmp_path / "r.urdf").links] == [name]


@pytest.mark.parametrize("encoding", ["gb2312", "none-such"])
def test_a_file_that_is_not_in_its_encoding_is_refused_in_one_line(tmp_path, encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?>' + robot(link("caf\xe9s"))
    (tmp_path / "r.urdf").write_bytes(text.encode("latin-1"))
    with pytest.raises(VehicleError, match=r"r\.urdf: XML = .*: must be well-formed$"):
        load_vehicle(tmp_path / "r.urdf")


def test_meshes_that_are_not_there_are_noted_and_packages_are_found(tmp_path):
    package = tmp_path / "arm_description"
    (package / "urdf").mkdir(parents=True)
    (package / "meshes").mkdir()
    corners = " ".join(
        f"vertex {point}"
        for point in ("0 0 0", "1 0 0", "0 1 0", "0 0 1", "1 0 0", "0 1 0")
    )
    (package / "meshes" / "a.stl").write_text(
        f"solid {corners} endsolid", encoding="utf-8"
    )
    (package / "package.xml").write_text("<package/>", encoding="utf-8")

    def notes(*addresses):
        drawn = [
            f'<link name="l{k}"><visual><geometry><mesh'
            f' filename="{each}"/></geometry></visual></link><joint name="f{k}"'
            f' type="fixed"><parent link="b"/><child link="l{k}"/></joint>'
            for k, each in enumerate(addresses)
        ]
        path = package / "urdf" / "a.urdf"
        path.write_text(robot(link("b"), *drawn), encoding="utf-8")
        return load_vehicle(path).notes

    there = (
        "package://arm_description/meshes/a.stl",
        "package://renamed/meshes/a.stl",
        "../meshes/a.stl",
    )
    assert notes(*there) == ()
    assert notes(
        there[0], "package://arm_description/meshes/b.stl", "b.stl", "package://", ""
    ) == (
        "links l1, l2, l3, l4: a mesh file is not there; it is drawn from its joints",
    )


def beyond(share):
    """Moments whose largest exceeds the sum of the others by a share of itself."""
    return 0.02, 0.03, 0.05 / (1.0 - share)


@pytest.mark.parametrize("share", [0.01, 0.05, 0.09])
def test_an_inertia_a_little_beyond_the_triangle_is_the_nearest_real_one(
    tmp_path, share
):
    text = robot(link("b", beyond(share)).replace('ixy="0.0002"', 'ixy="0"'))
    vehicle = loaded(tmp_path, text)
    a, b, c = beyond(share)
    # the second moments (b + c - a) / 2, (c + a - b) / 2, (a + b - c) / 2 < 0: the last
    # becomes zero
    x, y = 0.5 * (b + c - a), 0.5 * (c + a - b)
    np.testing.assert_allclose(
        vehicle.base.inertia.entries[:3], (y, x, x + y), rtol=1e-14
    )
    assert vehicle.base.inertia.entries[3:] == (0, 0, 0)
    (note,) = vehicle.notes
    assert re.fullmatch(
        r"link b: inertia repaired: principal moments 0.02, 0.03, .* -> .* kg m\^2",
        note,
    )


def test_an_inertia_far_beyond_is_refused_and_not_repaired(tmp_path):
    text = robot(link("b", beyond(0.15)))
    for read in (lambda: loaded(tmp_path, text), lambda: in_toml(tmp_path, text, "")):
        with pytest.raises(
            VehicleError, match="must obey the triangle inequality"
        ) as error:
            read()
        assert "inertia repaired" not in str(error.value)


def test_moments_that_are_rounding_are_zero(tmp_path):
    """iCub's hip in example-robot-data has moments of -5.4e-20 on a link of some grams
    that others hang on.
    """
    hip = link("hip", (-5.4e-20, -5.4e-20, 0.0), 0.02).replace(
        'ixy="0.0002"', 'ixy="0"'
    )
    text = robot(
        link("b"),
        hip,
        link("a"),
        joint("h", "b", "hip", limits()),
        joint("k", "hip", "a", limits()),
    )
    vehicle = loaded(tmp_path, text)
    assert max(map(abs, vehicle.links[0].body.inertia.entries)) <= 1e-19
    assert any(
        note.startswith(
            "link hip: rounding of its inertia left out: principal moments -5.4e-20"
        )
        for note in vehicle.notes
    )


def test_the_nearest_inertia_is_no_farther_than_any_other_real_one():
    """Against 2000 random bodies beside it, in the norm of the second moments; and a
    real one stays.
    """
    rng = np.random.default_rng(2)
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    given = Q @ np.diag([0.02, 0.03, 0.054]) @ Q.T

    def second(inertia):
        return 0.5 * np.trace(inertia) * np.eye(3) - inertia

    entries = (
        given[0, 0],
        given[1, 1],
        given[2, 2],
        given[0, 1],
        given[0, 2],
        given[1, 2],
    )
    found = np.array(
        [
            [float(c) for c in row]
            for row in nearest_inertia(Sym3(*map(float, entries))).full().rows
        ]
    )
    Body(mass=1.0, inertia=found)
    best = np.linalg.norm(second(found) - second(given))
    root = np.linalg.cholesky(second(found) + 1e-12 * np.eye(3))
    for _ in range(2000):
        near = root + rng.normal(size=(3, 3)) * 10 ** rng.uniform(-6, -1.5)
        assert np.linalg.norm(near @ near.T - second(given)) >= best * (1.0 - 1e-9)
    real = Sym3(0.02, 0.03, 0.045, 0.001, 0.0, -0.002)
    np.testing.assert_allclose(nearest_inertia(real).entries, real.entries, atol=1e-17)


def test_dry_friction_of_a_light_link_is_bent_until_both_plants_take_it(tmp_path):
    """xArm7's 1 N m on a last link of 1e-4 kg m^2, which has a drive of which its file
    says nothing.
    """
    more = (
        limits().replace('velocity="4"', "")
        + '<dynamics damping="0.1" friction="1.0"/>'
    )
    light = link("a", (1e-4, 1e-4, 1e-4), 0.01).replace('ixy="0.0002"', 'ixy="0"')
    text = robot(link("b"), light, joint("j", "b", "a", more))
    vehicle = loaded(tmp_path, text)
    found = vehicle.links[0].joint
    assert 1.0 < found.coulomb_rate < 10.0
    assert any(
        note.startswith("joint j: dry friction too stiff to integrate")
        for note in vehicle.notes
    )
    assert 1500.0 < friction_rate(vehicle) < 10000.0
    chain = robot(
        link("b"),
        light,
        light.replace('"a"', '"c"'),
        joint("j", "b", "a", more),
        joint("k", "a", "c", more),
    )
    assert 1500.0 < friction_rate(loaded(tmp_path, chain)) < 10000.0
    stated = '[[joints]]\nname = "j"\ncoulomb_rate = 0.5'
    assert in_toml(tmp_path, text, stated).links[0].joint.coulomb_rate == 0.5
    driven = in_toml(tmp_path, text, '[[joints]]\nname = "j"\narmature = 0.1')
    assert (driven.links[0].joint.coulomb_rate, driven.notes) == (0.01, ())
    absurd = loaded(tmp_path, text.replace('friction="1.0"', 'friction="1e9"'))
    assert absurd.links[0].joint.coulomb == 1e9, "left to the plants, which refuse it"
    soft = loaded(tmp_path, text.replace('friction="1.0"', 'friction="0.001"'))
    assert (soft.links[0].joint.coulomb_rate, soft.notes) == (0.01, ())


REFUSED = {
    "a base without mass": (
        robot('<link name="b"/>'),
        "base.mass = 0.0: must be greater than 0; its root 'b'",
    ),
    "limits in words": (
        robot(link("b"), link("a"), joint("j", "b", "a", limits("low"))),
        "joint[j].limit.lower = 'low': must be a number",
    ),
    "limits crossed": (
        robot(link("b"), link("a"), joint("j", "b", "a", limits(1.0, -1.0))),
        "joints[j].lower = 1.0: must be below upper = -1.0",
    ),
    "negative effort": (
        robot(link("b"), link("a"), joint("j", "b", "a", limits(effort='effort="-1"'))),
        "joints[j].effort_limit = -1.0: must be at least 0",
    ),
    "ratio": (
        GRIPPER.replace('"-1.5"', '"fast"'),
        "joint[j_right].mimic.multiplier = 'fast': must be a finite number",
    ),
    "offset": (
        GRIPPER.replace('offset="0.2"', 'offset="inf"'),
        "joint[j_right].mimic.offset = 'inf': must be a finite",
    ),
    "two mimics": (
        GRIPPER.replace("<mimic", '<mimic joint="elbow"/><mimic', 1),
        "joint[j_right].mimic = '2 elements <mimic>': must be at most one",
    ),
    "xacro": (
        '<robot xmlns:xacro="http://x/xacro"><xacro:arm/></robot>',
        "must be plain URDF; expand xacro first: name it r.urdf.xacro",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_reading_can_mean_is_refused_in_one_line(tmp_path, case):
    text, message = REFUSED[case]
    path = saved(tmp_path, text)
    with pytest.raises(VehicleError) as error:
        load_vehicle(path)
    assert str(error.value).startswith(f"{path}: ")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_products_of_inertia_below_rounding_of_the_moments_are_zero():
    found = nearest_inertia(Sym3(1e-3, 2e-3, 4e-3, 2e-4, 1e-22, 0.0))
    entries = [float(each) for each in found.entries]
    assert entries[4] == entries[5] == 0.0
    assert entries[3] != 0.0
