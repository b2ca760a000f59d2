"""Numbers beyond any machine are refused by the bound of their own field, wherever they
are stated.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Sym3
from skyarm.scenario.in_flight import require_changes
from skyarm.scenario.scenario_record import Change
from skyarm.studies.assess.assessment import assess_vehicle
from skyarm.vehicle import Body
from support.cases import sampled
from support.commands import refused
from support.commands import skyarm as command

CASE = skyarm.load_scenario("case3")
ARM = skyarm.load_vehicle("hexarotor_arm6")
TEXT = """
schema = 1
name = "absurd"
duration = 0.5
{top}
[plant]
vehicle = "hummingbird_arm2_rotors"
{plant}
[controller]
law = "decoupled_pd"
[reference]
base = {{ kind = "hover", position = [0.0, 0.0, 1.0] }}
{more}
"""


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"plant": "gravity = 1e300"}, "plant.gravity = 1e+300: must be at most 1e+06"),
        (
            {"plant": "payload = { mass = 1e300 }"},
            "plant.payload.mass = 1e+300: must be at most 10000",
        ),
        (
            {"more": "[[payloads]]\nname = 'b'\npick = 0.1\nmass = 1e5"},
            "payloads[0].mass = 100000.0: must be at most",
        ),
        (
            {"more": "[initial]\njoints = [0.0, 1e300]"},
            "initial.joints[1] = 1e+300: must be at most",
        ),
        ({"top": "seed = -1"}, "seed = -1: must be"),
        ({"top": "rates = { physics = 1e300 }"}, "rates.physics = 1"),
        (
            {"top": "delays = { command = 1e300 }"},
            "delays.command = 1e+300: must be at most",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_number_of_a_file_is_refused_by_its_name(
    tmp_path, given: dict[str, str], said: str
) -> None:
    file = tmp_path / "absurd.toml"
    file.write_text(TEXT.format(**{"top": "", "plant": "", "more": "", **given}))
    with pytest.raises(skyarm.ScenarioError) as error:
        skyarm.load_scenario(file)
    assert f"absurd.toml: {said}" in str(error.value)


GRAVITY = [
    (("check", "hummingbird"),),
    (("show", "hummingbird"),),
    (("export", "hummingbird", "--to", "mjcf", "--out", "a.xml"),),
    (
        (
            "export",
            "decoupled_pd",
            "--vehicle",
            "hummingbird",
            "--to",
            "c",
            "--out",
            "a.c",
        ),
    ),
    (("identify", "flight.csv", "--vehicle", "hummingbird"),),
]


@pytest.mark.parametrize("words", sampled(GRAVITY, 5))
def test_gravity_has_one_bound_in_every_command(tmp_path, monkeypatch, words) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "flight.csv").write_text("time\n0.0\n")
    refused(
        command(*words, "--gravity=1e300"), "--gravity = 1e+300: must be at most 1e+06"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["flight.csv"]


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("plant.gravity", 1e300, "plant.gravity = 1e+300: must be at most 1e+06"),
        (
            "plant.payload.mass",
            1e300,
            "plant.payload.mass = 1e+300: must be at most 10000",
        ),
        ("model.payload.mass", -1.0, "model.payload.mass = -1.0: must be at least 0"),
        ("plant.vehicle.base.mass", 1e300, "mass = 1e+300: must be at most 1e+09"),
        (
            "plant.vehicle.base.inertia.xx",
            1e300,
            "inertia.xx = 1e+300: must be at most 1e+09",
        ),
    ],
)
def test_a_number_of_a_study_or_a_change_is_refused_alike(
    path: str, value: float, said: str
) -> None:
    changed = dataclasses.replace(
        CASE, changes=(Change(at=0.1, path=path, value=value),)
    )
    for make in (
        lambda: skyarm.with_numbers(CASE, {path: value}),
        lambda: require_changes(changed),
    ):
        with pytest.raises(ValueError) as error:  # noqa: PT011
            make()
        assert said in str(error.value)


def based(*moments: float) -> skyarm.Vehicle:
    return dataclasses.replace(
        ARM, base=dataclasses.replace(ARM.base, inertia=Sym3.from_numbers(*moments))
    )


@pytest.mark.parametrize(
    "moments", [(0.0, 0.0, 0.0), (0.0, 0.02, 0.02), (1e-300, 0.02, 0.02)]
)
def test_a_base_with_an_axis_without_inertia_is_refused_whatever_its_arm_has(
    moments,
) -> None:
    with pytest.raises(
        skyarm.VehicleError,
        match=r"^base.inertia = .*must leave no axis without inertia",
    ):
        based(*moments)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: based(1e300, 1e300, 1e300),
            "inertia.xx = 1e+300: must be at most 1e+09",
        ),
        (lambda: Body(mass=1e300), "body.mass = 1e+300: must be at most 1e+09"),
        (
            lambda: Body(mass=1.0, inertia=Sym3(1.0, np.inf, 1.0)),
            "body.inertia.yy = inf: must be a finite number",
        ),
        (
            lambda: skyarm.Truth(vehicle=ARM, gravity=1e300),
            "plant.gravity = 1e+300: must be at most 1e+06",
        ),
        (
            lambda: skyarm.Model(vehicle=ARM, gravity=1e300),
            "model.gravity = 1e+300: must be at most 1e+06",
        ),
        (
            lambda: assess_vehicle(ARM, payload=1e300),
            "--payload = 1e+300: must be at most 10000",
        ),
        (
            lambda: assess_vehicle(ARM, gravity=1e300),
            "--gravity = 1e+300: must be at most 1e+06",
        ),
    ],
)
def test_a_number_in_python_is_refused_by_its_name(make: Any, said: str) -> None:
    with pytest.raises(ValueError) as error:  # noqa: PT011
        make()
    assert said in str(error.value)


def test_a_link_of_next_to_no_inertia_is_refused_by_its_inertia_and_a_point_flies() -> (
    None
):
    link = ARM.links[-1]

    def of(moment: float) -> skyarm.Vehicle:
        body = dataclasses.replace(
            link.body, inertia=Sym3.from_numbers(moment, moment, moment)
        )
        return dataclasses.replace(
            ARM, links=(*ARM.links[:-1], dataclasses.replace(link, body=body))
        )

    with pytest.raises(
        skyarm.VehicleError,
        match=rf"^links\[{link.name}\].inertia = .*must be 0 or at least 1e-15",
    ):
        of(1e-320)
