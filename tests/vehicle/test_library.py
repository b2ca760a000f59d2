"""The shipped vehicles against published numbers."""

import math
import tomllib
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Sym3
from skyarm.vehicle import VehicleError
from skyarm.vehicle.vehicle_files import LIBRARY, list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_records import require_plant

NAMES = (
    "crazyflie_arm1",
    "dragonfly",
    "hexacopter370_flying_arm_3",
    "hexacopter680_flying_arm_2",
    "hexarotor12_arm5",
    "hexarotor_arm6",
    "hextilt_flying_arm_5",
    "hummingbird",
    "hummingbird_arm2",
    "hummingbird_arm2_rotors",
    "hummingbird_arm2_twin",
    "octo_coaxial_two_arms",
    "pelican_arm2",
    "quadrotor_roll_arm2",
    "tilted_hexarotor",
    "voliro_like",
)
FLYING = tuple(name for name in NAMES if name != "hummingbird_arm2")


Step = tuple[str, bool]
"""A key of a table, or the name of an array's entry (True)."""


def fields_of(
    table: Any, above: tuple[Step, ...] = ()
) -> Iterator[tuple[tuple[Step, ...], Any]]:
    """Path and value of every field of a document that is no table; an array of numbers
    is one field.
    """
    if isinstance(table, dict):
        inner = [
            ((key, False), each)
            for key, each in table.items()
            if above or key not in ("schema", "sources")
        ]
    elif isinstance(table, list) and table and isinstance(table[0], dict):
        inner = [
            ((str(each.get("name", i)), True), each) for i, each in enumerate(table)
        ]
    else:
        yield above, table
        return
    for step, each in inner:
        yield from fields_of(each, (*above, step))


def source_covers(key: str, path: Sequence[Step]) -> bool:
    """True if a key of ``[sources]`` covers the field at a path."""
    parts = key.split(".")
    full, unnamed = (
        [text for text, _ in path],
        [text for text, is_name in path if not is_name],
    )
    return full[: len(parts)] == parts or unnamed[: len(parts)] == parts


def without_source(document):
    """Numeric fields that no key of ``[sources]`` covers, as dotted paths."""

    def numeric(value):
        several = isinstance(value, list) and bool(value) and all(map(numeric, value))
        return several or (
            isinstance(value, (int, float)) and not isinstance(value, bool)
        )

    keys = document.get("sources", {})
    missing = [
        p
        for p, v in fields_of(document)
        if numeric(v) and not any(source_covers(k, p) for k in keys)
    ]
    return [".".join(text for text, _ in path) for path in missing]


