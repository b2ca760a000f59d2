"""A law of one's own that is wrong is one line with its file and line, before it flies,
wherever it comes from.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from skyarm.algebra import Vec3
from skyarm.control.controller import Controller
from skyarm.control.law_checks import LawError, checked_law, try_law
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.records.registry.plugins import register_law_of_file
from skyarm.reference import Reference
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import first_state
from skyarm.sensing.measurement import blank_measurement, measurement_of
from skyarm.simulate.examine import check_law
from skyarm.simulate.loop import run
from skyarm.vehicle.vehicle_files import load_vehicle
from support.components import (
    EVERYTHING,
    FINE,
    FLOWN,
    MAKERS,
    Mistake,
    registry_kept,
    returning,
    same_logs,
)


@dataclasses.dataclass(frozen=True)
class Turning:
    """Constants of a law."""

    model: Model


@pytest.fixture(autouse=True)
def _kept():
    with registry_kept():
        yield


def planned(folder: Path, mistake: Mistake):
    """The scenario with the law of a file, as the command line plans it."""
    file = folder / "mine.py"
    file.write_text(mistake.text)
    register_law_of_file(f"{file}:make")
    return load_scenario("case1", controller=f"{file}:make", duration=0.5)


@pytest.mark.parametrize("name", EVERYTHING)
def test_every_mistake_is_one_line_with_file_and_line(tmp_path, name):
    mistake = EVERYTHING[name]
    with pytest.raises(ValueError, match="law 'mine'") as caught:
        check_law(planned(tmp_path, mistake))
    line = str(caught.value)
    assert f"{tmp_path / 'mine.py'}:{mistake.line}: law 'mine' " in line
    assert line.endswith(mistake.words)
    assert "\n" not in line
    if name in FLOWN and "has memory" not in line:
        assert isinstance(caught.value, LawError)


@pytest.mark.parametrize("name", MAKERS)
def test_a_maker_that_makes_no_controller_is_one_line(tmp_path, name):
    mistake = MAKERS[name]
    with pytest.raises(ValueError, match="maker of law") as caught:
        planned(tmp_path, mistake)
    assert (
        f"{tmp_path / 'mine.py'}:{mistake.line}: maker of law"
        f" '{tmp_path / 'mine.py'}:make'" in str(caught.value)
    )
    assert str(caught.value).endswith(mistake.words)


@pytest.mark.parametrize("name", FINE)
def test_arrays_lists_and_whole_numbers_are_as_good_as_tuples_of_floats(tmp_path, name):
    plain = Mistake(returning("memory, Command(rotor_speeds=HOVER, efforts=STILL)"), "")
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
    flown = run(planned(tmp_path / "a", Mistake(FINE[name], "")))
    assert same_logs(flown, run(planned(tmp_path / "b", plain)))
    assert flown.time.size > 20


@pytest.mark.parametrize("told", ["measurement", "reference"])
def test_a_law_that_is_told_no_number_may_answer_with_none(told):
    """A filter that has no fix yet gives NaN; what a law makes of that is no mistake of
    the law.
    """

    def law(memory, measurement, reference, dt, *, par):
        height = (
            measurement.position.z if told == "measurement" else reference.position.z
        )
        return memory, Command(
            rotor_speeds=(480.0 - 10.0 * height,) * 4, efforts=(0.0, 0.0)
        )

    scenario = load_scenario("case1")
    controller = dataclasses.replace(scenario.controller, law=law, memory=())
    seen = measurement_of(first_state(scenario), Vec3(0.0, 0.0, 9.81))
    wanted = scenario.reference.at(0.0)
    lost = Vec3(0.0, 0.0, math.nan)
    try_law(controller, 0.005, seen, (wanted,) * 20)
    blind = dataclasses.replace(seen, position=lost) if told == "measurement" else seen
    nowhere = (
        dataclasses.replace(wanted, position=lost) if told == "reference" else wanted
    )
    try_law(controller, 0.005, blind, (nowhere,) * 20)

    def never(memory, measurement, reference, dt, *, par):
        found, command = law(memory, measurement, reference, dt, par=par)
        return found, dataclasses.replace(
            command, efforts=(0.0 * measurement.time, math.nan)
        )

    with pytest.raises(LawError, match=r"gives efforts\[1\] = nan in its first period"):
        try_law(dataclasses.replace(controller, law=never), 0.005, seen, (wanted,) * 20)


VOLIRO = load_vehicle("voliro_like")


def turner(tilts):
    """A law that turns the rotors of a vehicle whose rotors tilt."""

    def law(memory, seen, wanted, dt, *, par):
        return memory, Command(
            rotor_speeds=(480.0,) * 6, efforts=(0.0,) * 2, tilts=tilts
        )

    return Controller(name="mine", law=law, par=Turning(model=Model(vehicle=VOLIRO)))


def turning(tilts):
    """Its command."""
    made = turner(tilts)
    return checked_law(made)((), None, None, 0.005, par=made.par)[1]


def test_an_angle_that_is_no_number_is_named():
    words = r"gives tilts\[2\] = nan in its first period: must be a finite number"
    with pytest.raises(LawError, match=words):
        try_law(
            turner((0.0, 0.0, math.nan, 0.0, 0.0, 0.0)),
            0.005,
            blank_measurement(2, 6),
            [Reference()] * 3,
        )


@pytest.mark.parametrize(
    ("tilts", "words"),
    [
        ((0.1, 0.1), r"gives 2 tilts: must be 6, one for each rotor that tilts"),
        (("a",) * 6, r"gives tilts\[0\] as 'a': must be a number"),
        (
            (0.0, None, 0.0, 0.0, 0.0, 0.0),
            r"gives tilts\[1\] as None: must be a number",
        ),
    ],
)
def test_angles_of_rotors_that_tilt_are_looked_at(tilts, words):
    with pytest.raises(LawError, match=rf"law 'mine' {words}"):
        turning(tilts)


def test_angles_of_rotors_that_tilt_may_be_integers_or_left_out():
    assert turning(()).tilts == ()
    given = turning((0, 1, 0.5, 0, 0, 0)).tilts
    assert given == (0.0, 1.0, 0.5, 0.0, 0.0, 0.0)
    assert all(type(angle) is float for angle in given)
