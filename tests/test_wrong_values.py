"""The Python interface refuses what it cannot mean with a ValueError: argument, value
and what is allowed.
"""

from __future__ import annotations

import dataclasses
import functools
import re
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Motion
from skyarm.compile.tracing.fingerprint import fingerprint
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_record import first_state
from support import euler_lagrange

STILL = ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0])
RATES = np.zeros(8)
ARRAYS: dict[str, tuple[Any, ...]] = {
    "mass_matrix": STILL,
    "center_of_mass": STILL,
    "frame_pose_world": STILL,
    "frame_jacobian": STILL,
    "energy": (*STILL, RATES),
    "momentum": (*STILL, RATES),
    "inverse_dynamics": (*STILL, RATES, RATES),
    "forward_dynamics": (*STILL, RATES, RATES),
}
NAMES = ("position", "quaternion_wxyz", "joints", "velocity")
WITH_GRAVITY = ("mass_matrix", "energy", "inverse_dynamics", "forward_dynamics")


@functools.cache
def vehicle() -> skyarm.Vehicle:
    return skyarm.load_vehicle("hummingbird_arm2_rotors")


@functools.cache
def scenario() -> skyarm.Scenario:
    return skyarm.load_scenario("case1")


def refused(
    field: str, value: Any, allowed: str, call: Any, kind: type[ValueError] = ValueError
) -> None:
    with pytest.raises(kind) as error:
        call()
    message = str(error.value)
    assert "\n" not in message
    assert f"{field} = {' '.join(repr(value).split())[:90]}" in message
    assert allowed in message


@pytest.mark.parametrize("value", ["x", None, 3], ids=repr)
@pytest.mark.parametrize("function", ARRAYS)
def test_dynamics_of_what_is_no_vehicle_are_refused(function: str, value: Any) -> None:
    call = functools.partial(getattr(skyarm, function), value, *ARRAYS[function])
    refused("vehicle", value, "must be a Vehicle", call, skyarm.VehicleError)


NO_NUMBERS: list[Any] = [
    *(
        [1j, 0],
        np.array([1j, 0]),
        {},
        {"a": 1},
        ["1", "2"],
        np.array(["1", "2"]),
        "12",
        None,
        [True, False],
    ),
    *(
        np.array([0.0, None], dtype=object),
        [[0, 1], [1]],
        [np.nan, 0.0],
        [0.0, np.inf],
        [10**400, 0],
    ),
]


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: repr(value)[:30])
@pytest.mark.parametrize("function", ARRAYS)
def test_joints_that_are_no_finite_numbers_are_refused(
    function: str, value: Any
) -> None:
    call = functools.partial(
        getattr(skyarm, function), vehicle(), *STILL[:2], value, *ARRAYS[function][3:]
    )
    refused("joints", value, "must be finite numbers", call)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
@pytest.mark.parametrize("function", ARRAYS)
def test_every_argument_is_refused_by_its_name_where_it_is_not_finite(
    function: str, wrong: float
) -> None:
    last = "force" if function == "forward_dynamics" else "acceleration"
    for index, name in enumerate((*NAMES, last)[: len(ARRAYS[function])]):
        given = [np.array(each, dtype=float) for each in ARRAYS[function]]
        given[index][-1] = wrong
        refused(
            name,
            given[index],
            "must be finite numbers",
            functools.partial(getattr(skyarm, function), vehicle(), *given),
        )


IN_LAWS = {
    "mass_matrix": "mass_matrix",
    "center_of_mass": "center_of_mass",
    "frame_pose_world": "frame_pose",
    "frame_jacobian": "kinematics.jacobian_columns",
    "energy": "kinetic_energy",
    "momentum": "momentum",
    "inverse_dynamics": "inverse_dynamics",
    "forward_dynamics": "forward_dynamics",
}


