"""Records made in Python: NumPy's numbers, arrays, lists and integers are taken as what
they mean, the rest refused.
"""

from __future__ import annotations

import dataclasses
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.compile import trace
from skyarm.records.leaves import leaves
from skyarm.vehicle import (
    Body,
    BodyDrag,
    Frame,
    Joint,
    Link,
    Rotor,
    Vehicle,
    VehicleError,
)

BODY: dict[str, Any] = {"mass": 1.0, "inertia": (0.01, 0.01, 0.01)}
ROTOR: dict[str, Any] = {
    "name": "front",
    "position": (0.1, 0.0, 0.0),
    "direction": 1,
    "thrust_coefficient": 1e-5,
    "moment_coefficient": 0.01,
}
MAKERS: dict[str, Any] = {
    "body": lambda **k: Body(**(BODY | k)),
    "joints[j]": lambda **k: Joint(**({"name": "j"} | k)),
    "rotors[front]": lambda **k: Rotor(**(ROTOR | k)),
    "frames[tip]": lambda **k: Frame(
        **({"name": "tip", "link": -1, "position": (0, 0, 0)} | k)
    ),
    "drag": BodyDrag,
    "links[a]": lambda **k: Link(
        **(
            {"name": "a", "parent": -1, "joint": Joint(name="j"), "body": Body(**BODY)}
            | k
        )
    ),
    "vehicle": lambda **k: Vehicle(**({"name": "v", "base": Body(**BODY)} | k)),
}
COEFFICIENTS = [
    ("body", "mass"),
    ("joints[j]", "damping"),
    ("joints[j]", "coulomb"),
    ("rotors[front]", "moment_coefficient"),
    ("rotors[front]", "drag_coefficient"),
    ("rotors[front]", "rolling_moment_coefficient"),
    ("drag", "air_density"),
]
DATA = [
    *(
        ("joints[j]", name)
        for name in ("lower", "upper", "effort_limit", "coulomb_rate")
    ),
    *(
        ("rotors[front]", name)
        for name in ("thrust_coefficient", "time_constant_up", "time_constant_down")
    ),
    ("rotors[front]", "max_speed"),
]
VECTORS = [
    ("body", "com"),
    *(("joints[j]", name) for name in ("axis", "position")),
    *(("rotors[front]", name) for name in ("axis", "position")),
    ("frames[tip]", "position"),
    ("drag", "area"),
]
MATRICES = [("joints[j]", "rotation"), ("frames[tip]", "rotation")]


def held(where: str, name: str, value: Any) -> Any:
    return getattr(MAKERS[where](**{name: value}), name)


@pytest.mark.parametrize(("where", "name"), COEFFICIENTS + DATA)
@pytest.mark.parametrize(
    "value",
    [
        np.float32(0.5),
        np.float64(0.5),
        np.array(0.5),
        np.array(0.5, dtype=np.float32),
        Fraction(1, 2),
    ],
)
def test_numbers_of_numpy_become_floats(where: str, name: str, value: Any) -> None:
    found = held(where, name, value)
    assert type(found) is float
    assert found == 0.5


@pytest.mark.parametrize(("where", "name"), COEFFICIENTS + DATA)
@pytest.mark.parametrize("value", [2, np.int64(2), np.array(2)])
def test_whole_numbers_are_data_as_in_a_file(where: str, name: str, value: Any) -> None:
    found = held(where, name, value)
    assert type(found) is float
    assert found == 2.0


@pytest.mark.parametrize(("where", "name"), COEFFICIENTS)
def test_an_integer_zero_stays_structure_where_the_laws_fold_it(
    where: str, name: str
) -> None:
    assert type(held(where, name, 0)) is int
    assert type(held(where, name, 0.0)) is float


@pytest.mark.parametrize(("where", "name"), DATA[:3])
def test_elsewhere_an_integer_zero_is_a_number_like_any_other(
    where: str, name: str
) -> None:
    assert type(held(where, name, 0)) is float


REFUSED = [
    "0.7",
    "",
    b"1",
    True,
    np.bool_(True),
    None,
    [1.0],
    {},
    1j,
    np.array("a"),
    np.array(["a"]),
    np.array([True]),
]


@pytest.mark.parametrize(("where", "name"), COEFFICIENTS + DATA)
@pytest.mark.parametrize("value", REFUSED, ids=repr)
def test_what_is_no_number_is_refused_by_field_value_and_what_is_allowed(
    where: str, name: str, value: Any
) -> None:
    with pytest.raises(VehicleError) as error:
        held(where, name, value)
    assert str(error.value) == f"{where}.{name} = {value!r}: must be a number"


@pytest.mark.parametrize(
    "mass",
    [np.float32(-1), np.int64(-1), np.array(-1.0), np.float64(-1.0), -1, Fraction(-1)],
)
def test_a_negative_mass_is_refused_whoever_made_the_number(mass: Any) -> None:
    with pytest.raises(VehicleError, match=r"^body.mass = -1.0: must be at least 0$"):
        Vehicle(name="v", base=Body(mass=mass, inertia=(0.01, 0.01, 0.01)))


