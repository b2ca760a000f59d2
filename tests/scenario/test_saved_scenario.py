"""A scenario that is written is read again as the same one, bit for bit, or it is not written."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path

import pytest

import skyarm
from skyarm.log.metrics.windows import Window, Windows
from skyarm.records.identity import identity
from skyarm.reference.signals import Constant, Windowed
from skyarm.scenario.in_flight import with_part
from skyarm.scenario.scenario_file import LIBRARY
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.sensing.sensor_kinds import Imu
from skyarm.world.aerodynamic_forces import RotorDrag

PLACED = {"mass": 0.1, "pick": 1.0, "pick_place": {"within": 0.1, "of": [0.0, 0.0, 1.0]}}
HEALED = {"rotor": "front", "effectiveness": 0.5, "signal": 1.0}

BLOWING = {
    "mode": "moving_air",
    "velocity": [3.0, 4.0, 0.0],
    "gust": [{"velocity": [0.0, 1.0, 0.0], "start": 1.0, "duration": 2.0}],
    "turbulence": {"altitude": 6.0, "wind_20ft": 7.0},
}
PUSHING = [{"kind": "disturbance", "force": [1.0, {"kind": "sine", "amplitude": 1.0, "frequency_hz": 0.3}, 0.0]}]


@pytest.fixture(scope="module")
def case3() -> skyarm.Scenario:
    return skyarm.load_scenario("case3")


def saved(scenario: skyarm.Scenario, folder: Path, base: str = "case3") -> dict[str, object]:
    """Tables of the file that a scenario is written to, which is read as the same scenario."""
    file = skyarm.save_scenario(folder / "found.toml", scenario, base)
    assert identity(skyarm.load_scenario(file)) == identity(scenario)
    return tomllib.loads(file.read_text("utf-8"))


def test_what_has_no_word_is_written_as_a_number_by_its_path(case3, tmp_path):
    numbers = {"plant.vehicle.base.mass": 0.8, "controller.gains.position.x": 4.5, "reference.base.radius": 0.4}
    found = saved(skyarm.with_numbers(case3, numbers), tmp_path)
    assert found["plant"] == {"vehicle": "hummingbird_arm2_rotors", "gravity": 9.8}
    written = found["numbers"]
    assert written["plant.vehicle.base.mass"] == 0.8
    assert written["controller.gains.position.x"] == 4.5
    assert sorted(written.values()) == [0.4, 0.4, 0.8, 4.5]  # a circle's radius is the amplitude of two sines


def test_what_follows_from_numbers_is_not_written(case3, tmp_path):
    path = "model.vehicle.rotors.0.thrust_coefficient"
    stronger = skyarm.with_numbers(
        case3, {path: 1.02 * case3.controller.par.model.vehicle.rotors[0].thrust_coefficient}
    )
    assert stronger.controller.par.mixer != case3.controller.par.mixer
    assert [*saved(stronger, tmp_path)["numbers"]] == [path]


@pytest.mark.parametrize(
    ("path", "value", "word"),
    [
        ("environment.wind", BLOWING, "wind"),
        ("environment.forces", PUSHING, "forces"),
        ("environment.faults", [{"rotor": "front", "effectiveness": 0.9, "start": 1.0}], "faults"),
        ("environment.ground", False, "ground"),
    ],
)
def test_parts_with_words_are_written_in_them(case3, tmp_path, path, value, word):
    found = saved(with_part(case3, path, value), tmp_path)
    assert [*found["environment"]] == [word]
    assert found["plant"]["vehicle"] == "hummingbird_arm2_rotors"


def test_a_start_a_seed_and_a_duration_are_written(case3, tmp_path):
    started = skyarm.with_numbers(case3, {"initial.position.x": 0.2, "initial.yaw": 0.1})
    found = saved(dataclasses.replace(started, seed=5, duration=35.0, title="Longer"), tmp_path)
    assert (found["seed"], found["duration"], found["title"]) == (5, 35.0, "Longer")
    assert found["initial"]["position"] == [0.2, 0.0, 1.0]
    assert "numbers" not in found


def test_a_file_elsewhere_leads_to_the_files_of_its_base(tmp_path):
    own, new = tmp_path / "own", tmp_path / "new"
    own.mkdir()
    new.mkdir()
    library = Path(skyarm.__file__).parent / "vehicle/library"
    (own / "bird.toml").write_bytes((library / "hummingbird_arm2_rotors.toml").read_bytes())
    text = 'name = "own"\nduration = 1.0\n[plant]\nvehicle = "bird.toml"\n[controller]\npreset = "paper_ct"\n'
    (own / "flight.toml").write_text(text)
    scenario = skyarm.with_numbers(skyarm.load_scenario(own / "flight.toml"), {"plant.gravity": 9.7})
    file = skyarm.save_scenario(new / "found.toml", scenario, own / "flight.toml")
    assert tomllib.loads(file.read_text("utf-8"))["plant"]["vehicle"] == "../own/bird.toml"
    assert identity(skyarm.load_scenario(file)) == identity(scenario)


def test_what_words_and_numbers_cannot_say_is_refused_and_nothing_is_written(case3, tmp_path):
    other = dataclasses.replace(case3, controller=skyarm.load_scenario("case3", controller="paper_pd").controller)
    with pytest.raises(ScenarioError, match=r"found\.toml: base: must be of the same structure.* controller.* differ$"):
        skyarm.save_scenario(tmp_path / "found.toml", other, "case3")
    assert list(tmp_path.iterdir()) == []
    for wrong, words in ((3, r"scenario = 3: must be a Scenario"),):
        with pytest.raises(ScenarioError, match=words):
            skyarm.save_scenario(tmp_path / "found.toml", wrong, "case3")
    with pytest.raises(ScenarioError, match=r"scenario = 'case33'"):
        skyarm.save_scenario(tmp_path / "found.toml", case3, "case33")


@pytest.mark.parametrize(
    "fields",
    [
        {"forces": (RotorDrag(),)},
        {"payloads": (skyarm.TimedPayload(name="bag", mass=0.1, pick=0.0),)},
        {"faults": (skyarm.Fault(rotor="front", signal=Windowed(Constant(0.5), 1.0, 2.0)),)},
        {"noise": skyarm.SensorNoise(position=0.01, joints=0.02)},
        {"sensors": (skyarm.NamedSensor(name="imu", sensor=Imu()),), "noise": skyarm.SensorNoise(rate=0.01)},
        {"windows": Windows(steady=Window(11.0, 20.0))},
        {"changes": (skyarm.Change(at=0.5, path="environment.wind", value={"mode": "none"}),)},
    ],
    ids=lambda fields: next(iter(fields)),
)
@pytest.mark.filterwarnings("ignore:.*only the log reads it")
def test_records_whose_tables_have_words_of_their_own_are_written(case3, tmp_path, fields):
    saved(dataclasses.replace(case3, **fields), tmp_path)


def test_gains_of_a_file_are_left_out_under_another_law():
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8"))
    stated = tables | {"numbers": {"controller.gains.position.x": 9.0, "plant.gravity": 9.7}}
    assert float(skyarm.scenario_from(stated).controller.par.gains.position.x) == 9.0
    other = skyarm.scenario_from(stated, replaced={"controller": "paper_pd"})
    plain = skyarm.scenario_from(tables, replaced={"controller": "paper_pd"})
    assert other.controller == plain.controller
    assert other.plant.gravity == 9.7


def test_a_folder_that_is_a_link_leads_to_the_files_of_its_base(tmp_path):
    for folder in ("own", "real/sub"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "real/sub")
    library = Path(skyarm.__file__).parent / "vehicle/library"
    (tmp_path / "own/bird.toml").write_bytes((library / "hummingbird_arm2_rotors.toml").read_bytes())
    text = 'name = "own"\nduration = 1.0\n[plant]\nvehicle = "bird.toml"\n[controller]\npreset = "paper_ct"\n'
    (tmp_path / "own/flight.toml").write_text(text)
    scenario = skyarm.load_scenario(tmp_path / "own/flight.toml")
    file = skyarm.save_scenario(tmp_path / "link/found.toml", scenario, tmp_path / "own/flight.toml")
    assert identity(skyarm.load_scenario(file)) == identity(scenario)


def test_a_base_of_another_structure_is_one_line(tmp_path):
    with pytest.raises(ScenarioError, match=r"base: must be of the same structure"):
        skyarm.save_scenario(tmp_path / "found.toml", skyarm.load_scenario("case2_gust"), "case1")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"plant.payload.mass": 0.1, "plant.payload.tip.mass": 0.2}, r"^numbers: path = .*is the same number as"),
        ({"changes.0.value": -5.0}, r"^numbers: changes\[0\]: .*mass = -5\.0: must be at least 0"),
    ],
)
def test_numbers_of_a_file_are_checked_as_its_words_are(words, message):
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8"))
    change = {"at": 1.0, "path": "plant.vehicle.base.mass", "value": 2.0}
    with pytest.raises(ScenarioError, match=message):
        skyarm.scenario_from(tables | {"changes": [change], "numbers": words})


@pytest.mark.parametrize(
    ("table", "entry", "message"),
    [
        (
            "payloads",
            [PLACED],
            r"payloads\[0\]\.pick_place = .*: unknown field; allowed: name, .* pick, drop, believed$",
        ),
        (
            "environment",
            {"wind": {"mode": "moving_air", "gusts": []}},
            r"wind\.gusts = \[\]: unknown field; did you mean 'gust'\? allowed: mode, velocity, gust, turbulence$",
        ),
        (
            "environment",
            {"faults": [HEALED]},
            r"signal = 1\.0: must be left",
        ),
    ],
)
def test_two_spellings_of_one_thing_are_refused(table, entry, message):
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8"))
    with pytest.raises(ScenarioError, match=message):
        skyarm.scenario_from(tables | {table: entry})


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"plant.gravity": -1.0}, r"^numbers: plant\.gravity = -1\.0: must be at least 0"),
        ({"plant.gravty": 9.0}, r"^numbers: path = 'plant\.gravty': no 'gravty' here; did you mean 'gravity'\?"),
        ({"plant.gravity": "low"}, r"^numbers: values\['plant\.gravity'\] = 'low': must be"),
        ({"seed": 3}, r"^numbers: path = 'seed': seed is structure"),
        ([1.0], r"^numbers = \[1\.0\]: must be a table"),
    ],
)
def test_a_wrong_number_of_a_file_is_one_line(numbers, words):
    tables = {
        "name": "n",
        "duration": 1.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "paper_ct"},
    }
    with pytest.raises(ScenarioError, match=words):
        skyarm.scenario_from(tables | {"numbers": numbers})


def test_a_payload_that_is_taken_at_a_place_is_written_by_that_word(tmp_path):
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8"))
    placed = {"within": 0.1, "of": [0.0, 0.0, 1.0], "after": 2.0}
    payloads = [{"mass": 0.1, "pick": placed, "drop": placed | {"after": 0.0}}, {"mass": 0.2, "pick": 1.0}]
    scenario = skyarm.scenario_from(tables | {"payloads": payloads})
    written = tomllib.loads(skyarm.save_scenario(tmp_path / "placed.toml", scenario, tables).read_text("utf-8"))
    assert written["payloads"] == [{"kind": "rigid"} | each for each in payloads]