@pytest.mark.parametrize("function", ARRAYS)
def test_values_of_a_law_are_refused_with_the_function_for_laws(function: str) -> None:
    """Records and symbols, which a law has, do not belong into the functions for
    arrays.
    """
    still = skyarm.Vec3(0.0, 0.0, 0.0)
    whole = skyarm.dynamics
    for name in IN_LAWS[function].split("."):
        whole = getattr(whole, name)
    assert callable(whole)
    words = (
        "must be finite numbers, as an array; a law calls"
        f" skyarm.dynamics.{IN_LAWS[function]}"
    )
    given = list(ARRAYS[function])
    given[-1] = Motion(still, still)
    call = getattr(skyarm, function)
    name = (*NAMES, "force" if function == "forward_dynamics" else "acceleration")[
        len(given) - 1
    ]
    refused(name, given[-1], words, lambda: call(vehicle(), *given))

    def law(x: Any) -> Any:
        return call(vehicle(), skyarm.Vec3(x, 0.0, 0.0), *ARRAYS[function][1:])

    with pytest.raises(ValueError, match=rf"^position = .*: {re.escape(words)}$"):
        fingerprint(law, 1.0)


def test_numbers_of_any_kind_are_numbers() -> None:
    from fractions import Fraction

    expected = skyarm.mass_matrix(vehicle(), *STILL[:2], [0.5, 2.0])
    for joints in (
        [Fraction(1, 2), 2],
        np.array([0.5, 2.0], dtype=np.float32),
        np.array([0.5, 2], dtype=object),
    ):
        np.testing.assert_array_equal(
            skyarm.mass_matrix(vehicle(), *STILL[:2], joints), expected
        )


@pytest.mark.parametrize(
    "value",
    ["9", [0, 0, -9.81], np.array([0, 0, -9.81]), np.nan, np.inf, None, 1j, True],
    ids=repr,
)
def test_gravity_is_one_finite_number(value: Any) -> None:
    for function in WITH_GRAVITY:
        call = functools.partial(
            getattr(skyarm, function), vehicle(), *ARRAYS[function], gravity=value
        )
        refused("gravity", value, "must be one finite number", call)
    refused(
        "gravity",
        value,
        "one",
        lambda: euler_lagrange.gravity_vector(RATES, gravity=value),
    )
    if not isinstance(value, np.ndarray):
        for record in (skyarm.Truth, skyarm.Model):
            refused(
                "gravity",
                value,
                "number",
                lambda: record(vehicle=vehicle(), gravity=value),  # noqa: B023
            )


def test_gravity_does_not_push_up() -> None:
    for record in (skyarm.Truth, skyarm.Model):
        refused(
            "gravity",
            -9.81,
            "must be at least 0",
            lambda: record(vehicle=vehicle(), gravity=-9.81),  # noqa: B023
        )


@pytest.mark.parametrize("value", [["case1"], None, 3], ids=repr)
def test_what_is_no_record_is_refused(value: Any) -> None:
    refused(
        "scenario",
        value,
        "must be a Scenario",
        lambda: skyarm.run(value),
        skyarm.ScenarioError,
    )
    refused(
        "document",
        value,
        "must be a table",
        lambda: skyarm.scenario_from(value),
        skyarm.ScenarioError,
    )
    refused(
        "model",
        value,
        "must be a Model",
        lambda: skyarm.make_controller("decoupled_pd", value),
    )
    refused("model", value, "must be a Model", lambda: skyarm.preset("paper_ct", value))
    refused(
        "plant.vehicle", value, "must be a Vehicle", lambda: skyarm.Truth(vehicle=value)
    )
    refused(
        "model.vehicle", value, "must be a Vehicle", lambda: skyarm.Model(vehicle=value)
    )


@pytest.mark.parametrize("value", [3, None, b"case1", ["case1"], 1.5], ids=repr)
def test_what_is_no_name_is_refused(value: Any) -> None:
    model = skyarm.Model(vehicle=vehicle())
    refused(
        "vehicle",
        value,
        "must be a name or a path",
        lambda: skyarm.load_vehicle(value),
        skyarm.VehicleError,
    )
    refused(
        "scenario",
        value,
        "must be a name or a path",
        lambda: skyarm.load_scenario(value),
        skyarm.ScenarioError,
    )
    refused(
        "controller.preset",
        value,
        "must be one of",
        lambda: skyarm.preset(value, model),
    )
    refused(
        "controller.law",
        value,
        "must be one of",
        lambda: skyarm.make_controller(value, model),
    )