@pytest.mark.parametrize("value", [np.float32("nan"), np.array(np.inf), 10**400])
def test_a_mass_that_is_not_finite_is_refused(value: Any) -> None:
    with pytest.raises(VehicleError, match=r"mass = .*: must be a finite number"):
        Vehicle(name="v", base=Body(mass=value, inertia=(0.01, 0.01, 0.01)))


@pytest.mark.parametrize(
    ("where", "name"), [each for each in VECTORS if each[1] != "axis"]
)
def test_vectors_are_taken_from_any_sequence_or_array(where: str, name: str) -> None:
    for given in (
        [0, 0.5, 1],
        (0.0, 0.5, 1.0),
        np.array([0.0, 0.5, 1.0]),
        [np.float32(0), np.array(0.5), 1],
    ):
        found = held(where, name, given)
        assert tuple(found) == (0, 0.5, 1)
        assert [type(each) for each in found] == [int, float, int]
    found = held(where, name, Vec3(0, np.float32(0.5), 0.0))
    assert [type(each) for each in found] == [int, float, float]


@pytest.mark.parametrize(("where", "name"), VECTORS)
@pytest.mark.parametrize(
    "value",
    ["abc", [1, 2], [1, 2, 3, 4], 1.0, None, {"x": 1, "y": 2, "z": 3}, np.array(1.0)],
)
def test_what_is_no_vector_is_refused(where: str, name: str, value: Any) -> None:
    with pytest.raises(VehicleError) as error:
        held(where, name, value)
    assert str(error.value) == f"{where}.{name} = {value!r}: must be three numbers"


@pytest.mark.parametrize(("where", "name"), VECTORS)
@pytest.mark.parametrize("entry", ["0.1", True, None])
def test_a_component_that_is_no_number_is_refused(
    where: str, name: str, entry: Any
) -> None:
    for given in ([0.0, entry, 0.0], Vec3(0.0, entry, 0.0)):
        with pytest.raises(
            VehicleError, match=rf"{name}(.y)? = {entry!r}: must be a number"
        ):
            held(where, name, given)


@pytest.mark.parametrize(("where", "name"), MATRICES)
def test_rotations_are_taken_from_rows(where: str, name: str) -> None:
    turn = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    for given in (
        turn,
        np.array(turn),
        np.array(turn, dtype=float),
        Mat3.from_numbers(turn),
    ):
        assert held(where, name, given) == Mat3.from_numbers(turn)
    for wrong in ("abc", np.eye(2), [1, 2, 3], None):
        with pytest.raises(VehicleError, match=rf"{name} = .*: must be three"):
            held(where, name, wrong)


FULL = np.array([[0.02, 0.001, 0.0], [0.001, 0.03, -0.002], [0.0, -0.002, 0.04]])


@pytest.mark.parametrize(
    "given", [FULL, FULL.tolist(), list(FULL), tuple(map(tuple, FULL))]
)
def test_an_inertia_is_taken_as_a_symmetric_matrix(given: Any) -> None:
    assert held("body", "inertia", given) == Sym3(0.02, 0.03, 0.04, 0.001, 0, -0.002)


def test_an_inertia_may_be_symmetric_up_to_rounding() -> None:
    rounded = FULL.copy()
    rounded[1, 0] *= 1.0 + 1e-9
    assert held("body", "inertia", rounded) == held("body", "inertia", FULL)


def test_a_scaled_identity_is_an_inertia() -> None:
    assert Vehicle(
        name="v", base=Body(mass=1.0, inertia=np.eye(3) * 1e-2)
    ).base.inertia == Sym3(0.01, 0.01, 0.01)


def test_a_matrix_that_is_not_symmetric_is_refused() -> None:
    for wrong in (
        FULL + np.triu(np.full((3, 3), 1e-3), 1),
        [[1, 2, 3], [0, 1, 0], [0, 0, 1]],
    ):
        with pytest.raises(
            VehicleError, match=r"^body.inertia = .*: must be symmetric$"
        ):
            held("body", "inertia", wrong)


@pytest.mark.parametrize(
    "value",
    [np.eye(2), np.eye(4), [1, 2], 1.0, "abc", None, [[1, 2, 3]] * 6, [1, 2, "a"]],
)
def test_what_is_no_inertia_is_refused(value: Any) -> None:
    with pytest.raises(VehicleError, match=r"^body.inertia = "):
        held("body", "inertia", value)


def test_lanes_and_values_of_other_engines_stay_what_they_are() -> None:
    lanes = np.array([1.0, 2.0])
    assert held("body", "mass", lanes) is lanes
    assert held("body", "mass", np.array([1, 2])).dtype == float
    assert held("body", "com", [0, 0, lanes]).z is lanes
    jax = pytest.importorskip("jax")
    array = jax.numpy.asarray(0.5)
    assert held("body", "mass", array) is array
    gradient = jax.grad(
        lambda m: Vehicle(name="v", base=Body(mass=m, com=[0, 0, m])).mass * 3.0
    )(1.0)
    assert float(gradient) == 3.0


