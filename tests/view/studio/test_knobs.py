"""Sliders come from the records: every number that may move, with its unit, and what a
plugin adds by itself.
"""

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.records.registry import registrations
from skyarm.records.units import Unit
from skyarm.scenario.numbers import number_at, require_apart, with_numbers
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.view.studio.fleet import Fleet, law_names, pushes_of
from skyarm.view.studio.knobs import AdjustableNumber, knobs_of
from skyarm.world import Wrench

GROUPS = {
    "law",
    "reference",
    "wind and forces",
    "payload",
    "sensors",
    "delay",
    "faults",
}

LIBRARY = Path(skyarm.__file__).parent / "scenario" / "library"


@dataclass(frozen=True, kw_only=True, slots=True)
class Tug(skyarm.Force):
    """A tether that pulls with a force."""

    pull: Annotated[float, Unit("N", "of the tether", low=0.0, high=3.0)]

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Any) -> Any:
        return (Wrench(force_W=Vec3(self.pull, 0, 0)),)


def knobs(case: str, law: str | None = None) -> dict[str, AdjustableNumber]:
    scenario = Fleet(case).under(law)
    return {
        knob.path: knob for knob in knobs_of(scenario, pushes_of(scenario).values())
    }


FLOWN = [
    *((case, None) for case in list_scenarios()),
    *(("case2", law) for law in ("centroidal_tip", "nmpc")),
]


@pytest.mark.parametrize(("case", "law"), [*FLOWN, ("case3_wind", "l1_adaptive_tuned")])
def test_every_slider_holds_a_number_of_the_scenario(
    case: str, law: str | None
) -> None:
    fleet = Fleet(case)
    scenario = fleet.under(law)
    found = knobs_of(scenario, pushes_of(scenario).values())
    require_apart(scenario, [knob.path for knob in found])  # no number has two sliders
    # a delay varies in machine code, which nmpc has not; a load hangs at a tip
    tips = any(vehicle.end_effector for vehicle in scenario.vehicles.values())
    without = ({"delay"} if law == "nmpc" else set()) | (set() if tips else {"payload"})
    assert {knob.group for knob in found} == GROUPS - without
    for knob in found:
        assert number_at(scenario, knob.path) == knob.value
        assert knob.low <= knob.value <= knob.high, knob
        assert knob.low < knob.high
        assert 50 <= (knob.high - knob.low) / knob.step <= 201, knob


def test_units_and_bounds_are_those_of_the_records() -> None:
    found = knobs("case2_gust")
    for path, unit in {
        "controller.gains.position.x": "N/m",
        "controller.joint_gains.damping.1": "1/s",
        "reference.base.z": "m",
        "reference.joints.0.frequency_hz": "Hz",
        "environment.wind.force.x": "N",
        "environment.wind.air_velocity.x": "m/s",
        "plant.payload.mass": "kg",
        "sensors.rate": "rad/s",
        "delays.command": "s",
    }.items():
        assert found[path].declared.unit == unit, path
    share = found["environment.faults.front.effectiveness"]
    assert (share.low, share.high, share.value) == (0.0, 1.0, 1.0)
    assert found["sensors.position"].low == 0.0
    assert not any(path.startswith("environment.forces") for path in found)


def test_a_circle_is_moved_by_the_words_of_the_file() -> None:
    found = knobs("case3")
    assert found["reference.base.radius"].value == 0.3
    assert "reference.x.signals.1.signal.signal.amplitude" not in found


def test_a_law_has_its_own_gains() -> None:
    found = knobs("case2", "centroidal_tip")
    assert found["controller.observer.force"].declared.unit == "rad/s"
    assert "controller.gains.position.x" not in found
    assert not any(".mixer." in path for path in found)


def test_what_a_plugin_adds_has_a_slider(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(
        import_module("skyarm.records.registry.registrations")._FOUND,
        "force",
        dict(registrations("force")),
    )
    skyarm.register.force("tug")(Tug)
    file = tmp_path / "tug.toml"
    file.write_text(
        (LIBRARY / "case1.toml").read_text()
        + '[[environment.forces]]\nkind = "tug"\npull = 0.5\n'
    )
    knob = knobs(str(file))["environment.forces.tug.pull"]
    assert (knob.declared.unit, knob.low, knob.high, knob.value) == ("N", 0.0, 3.0, 0.5)


def test_a_value_is_clipped_to_its_slider_and_must_be_a_number() -> None:
    knob = knobs("case1")["plant.payload.mass"]
    assert (knob.clip(-1), knob.clip(99.0), knob.clip(0.1)) == (0.0, knob.high, 0.1)
    for wrong in (float("nan"), float("inf"), "1", None, True, [1.0]):
        with pytest.raises(ValueError, match=r"plant\.payload\.mass = "):
            knob.clip(wrong)


@pytest.mark.parametrize("law", law_names()[::3])
def test_every_law_of_the_menu_is_one_of_a_file(law: str) -> None:
    plain = skyarm.load_scenario("case2", controller=law)
    assert Fleet("case2").under(law).controller == plain.controller


@pytest.mark.parametrize("name", list_scenarios())
def test_every_shipped_scenario_flies_with_its_sliders_where_they_are(
    name: str,
) -> None:
    """What a flight of the page begins with: each number as data that may move, which
    changes nothing of the kind.
    """
    fleet = Fleet(name)
    scenario = fleet.scenario
    values = {
        knob.path: number_at(scenario, knob.path)
        for knob in knobs_of(scenario, pushes_of(scenario).values())
    }
    moved = with_numbers(scenario, values)
    assert moved.law_names == scenario.law_names
    assert {path: number_at(moved, path) for path in values} == values