@pytest.mark.parametrize(
    ("name", "reason"),
    [("a\0.toml", "no such file"), ("a" * 5000 + ".toml", "name too long")],
)
def test_names_that_no_file_can_have_are_refused_on_a_short_line(
    name: str, reason: str
) -> None:
    for load, kind in (
        (skyarm.load_vehicle, skyarm.VehicleError),
        (skyarm.load_scenario, skyarm.ScenarioError),
    ):
        with pytest.raises(kind) as error:
            load(name)
        assert reason in str(error.value)
        assert len(str(error.value)) < 200 + len(", ".join(skyarm.list_scenarios()))


@pytest.mark.parametrize(
    ("keyword", "value", "field"),
    [
        *(("controller", each, "controller") for each in (["paper_ct"], 3, "lqr")),
        *(("plant", each, "plant.kind") for each in (["mujoco"], 3, "gazebo")),
        *(("seed", each, "seed") for each in ("x", 1.5, True, -1, [1])),
        *(("duration", each, "duration") for each in ("x", [1], np.nan, True)),
    ],
)
def test_a_wrong_keyword_of_a_scenario_is_refused(
    keyword: str, value: Any, field: str
) -> None:
    refused(
        field,
        value,
        "must be",
        lambda: skyarm.load_scenario("case1", **{keyword: value}),
        skyarm.ScenarioError,
    )


FIELDS = (
    "wind",
    "rates",
    "plant",
    "controller",
    "reference",
    "noise",
    "delays",
    "title",
    "ground",
    "seed",
)


@pytest.mark.parametrize(
    "field", [*FIELDS, "episode", "duration", "name", "kind", "integrator"]
)
def test_replacing_a_field_by_what_it_cannot_hold_is_refused(field: str) -> None:
    said = {"kind": "plant.kind", "integrator": "plant.integrator"}.get(field, field)
    for value in (None, [1]):
        call = functools.partial(dataclasses.replace, scenario(), **{field: value})
        refused(said, value, "must be", call, skyarm.ScenarioError)
    refused(
        "initial",
        3,
        "must be a State or None",
        lambda: dataclasses.replace(scenario(), initial=3),
    )


def turning(*speeds: float) -> skyarm.Scenario:
    start = first_state(scenario())
    return dataclasses.replace(
        scenario(), initial=dataclasses.replace(start, rotor_speeds=speeds)
    )


def test_rotors_start_at_speeds_that_they_can_turn_at() -> None:
    """Speeds are unsigned, the turn is the rotor's; 838 rad/s is the Hummingbird's
    highest.
    """
    allowed = "must be from 0 to 838 rad/s, the range of rotor 'back'"
    for speed in (-400.0, -1e-9, 838.1, 1e9):
        call = functools.partial(skyarm.run, turning(480.0, 480.0, speed, 480.0))
        refused("initial.rotor_speeds[2]", speed, allowed, call, skyarm.ScenarioError)
        with pytest.raises(skyarm.ScenarioError, match=r"initial\.rotor_speeds\[2\]"):
            skyarm.with_numbers(scenario(), {"initial.rotor_speeds.2": speed})
    for speed in (0.0, 838.0):
        check_scenario(turning(*(speed,) * 4))


def test_whole_numbers_of_numpy_are_whole_numbers() -> None:
    for found in (
        skyarm.load_scenario("case1", seed=np.int64(3), duration=np.float32(0.5)),
        dataclasses.replace(scenario(), seed=np.uint8(3), duration=np.int64(1)),
    ):
        assert found.seed == 3
        assert (type(found.seed), type(found.duration)) == (int, float)
    assert skyarm.Rates(physics=np.int64(500), control=np.int32(100)) == skyarm.Rates(
        physics=500, control=100
    )
    assert type(skyarm.Rates(physics=np.int64(500), control=100).physics) is int
    refused("rates.physics", 500.5, "whole number", lambda: skyarm.Rates(physics=500.5))  # type: ignore[arg-type]