def test_a_symbol_of_casadi_stays_what_it_is() -> None:
    import casadi

    symbol = casadi.SX.sym("m")
    assert held("body", "mass", symbol) is symbol


def test_nodes_of_a_trace_are_scalars() -> None:
    program = trace(lambda x: (Body(mass=x[0], com=[0, 0, x[0]]).mass + 1.0,), (2.0,))
    assert program((3.0,)) == (4.0,)


def arm() -> dict[str, Any]:
    links = [Link(name="a", parent=-1, joint=Joint(name="j"), body=Body(**BODY))]
    frames = [Frame(name="tip", link=0, position=(0.0, 0.0, -0.2))]
    return {
        "name": "v",
        "base": Body(**BODY),
        "links": links,
        "rotors": [Rotor(**ROTOR)],
        "frames": frames,
    }


def test_lists_of_links_rotors_frames_and_sources_become_tuples() -> None:
    vehicle = Vehicle(**arm(), sources=[["base.mass", "scales"]])
    for name in ("links", "rotors", "frames", "sources"):
        assert isinstance(getattr(vehicle, name), tuple), name
    same = {
        name: tuple(part) if isinstance(part, list) else part
        for name, part in arm().items()
    }
    assert dataclasses.replace(vehicle, sources=()) == Vehicle(**same)
    assert (
        vehicle.sources
        == (("base.mass", "scales"),)
        == Vehicle(**arm(), sources={"base.mass": "scales"}).sources
    )
    # a list would be one leaf
    assert all(type(leaf) is float for leaf in leaves(vehicle))


@pytest.mark.parametrize(
    ("where", "name", "value", "allowed"),
    [
        ("vehicle", "links", "ab", "must be a tuple of Link"),
        ("vehicle", "links", None, "must be a tuple of Link"),
        ("vehicle", "rotors", {"a": 1}, "must be a tuple of Rotor"),
        ("vehicle", "base", 1.0, "must be a Body"),
        ("vehicle", "drag", None, "must be a BodyDrag"),
        ("vehicle", "name", 3, "must be text"),
        ("vehicle", "end_effector", None, "must be text"),
        ("vehicle", "sources", "ab", "must be pairs of texts"),
        ("vehicle", "sources", [("a", 1.0)], "must be pairs of texts"),
        ("links[a]", "joint", None, "must be a Joint"),
        ("links[a]", "body", "heavy", "must be a Body"),
        ("links[a]", "parent", 0.5, "must be a whole number"),
        ("links[a]", "parent", True, "must be a whole number"),
        ("frames[tip]", "link", "arm", "must be a whole number"),
        (
            "rotors[front]",
            "direction",
            "cw",
            "must be 1 (ccw, seen from the tip of its axis) or -1 (cw)",
        ),
        (
            "rotors[front]",
            "direction",
            2,
            "must be 1 (ccw, seen from the tip of its axis) or -1 (cw)",
        ),
        ("body", "planar", "yes", "must be True or False"),
        ("joint", "name", 3, "must be text"),
    ],
)
def test_what_is_no_part_of_a_vehicle_is_refused(
    where: str, name: str, value: Any, allowed: str
) -> None:
    maker = MAKERS["joints[j]" if where == "joint" else where]
    with pytest.raises(VehicleError) as error:
        maker(**{name: value})
    assert str(error.value) == f"{where}.{name} = {value!r}: {allowed}"


def test_an_entry_of_another_kind_is_refused_by_its_place() -> None:
    with pytest.raises(
        VehicleError, match=r"^vehicle.links\[1\] = Joint.*: must be a Link$"
    ):
        Vehicle(**(arm() | {"links": [*arm()["links"], Joint(name="k")]}))


def test_indices_and_signs_of_numpy_become_integers() -> None:
    link = MAKERS["links[a]"](parent=np.int64(-1))
    assert (
        type(link.parent)
        is type(MAKERS["rotors[front]"](direction=np.float64(-1.0)).direction)
        is int
    )
    assert MAKERS["body"](planar=np.bool_(True)).planar is True


def test_a_vehicle_without_end_effector_says_so_and_lists_its_frames() -> None:
    from skyarm import frame_jacobian

    message = r"^vehicle 'v': no end_effector; name a frame; there are \['tip'\]$"
    vehicle = Vehicle(**arm())
    still = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(1))
    for ask in (
        lambda: vehicle.with_payload(0.1),
        lambda: frame_jacobian(vehicle, *still),
        lambda: vehicle.frame(""),
    ):
        with pytest.raises(VehicleError, match=message):
            ask()
    bare = dataclasses.replace(vehicle, frames=())
    with pytest.raises(
        VehicleError, match=r"no end_effector; name a frame; there are none$"
    ):
        bare.with_payload(0.1)
    assert dataclasses.replace(vehicle, end_effector="tip").frame().name == "tip"