def about_origin(body):
    """Inertia about the link's origin by Steiner's theorem, in NumPy."""
    i = body.inertia
    about_com = np.array(
        [[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], dtype=float
    )
    c = np.array([float(v) for v in body.com])
    return about_com + body.mass * (c @ c * np.eye(3) - np.outer(c, c))


def test_the_library_holds_these_vehicles():
    assert list_vehicles() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_vehicle_loads_under_its_own_name(name):
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    assert vehicle.title
    assert [frame.name for frame in vehicle.frames].count("tip") == (
        1 if vehicle.n else 0
    )
    assert vehicle.end_effector == ("tip" if vehicle.n else "")


@pytest.mark.parametrize("name", NAMES)
def test_every_number_of_the_shipped_vehicles_has_a_source(name):
    assert (
        without_source(
            tomllib.loads((LIBRARY / f"{name}.toml").read_text(encoding="utf-8"))
        )
        == []
    )
    assert load_vehicle(name).sources


def test_a_number_without_a_source_is_found():
    document = {
        "base": {"mass": 1.0, "com": [0.0, 0.0, 0.1]},
        "links": [{"name": "a", "mass": 1.0, "planar": True}],
    }
    assert without_source({**document, "sources": {"base.mass": "x"}}) == [
        "base.com",
        "links.a.mass",
    ]
    assert (
        without_source({**document, "sources": {"base": "x", "links.mass": "x"}}) == []
    )
    assert without_source({**document, "sources": {"base": "x", "links.a": "x"}}) == []
    assert without_source(
        {**document, "sources": {"bas": "x", "links.b.mass": "x"}}
    ) == [
        "base.mass",
        "base.com",
        "links.a.mass",
    ]


def test_rotors_truth_base_has_the_mass_properties_of_its_real_parts():
    # half a unit of the last digit that is published
    vehicle = load_vehicle("hummingbird_arm2_rotors")
    inertia = about_origin(vehicle.base)
    assert vehicle.base.mass == pytest.approx(0.73103, abs=1e-12)
    assert vehicle.mass == pytest.approx(0.82103, abs=1e-12)
    assert inertia[0, 0] == pytest.approx(0.0077174, abs=5e-8)
    assert inertia[1, 1] == pytest.approx(0.0077174, abs=5e-8)
    assert inertia[2, 2] == pytest.approx(0.0130804, abs=5e-8)
    assert vehicle.base.com.z == pytest.approx(0.49e-3, abs=5e-6)
    assert vehicle.base.com.z > 0


def test_rotors_truth_base_without_the_rotors_own_inertia_is_the_published_sum():
    inertia = about_origin(load_vehicle("hummingbird_arm2_rotors").base)
    spin_average = (1.755e-6 + 7.50675e-5) / 2.0
    assert inertia[0, 0] - 4 * spin_average == pytest.approx(0.0075638, abs=1e-9)


def test_symmetry_of_the_truth_base_is_structure():
    base = load_vehicle("hummingbird_arm2_rotors").base
    for value in (
        base.com.x,
        base.com.y,
        base.inertia.xy,
        base.inertia.xz,
        base.inertia.yz,
    ):
        assert type(value) is int
        assert value == 0
    assert all(
        type(value) is float
        for value in (base.mass, base.com.z, *base.inertia.entries[:3])
    )


@pytest.mark.parametrize("name", NAMES)
def test_no_shipped_body_carries_a_zero_as_data(name):
    for body in load_vehicle(name).bodies:
        for value in (*body.com, *body.inertia.entries):
            assert type(value) is int or value != 0.0
        assert type(body.mass) is float


@pytest.mark.parametrize("name", ["hummingbird_arm2", "hummingbird_arm2_rotors"])
def test_second_link_and_its_point_mass_have_the_composite_inertia(name):
    # hand calculation: rod 0.04 kg at 0.075 m and point 0.01 kg at 0.15 m
    body = load_vehicle(name).links[1].body
    assert body.mass == pytest.approx(0.05, abs=1e-15)
    assert body.com.z == pytest.approx(-(0.04 * 0.075 + 0.01 * 0.15) / 0.05, abs=1e-15)
    reduced = 0.04 * 0.01 / 0.05
    assert body.inertia.yy == pytest.approx(7.5e-5 + reduced * 0.075**2, rel=1e-12)
    rod_xx = 0.0 if name == "hummingbird_arm2" else 7.5e-5
    assert body.inertia.xx == pytest.approx(rod_xx + reduced * 0.075**2, rel=1e-12)


def test_arm_of_the_paper_hangs_and_turns_about_y():
    for name in ("hummingbird_arm2", "hummingbird_arm2_rotors"):
        vehicle = load_vehicle(name)
        assert [tuple(link.joint.axis) for link in vehicle.links] == [
            (0, 1, 0),
            (0, 1, 0),
        ]
        assert tuple(vehicle.links[0].joint.position) == (0, 0, 0)
        assert tuple(vehicle.links[1].joint.position) == (0, 0, -0.15)
        assert tuple(vehicle.frame("tip").position) == (0, 0, -0.15)
        assert [link.joint.effort_limit for link in vehicle.links] == [0.5, 0.5]
        assert all(
            math.isinf(link.joint.lower) and math.isinf(link.joint.upper)
            for link in vehicle.links
        )
    assert [link.joint.damping for link in load_vehicle("hummingbird_arm2").links] == [
        0,
        0,
    ]
    assert [
        link.joint.damping for link in load_vehicle("hummingbird_arm2_rotors").links
    ] == [0.001, 0.001]


def test_model_and_truth_know_their_own_rotors():
    believed, true, bare = (
        load_vehicle(n)
        for n in ("hummingbird_arm2", "hummingbird_arm2_rotors", "hummingbird")
    )
    for vehicle, k_f, z in (
        (believed, 8.549e-6, 0),
        (true, 8.54858e-6, 0.01),
        (bare, 8.54858e-6, 0),
    ):
        assert [rotor.direction for rotor in vehicle.rotors] == [-1, 1, -1, 1]
        assert {rotor.thrust_coefficient for rotor in vehicle.rotors} == {k_f}
        assert {rotor.position.z for rotor in vehicle.rotors} == {z}
        hubs = [(rotor.position.x, rotor.position.y) for rotor in vehicle.rotors]
        # RotorS's yaml rounds its angles to 1e-11 rad, and the bare Hummingbird keeps
        # its hubs there
        slack = 1e-12 if vehicle is bare else 0.0
        assert np.allclose(
            hubs, [(0.17, 0), (0, 0.17), (-0.17, 0), (0, -0.17)], rtol=0.0, atol=slack
        )
    assert bare.mass == 0.716
    assert bare.base.inertia == Sym3(0.007, 0.007, 0.012)
    # 4 k_f W_max^2, published as 24.01 N
    assert sum(
        rotor.thrust_coefficient * rotor.max_speed**2 for rotor in true.rotors
    ) == pytest.approx(24.01, abs=5e-3)


def test_only_the_papers_model_is_planar():
    assert [name for name in NAMES if load_vehicle(name).planar] == ["hummingbird_arm2"]


def test_a_plant_refuses_the_papers_model_by_its_link():
    with pytest.raises(
        VehicleError,
        match=(
            r"^vehicle 'hummingbird_arm2': links\[link1\].planar = True: must be false"
        ),
    ):
        require_plant(load_vehicle("hummingbird_arm2"))


@pytest.mark.parametrize("name", FLYING)
def test_a_plant_accepts_the_others(name):
    require_plant(load_vehicle(name))


def wrench_map(vehicle):
    """Force and torque about the base origin per squared speed, NumPy."""
    columns = []
    for rotor in vehicle.rotors:
        axis, hub = (
            np.array([*map(float, rotor.axis)]),
            np.array([*map(float, rotor.position)]),
        )
        drag = -rotor.direction * rotor.moment_coefficient * axis
        columns.append(
            rotor.thrust_coefficient * np.array([*axis, *(np.cross(hub, axis) + drag)])
        )
    return np.array(columns).T


@pytest.mark.parametrize(
    ("name", "rank"),
    [
        ("hummingbird", 4),
        ("hexarotor_arm6", 4),
        ("tilted_hexarotor", 6),
        ("octo_coaxial_two_arms", 4),
    ],
)
def test_rotors_span_the_wrenches_they_should(name, rank):
    A = wrench_map(load_vehicle(name))
    singular = np.linalg.svd(A / np.abs(A).max(), compute_uv=False)
    assert int((singular > 1e-3).sum()) == rank


@pytest.mark.parametrize("name", FLYING)
def test_flying_vehicles_hover_with_margin_and_without_torque(name):
    vehicle = load_vehicle(name)
    speeds = np.array([rotor.max_speed for rotor in vehicle.rotors])
    most = wrench_map(vehicle) @ speeds**2
    assert most[2] > 1.5 * vehicle.mass * 9.81
    # equal speeds give a pure vertical force; rounding of the ten published digits of a
    # hub
    assert np.abs(np.delete(most, 2)).max() < 1e-6 * most[2]


def test_two_arms_branch_from_one_link():
    vehicle = load_vehicle("octo_coaxial_two_arms")
    assert [link.parent for link in vehicle.links] == [-1, 0, 1, 0, 3]
    assert [link.joint.kind for link in vehicle.links].count("prismatic") == 2
    hubs = [(rotor.position.x, rotor.position.y) for rotor in vehicle.rotors]
    assert len(hubs) == 2 * len(set(hubs))


def test_arm_of_six_joints_has_mixed_axes_and_limits():
    vehicle = load_vehicle("hexarotor_arm6")
    assert {tuple(link.joint.axis) for link in vehicle.links} == {(0, 0, 1), (0, 1, 0)}
    assert vehicle.mass == pytest.approx(4.0, abs=0.05)
    assert vehicle.links[0].joint.upper == 3.0
