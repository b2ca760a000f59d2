"""The page on the choice of a law: what a law reads and can do is what its table shows,
and its names are names.
"""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.catalogue import (
    BEARS_UNDRIVEN,
    LAWS,
    PRESETS,
    is_named,
    make_controller,
    tuned_factors,
)
from skyarm.control.laws.centroidal.options import VALUES
from skyarm.records.leaves import leaves
from support.pages import DOCS

PAGE = (DOCS / "choose_a_law.md").read_text("utf-8")
(TABLE,) = re.findall(r"<!-- needs;.*?-->\n(.*?)<!-- /needs -->", PAGE, re.DOTALL)
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in TABLE.splitlines()[2:]
]
NEEDS = {row[0].strip("`"): row[1:] for row in ROWS}


def made(law: str, **options: Any) -> skyarm.Scenario:
    """A short flight of Case 3 under a law."""
    planned = skyarm.load_scenario("case3", duration=0.1)
    mode = {"mode": "tip"} if law == "centroidal" else {}
    controller = make_controller(law, planned.controller.par.model, **mode, **options)
    return dataclasses.replace(planned, controller=controller)


def commands(planned: skyarm.Scenario, begin: int = 0, **changed: Any) -> list[float]:
    """Commands of the first periods of a flight whose law is called with measurements
    changed from ``begin`` on.
    """
    session, controller = skyarm.Session(planned), planned.controller
    memory, found = controller.memory, list[float]()
    for k in range(4):
        measured = session.measurement
        if k >= begin:
            values = {
                name: change(getattr(measured, name))
                for name, change in changed.items()
            }
            measured = dataclasses.replace(measured, **values)
        memory, command = controller.law(
            memory, measured, session.reference, 0.005, par=controller.par
        )
        found += leaves(command)
        session.step()
    return found


def shaken(force: Vec3) -> Vec3:
    return force + Vec3(0.3, -0.2, 0.5)


def bent(numbers: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(1.02 * each + 0.01 for each in numbers)


CHANGES = {"specific_force": shaken, "rotor_speeds": bent, "joints": bent}
"""Channels of the first three columns."""


def test_every_law_has_a_row() -> None:
    assert set(NEEDS) == set(LAWS)


@pytest.mark.parametrize("law", NEEDS)
def test_a_law_reads_and_can_do_what_its_row_shows(law: str) -> None:
    planned = made(law)
    usual = commands(planned)
    for shown, (channel, change) in zip(NEEDS[law][:3], CHANGES.items(), strict=True):
        assert (commands(planned, **{channel: change}) != usual) == (shown != "no"), (
            channel
        )
    assert NEEDS[law][3] == ("yes" if "interaction" in LAWS[law].options() else "no")
    assert NEEDS[law][4] == ("yes" if planned.controller.compiled else "no")


def test_the_presets_of_a_row_are_those_of_its_law() -> None:
    for law, (*_, shown) in NEEDS.items():
        presets = {name for name, preset in PRESETS.items() if preset.law == law}
        assert set(re.findall(r"`(\w+)`", shown)) == presets, law


def test_every_law_but_those_without_gains_of_its_own_has_tuned_gains() -> None:
    assert set(LAWS) - set(tuned_factors()) == {"centroidal", "rotors_sim_position"}
    for law, same in (
        ("hybrid_ct", "hybrid_computed_torque"),
        ("admittance_pd", "decoupled_pd"),
    ):
        assert commands(made(law)) == pytest.approx(commands(made(same)))


def test_without_an_accelerometer_the_centroidal_law_flies_by_velocities() -> None:
    assert NEEDS["centroidal"][0] == "used if there"
    blank = commands(
        made("centroidal"), specific_force=lambda force: Vec3(0.0, 0.0, 0.0)
    )
    # its estimate of the noise still looks at three zeros: hundredths of a rad/s
    assert blank == pytest.approx(
        commands(made("centroidal", accelerometer=(0.0, 0.0))), abs=0.01
    )
    assert blank != pytest.approx(commands(made("centroidal")), abs=0.5)


def test_the_options_that_spare_a_sensor_do() -> None:
    # its first period takes the speeds of the start
    spared = made("indi", measured_speeds=False)
    assert commands(spared, 1, rotor_speeds=bent) == commands(spared)
    assert commands(made("indi"), 1, rotor_speeds=bent) != commands(made("indi"))
    second = made("ct_ladder", steps=2)
    assert commands(second, rotor_speeds=bent) == commands(second)
    assert NEEDS["ct_ladder"][1] == "needed by `steps` 3 to 6"
    third = made("ct_ladder", steps=3)
    assert commands(third, rotor_speeds=bent) != commands(third)


def test_the_names_to_start_with_are_names() -> None:
    table = PAGE.split("## Pick a law")[1].split("## ")[0]
    rows = [line.split("|")[2] for line in table.splitlines() if line.startswith("|")][
        2:
    ]
    names = [
        name
        for row in rows
        for name in re.findall(r"`(\w+)`", row)
        if name != "interaction"
    ]
    assert len(rows) >= 9
    assert all(is_named(name) for name in names), names
    assert all(
        f"`{name}`" in PAGE.split("## If it fails")[1] for name in BEARS_UNDRIVEN
    )


def test_the_defaults_of_the_settings_are_those_of_the_law() -> None:
    table = PAGE.split("## Adapt it")[1].split("```")[0]
    shown: dict[str, list[str]] = {}
    for name, value in re.findall(r"^\| `(\w+)(?:\[\d\])?` \((.*?)\) \|", table, re.M):
        shown.setdefault(name, []).extend(re.findall(r"[\d.]+", value))
    assert len(shown) == 4
    for name, numbers in shown.items():
        held = VALUES[name]
        assert [float(each) for each in numbers] == list(
            held if isinstance(held, tuple) else (held,)
        ), name
