"""A scenario that is written is read again as the same one, bit for bit, or it is not
written.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path

import pytest

import skyarm
from skyarm.dynamics.actuators.drive import LaggedTorque
from skyarm.log.metrics.windows import Window, Windows
from skyarm.records.files import PathLike
from skyarm.records.identity import identity
from skyarm.records.plain import plain
from skyarm.reference.signals import Constant, Windowed
from skyarm.scenario.controller_table import OwnOptionsWarning
from skyarm.scenario.document import words_of_agent
from skyarm.scenario.in_flight import with_part
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.readers import with_other_paths
from skyarm.scenario.save import scenario_text
from skyarm.scenario.scenario_differences import scenario_differences
from skyarm.scenario.scenario_file import LIBRARY
from skyarm.scenario.scenario_record import ScenarioError, first_state
from skyarm.sensing.sensor_kinds import Imu
from skyarm.vehicle.vehicle_files import LIBRARY as VEHICLES
from skyarm.world.aerodynamic_forces import RotorDrag
from support.components import registry_kept
from support.teams import TEAMS, team

PLACED = {
    "mass": 0.1,
    "pick": 1.0,
    "pick_place": {"within": 0.1, "of": [0.0, 0.0, 1.0]},
}
HEALED = {"rotor": "front", "effectiveness": 0.5, "signal": 1.0}

BLOWING = {
    "mode": "moving_air",
    "velocity": [3.0, 4.0, 0.0],
    "gust": [{"velocity": [0.0, 1.0, 0.0], "start": 1.0, "duration": 2.0}],
    "turbulence": {"altitude": 6.0, "wind_20ft": 7.0},
}
PUSHING = [
    {
        "kind": "disturbance",
        "force": [1.0, {"kind": "sine", "amplitude": 1.0, "frequency_hz": 0.3}, 0.0],
    }
]


@pytest.fixture(scope="module")
def case3() -> skyarm.Scenario:
    return skyarm.load_scenario("case3")


def saved(
    scenario: skyarm.Scenario,
    folder: Path,
    base: PathLike | Mapping[str, object] = "case3",
) -> dict[str, object]:
    """Tables of the file that a scenario is written to, which is read as the same
    scenario.
    """
    file = skyarm.save_scenario(folder / "found.toml", scenario, base)
    assert identity(skyarm.load_scenario(file)) == identity(scenario)
    return tomllib.loads(file.read_text("utf-8"))


def test_what_has_no_word_is_written_as_a_number_by_its_path(case3, tmp_path):
    numbers = {
        "plant.vehicle.base.mass": 0.8,
        "controller.gains.position.x": 4.5,
        "reference.base.radius": 0.4,
    }
    found = saved(skyarm.with_numbers(case3, numbers), tmp_path)
    assert found["plant"] == {"vehicle": "hummingbird_arm2_rotors", "gravity": 9.8}
    written = found["numbers"]
    assert written["plant.vehicle.base.mass"] == 0.8
    assert written["controller.gains.position.x"] == 4.5
    # a circle's radius is the amplitude of two sines
    assert sorted(written.values()) == [0.4, 0.4, 0.8, 4.5]


def test_a_varied_payload_is_written_as_the_numbers_of_its_link(case3, tmp_path):
    scenario = skyarm.with_numbers(case3, {"plant.payload.mass": 0.1})
    read = skyarm.load_scenario(
        skyarm.save_scenario(tmp_path / "found.toml", scenario, "case3")
    )
    assert (
        read.agent.plant.vehicle
        == scenario.agent.plant.vehicle
        != case3.agent.plant.vehicle
    )
    # no sensor of it feels the load by itself
    assert identity(read) == identity(scenario.with_loads_of(case3))


@pytest.mark.filterwarnings("ignore:.*only the log has its readings")
@pytest.mark.parametrize("path", ["plant.payload.mass", "plant.payload.tip.mass"])
def test_a_varied_payload_that_a_sensor_feels_is_written_as_its_mass(tmp_path, path):
    """Also of a file that has one already, and beside other numbers; its flight has the
    same bits.
    """
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8"))
    del tables["windows"]
    tables |= {"duration": 0.2, "sensors": {"wrist": {"kind": "force_torque"}}}
    for held in ({}, {"payload": {"mass": 0.03}}):
        base = tables | {"plant": tables["plant"] | held}
        numbers = {path: 0.1, "plant.vehicle.base.mass": 0.8}
        varied = skyarm.with_numbers(skyarm.scenario_from(base), numbers)
        read = skyarm.load_scenario(
            skyarm.save_scenario(tmp_path / "found.toml", varied, base)
        )
        assert identity(read) == identity(varied)
        assert len(read.agent.plant.loads) == 1 + len(held)
        ours, theirs = (skyarm.run(each) for each in (varied, read))
        assert (ours.position == theirs.position).all()
        for key, readings in ours.readings["wrist"].items():
            assert (readings == theirs.readings["wrist"][key]).all()


def test_what_follows_from_numbers_is_not_written(case3, tmp_path):
    path = "model.vehicle.rotors.0.thrust_coefficient"
    stronger = skyarm.with_numbers(
        case3,
        {path: 1.02 * case3.controller.par.model.vehicle.rotors[0].thrust_coefficient},
    )
    assert stronger.controller.par.mixer != case3.controller.par.mixer
    assert [*saved(stronger, tmp_path)["numbers"]] == [path]


@pytest.mark.parametrize(
    ("path", "value", "word"),
    [
        ("environment.wind", BLOWING, "wind"),
        ("environment.forces", PUSHING, "forces"),
        (
            "environment.faults",
            [{"rotor": "front", "effectiveness": 0.9, "start": 1.0}],
            "faults",
        ),
        ("environment.ground", False, "ground"),
    ],
)
def test_parts_with_words_are_written_in_them(case3, tmp_path, path, value, word):
    found = saved(with_part(case3, path, value), tmp_path)
    assert [*found["environment"]] == [word]
    assert found["plant"]["vehicle"] == "hummingbird_arm2_rotors"


def test_a_start_a_seed_and_a_duration_are_written(case3, tmp_path):
    started = skyarm.with_numbers(
        case3, {"initial.position.x": 0.2, "initial.yaw": 0.1}
    )
    found = saved(
        dataclasses.replace(started, seed=5, duration=35.0, title="Longer"), tmp_path
    )
    assert (found["seed"], found["duration"], found["title"]) == (5, 35.0, "Longer")
    assert found["initial"]["position"] == [0.2, 0.0, 1.0]
    assert "numbers" not in found


def test_a_file_elsewhere_leads_to_the_files_of_its_base(tmp_path):
    own, new = tmp_path / "own", tmp_path / "new"
    own.mkdir()
    new.mkdir()
    library = Path(skyarm.__file__).parent / "vehicle/library"
    (own / "bird.toml").write_bytes(
        (library / "hummingbird_arm2_rotors.toml").read_bytes()
    )
    text = (
        'name = "own"\nduration = 1.0\n[plant]\nvehicle ='
        ' "bird.toml"\n[controller]\npreset = "paper_ct"\n'
    )
    (own / "flight.toml").write_text(text)
    scenario = skyarm.with_numbers(
        skyarm.load_scenario(own / "flight.toml"), {"plant.gravity": 9.7}
    )
    file = skyarm.save_scenario(new / "found.toml", scenario, own / "flight.toml")
    assert (
        tomllib.loads(file.read_text("utf-8"))["plant"]["vehicle"] == "../own/bird.toml"
    )
    assert identity(skyarm.load_scenario(file)) == identity(scenario)


def test_what_words_and_numbers_cannot_say_is_refused_and_nothing_is_written(
    case3, tmp_path
):
    other = skyarm.load_scenario("case3", controller="centroidal_tip")
    other = dataclasses.replace(
        other,
        controller=dataclasses.replace(other.controller, name=case3.controller.name),
    )
    with pytest.raises(
        ScenarioError,
        match=r"found\.toml: base: must have controller\.law\.name = '.*centroidal'",
    ):
        skyarm.save_scenario(tmp_path / "found.toml", other, "case3")
    own = dataclasses.replace(
        case3, controller=dataclasses.replace(case3.controller, name="mine")
    )
    with pytest.raises(
        ScenarioError, match=r"found\.toml: controller\.law = 'mine': must be"
    ):
        skyarm.save_scenario(tmp_path / "found.toml", own, "case3")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ScenarioError, match=r"^scenario = 3: must be a Scenario"):
        skyarm.save_scenario(tmp_path / "found.toml", 3, "case3")
    with pytest.raises(
        ScenarioError, match=r"^controller = 3: must be a name or a path$"
    ):
        skyarm.save_scenario(tmp_path / "found.toml", case3, "case3", 3)
    with pytest.raises(ScenarioError, match=r"scenario = 'case33'"):
        skyarm.save_scenario(tmp_path / "found.toml", case3, "case33")


@pytest.mark.parametrize(
    ("law", "stated", "entry"),
    [
        ("paper_pd", "paper_pd", {"preset": "paper_pd"}),
        ("indi", None, {"law": "indi"}),
        ("px4", "px4", {"autopilot": "px4"}),
    ],
)
def test_a_law_in_place_of_the_bases_is_written(tmp_path, law, stated, entry):
    scenario = skyarm.load_scenario("case3", controller=law)
    file = skyarm.save_scenario(tmp_path / "found.toml", scenario, "case3", stated)
    assert identity(skyarm.load_scenario(file)) == identity(scenario)
    assert tomllib.loads(file.read_text("utf-8"))["controller"] == entry


def test_a_file_of_gains_is_named_from_the_new_folder_and_layers_stay(
    tmp_path, monkeypatch
):
    (tmp_path / "gains.toml").write_text(
        'schema = 1\n[law]\npreset = "paper_ct"\n[gains]\n"gains.position.x" = 3.0\n'
    )
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8"))
    safe = tables | {"controller": tables["controller"] | {"safety": True}}
    monkeypatch.chdir(tmp_path)
    scenario = skyarm.scenario_from(safe, replaced={"controller": "gains.toml"})
    file = skyarm.save_scenario("new/found.toml", scenario, safe, "gains.toml")
    assert identity(skyarm.load_scenario(file)) == identity(scenario)
    assert tomllib.loads(file.read_text("utf-8"))["controller"] == {
        "tuned": "../gains.toml",
        "safety": True,
    }


def test_files_of_changes_are_found_from_another_folder_than_the_base(tmp_path):
    (tmp_path / "gains.toml").write_text(
        'schema = 1\n[law]\npreset = "paper_ct"\n[gains]\n"gains.position.x" = 3.0\n'
    )
    base = tmp_path / "base.toml"
    change = '[[changes]]\nat = 1.0\npath = "controller.law"\nvalue = "gains.toml"\n'
    base.write_text(f"{(LIBRARY / 'case3.toml').read_text('utf-8')}\n{change}", "utf-8")
    scenario = skyarm.load_scenario(base)
    file = skyarm.save_scenario(tmp_path / "new/found.toml", scenario, base)
    assert identity(skyarm.load_scenario(file)) == identity(scenario)


def test_of_a_shortened_flight_nothing_is_written_that_lies_beyond_its_end(
    case3, tmp_path
):
    changes = (
        skyarm.Change(at=0.5, path="plant.gravity", value=9.7),
        skyarm.Change(at=6.0, path="plant.gravity", value=9.6),
    )
    short = dataclasses.replace(case3, changes=changes, duration=1.0)
    assert short.windows.steady.stop > 1.0
    file = skyarm.save_scenario(tmp_path / "found.toml", short, "case3")
    found = skyarm.load_scenario(file)
    assert found.windows == Windows()
    assert found.changes == changes[:1]
    log, again = skyarm.run(short), skyarm.run(found)
    assert again.position.tobytes() == log.position.tobytes()
    assert again.info["windows"] == log.info["windows"]
    assert skyarm.score(again) == skyarm.score(log)


PICK = {"kind": "pick", "payload": "box", "position": [0.1, 0.0, 1.0], "dwell": 1.0}
BOX = {"name": "box", "mass": 0.05, "believed": True}
CARRYING = {
    "name": "carrying",
    "duration": 6.0,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {"preset": "paper_ct"},
    "reference": {
        "base": {"kind": "phases", "position": [0.0, 0.0, 1.0], "phases": [PICK]}
    },
    "payloads": [BOX],
}


def test_what_follows_from_payloads_and_tasks_is_not_written_twice(tmp_path):
    scenario = skyarm.scenario_from(CARRYING)
    (box,), (told,) = scenario.payloads, scheduled_changes(scenario)
    assert (told.path, told.at) == ("model.payload.mass", box.pick)
    own = skyarm.Change(at=box.pick + 0.5, path="plant.gravity", value=9.7)
    first = skyarm.Change(at=0.5, path="plant.gravity", value=9.7)
    bag = skyarm.TimedPayload(name="bag", mass=0.02, pick=0.5)
    for changed in (
        dataclasses.replace(scenario, changes=(own,)),
        dataclasses.replace(scenario, changes=(first,)),
        dataclasses.replace(scenario, payloads=(box, bag)),
        dataclasses.replace(
            scenario, payloads=(dataclasses.replace(box, drop=5.0), bag)
        ),
        skyarm.with_numbers(scenario, {"payloads.box.mass": 0.07}),
    ):
        found = skyarm.load_scenario(
            skyarm.save_scenario(tmp_path / "found.toml", changed, CARRYING)
        )
        assert found.payloads == changed.payloads
        assert found.changes == changed.changes
        assert scheduled_changes(found) == scheduled_changes(changed)


@pytest.mark.parametrize(
    ("name", "kind", "words"),
    [
        ("found.npz", ScenarioError, r"^path = '.*found\.npz': must end in \.toml$"),
        ("held/found.toml", OSError, r"held': must be writable \(.*\)$"),
        ("a" * 300 + ".toml", OSError, r"^file = .*: must be writable \(.*\)$"),
        (
            "a" * 300 + "/found.toml",
            OSError,
            r"^output folder = .*: must be writable \(.*\)$",
        ),
        (
            "folder.toml",
            OSError,
            r"folder\.toml': must be writable \(there is a folder of this name\)$",
        ),
    ],
)
def test_a_path_that_cannot_be_written_is_one_line(case3, tmp_path, name, kind, words):
    (tmp_path / "held").write_text("")
    (tmp_path / "folder.toml").mkdir()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(kind, match=words):
        skyarm.save_scenario(tmp_path / name, case3, "case3")
    assert sorted(tmp_path.rglob("*")) == before


GUST = skyarm.Gust(peak=[0.0, 1.0, 0.0], start=1.0, duration=2.0)


class Draught(RotorDrag):
    """A force of a class that no file names."""


def test_a_part_without_words_is_refused_by_its_word(case3, tmp_path):
    unnamed = r"found\.toml: environment\.forces: Draught is registered under no name"
    with pytest.raises(ScenarioError, match=unnamed) as caught:
        skyarm.save_scenario(
            tmp_path / "found.toml",
            dataclasses.replace(case3, forces=(Draught(),)),
            "case3",
        )
    assert "\n" not in str(caught.value)
    twice = (
        r"found\.toml: environment\.wind: gust and gusts: must not be stated both; the"
        r" same wind has all of them in"
    )
    both = skyarm.MovingAir(gust=GUST, gusts=(GUST,))
    with pytest.raises(ScenarioError, match=twice):
        skyarm.save_scenario(
            tmp_path / "found.toml", dataclasses.replace(case3, wind=both), "case3"
        )
    assert list(tmp_path.iterdir()) == []


def test_a_log_is_no_base_and_a_long_title_is_no_path(case3, tmp_path):
    with pytest.raises(
        ScenarioError,
        match=r"^base: scenario = 'flight\.npz': must be the path of a \.toml file",
    ):
        skyarm.save_scenario(tmp_path / "found.toml", case3, "flight.npz")
    saved(dataclasses.replace(case3, title="On and. " * 100), tmp_path)


@pytest.mark.parametrize(
    "fields",
    [
        {"forces": (RotorDrag(),)},
        {"forces": (skyarm.ForceWind(force_W=[1, 0, 0], gusts=(GUST,)),)},
        {"air": (skyarm.MovingAir(velocity_W=[1.0, 0.0, 0.0], gust=GUST),)},
        {"payloads": (skyarm.TimedPayload(name="bag", mass=0.1, pick=0.0),)},
        {
            "faults": (
                skyarm.Fault(rotor="front", signal=Windowed(Constant(0.5), 1.0, 2.0)),
            )
        },
        {"noise": skyarm.SensorNoise(position=0.01, joints=0.02)},
        {
            "sensors": (skyarm.NamedSensor(name="imu", sensor=Imu()),),
            "noise": skyarm.SensorNoise(rate=0.01),
        },
        {"windows": Windows(steady=Window(11.0, 20.0))},
        {
            "changes": (
                skyarm.Change(at=0.5, path="environment.wind", value={"mode": "none"}),
            )
        },
    ],
    ids=lambda fields: next(iter(fields)),
)
@pytest.mark.filterwarnings("ignore:.*only the log has its readings")
def test_records_whose_tables_have_words_of_their_own_are_written(
    case3, tmp_path, fields
):
    saved(dataclasses.replace(case3, **fields), tmp_path)


def test_gains_of_a_file_are_left_out_under_another_law():
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8"))
    stated = tables | {
        "numbers": {"controller.gains.position.x": 9.0, "plant.gravity": 9.7}
    }
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
    (tmp_path / "own/bird.toml").write_bytes(
        (library / "hummingbird_arm2_rotors.toml").read_bytes()
    )
    text = (
        'name = "own"\nduration = 1.0\n[plant]\nvehicle ='
        ' "bird.toml"\n[controller]\npreset = "paper_ct"\n'
    )
    (tmp_path / "own/flight.toml").write_text(text)
    scenario = skyarm.load_scenario(tmp_path / "own/flight.toml")
    file = skyarm.save_scenario(
        tmp_path / "link/found.toml", scenario, tmp_path / "own/flight.toml"
    )
    assert identity(skyarm.load_scenario(file)) == identity(scenario)


def test_a_base_of_another_structure_is_one_line(tmp_path):
    said = (
        r"base: must have reference\.joints\.0\.signal\.signal\.amplitude = 0\.3 like"
        r" the scenario, not \(none\), "
        r"which words and numbers do not change; choose the base it was made from, and"
        r" its law by controller$"
    )
    with pytest.raises(ScenarioError, match=said):
        skyarm.save_scenario(
            tmp_path / "found.toml", skyarm.load_scenario("case2_gust"), "case1"
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            {"plant.payload.mass": 0.1, "plant.payload.tip.mass": 0.2},
            r"^numbers: path = .*is the same number as",
        ),
        (
            {"changes.0.value": -5.0},
            r"^numbers: changes\[0\]: .*mass = -5\.0: must be at least 0",
        ),
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
            (
                r"payloads\[0\]\.pick_place = .*: unknown field; allowed: name, .*"
                r" pick, drop, believed$"
            ),
        ),
        (
            "environment",
            {"wind": {"mode": "moving_air", "gusts": []}},
            (
                r"wind\.gusts = \[\]: unknown field; did you mean 'gust'\? allowed:"
                r" mode, velocity, gust, turbulence$"
            ),
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
        (
            {"plant.gravity": -1.0},
            r"^numbers: plant\.gravity = -1\.0: must be at least 0",
        ),
        (
            {"plant.gravty": 9.0},
            (
                r"^numbers: path = 'plant\.gravty': no 'gravty' here; did you mean"
                r" 'gravity'\?"
            ),
        ),
        ({"plant.gravity": "low"}, r"^numbers: plant\.gravity = 'low': must be"),
        (
            {"plant.vehicle.base.mass": math.nan},
            r"^numbers: plant\.vehicle\.base\.mass = nan: must be a finite",
        ),
        (
            {"plant.vehicle.base.mass": -1},
            r"^numbers: plant\.vehicle\.base\.mass = -1: must be at least 0$",
        ),
        (
            {"plant.gravity": 9.7, "plant.vehicle.base.inertia.xx": 50.0},
            (
                r"^numbers: plant\.vehicle\.base\.inertia\.xx = 50\.0: .*triangle"
                r" inequality"
            ),
        ),
        (
            {"seed": 3},
            (
                r"^numbers: path = 'seed': seed is structure, must be written in its"
                r" table$"
            ),
        ),
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
    payloads = [
        {"mass": 0.1, "pick": placed, "drop": placed | {"after": 0.0}},
        {"mass": 0.2, "pick": 1.0},
    ]
    scenario = skyarm.scenario_from(tables | {"payloads": payloads})
    written = tomllib.loads(
        skyarm.save_scenario(tmp_path / "placed.toml", scenario, tables).read_text(
            "utf-8"
        )
    )
    assert written["payloads"] == [{"kind": "rigid"} | each for each in payloads]


def test_words_that_are_no_paths_stay_and_paths_without_a_suffix_do_not(tmp_path):
    (tmp_path / "own").mkdir()
    (tmp_path / "own/data").write_text("time,x\n0,0\n1,0.1\n2,0.2\n")
    (tmp_path / "own/x.py").write_text("")
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8")) | {
        "name": "own.toml",
        "title": "x.py",
    }
    samples = {"kind": "samples", "file": "data", "column": "x"}
    base = {"kind": "signals", "x": samples, "y": 0.0, "z": 1.0}
    tables |= {
        "reference": {"base": base},
        "windows": {},
        "plugins": {"need": ["x.py"]},
        "duration": 1.0,
    }
    (tmp_path / "own/own.toml").write_text(scenario_text(tables))
    with registry_kept():
        skyarm.load_plugin(tmp_path / "own/x.py")
        scenario = skyarm.load_scenario(tmp_path / "own/own.toml")
        found = saved(scenario, tmp_path, tmp_path / "own/own.toml")
    assert (found["name"], found["title"], found["plugins"]) == (
        "own.toml",
        "x.py",
        {"need": ["x.py"]},
    )
    assert found["reference"]["base"]["x"]["file"] == "own/data"


def test_a_start_that_is_taken_away_is_left_out(tmp_path):
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8")) | {
        "initial": {"position": [0.2, 0.0, 1.0]}
    }
    trimmed = dataclasses.replace(skyarm.scenario_from(tables), initial=None)
    assert "initial" not in saved(trimmed, tmp_path, tables)


def test_the_time_of_a_governor_is_planned_again_or_refused(tmp_path):
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8")) | {
        "duration": 8.0
    }
    del tables["windows"]
    short = skyarm.scenario_from(tables)
    governed, planned = (
        skyarm.govern(short, **options) for options in ({"joint_speed": 0.4}, {})
    )
    assert governed.path_time != planned.path_time
    assert saved(planned, tmp_path, tables)["reference"]["governor"] is True
    (tmp_path / "found.toml").unlink()
    with pytest.raises(
        ScenarioError,
        match=r"base: must have the \[reference\.governor\] that planned the",
    ):
        skyarm.save_scenario(tmp_path / "found.toml", governed, tables)
    assert list(tmp_path.iterdir()) == []
    stated = tables | {
        "reference": tables["reference"] | {"governor": {"joint_speed": 0.4}}
    }
    assert saved(governed, tmp_path, stated)["reference"]["governor"] == {
        "joint_speed": 0.4
    }
    assert "governor" not in saved(short, tmp_path, stated)["reference"]


def test_a_law_of_the_bases_name_with_other_options_is_that_of_the_catalogue(tmp_path):
    with pytest.warns(OwnOptionsWarning, match="^slide_up: flies centroidal_tip"):
        scenario = skyarm.load_scenario("slide_up", controller="centroidal_tip")
    assert scenario.controller.name == skyarm.load_scenario("slide_up").controller.name
    assert saved(scenario, tmp_path, "slide_up")["controller"] == {
        "preset": "centroidal_tip"
    }


def test_the_words_of_a_scenario_that_are_paths():
    samples = {"kind": "samples", "file": "a", "column": "x"}
    tables = {
        "name": "a",
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "model": {"vehicle": "a"},
        "controller": {"tuned": "a"},
        "reference": {"joints": [samples], "base": {"kind": "hover", "file": "a"}},
        "world": {"surfaces": [{"name": "a", "mesh": "a"}, {"mesh": ""}]},
        "changes": [{"at": 1.0, "path": "reference.yaw", "value": samples}],
    }
    assert with_other_paths(tables, "../{}".format) == tables | {
        "model": {"vehicle": "../a"},
        "controller": {"tuned": "../a"},
        "reference": {
            "joints": [samples | {"file": "../a"}],
            "base": {"kind": "hover", "file": "a"},
        },
        "world": {"surfaces": [{"name": "a", "mesh": "../a"}, {"mesh": ""}]},
    }
    assert with_other_paths(
        {"plant": 3, "controller": {"tuned": True}}, "../{}".format
    ) == {
        "plant": 3,
        "controller": {"tuned": True},
    }


def test_a_path_from_the_root_stays(case3, tmp_path):
    library = Path(skyarm.__file__).parent / "vehicle/library"
    (tmp_path / "bird.toml").write_bytes(
        (library / "hummingbird_arm2_rotors.toml").read_bytes()
    )
    tables = tomllib.loads((LIBRARY / "case3.toml").read_text("utf-8"))
    tables["plant"]["vehicle"] = str(tmp_path / "bird.toml")
    assert saved(skyarm.scenario_from(tables), tmp_path, tables)["plant"][
        "vehicle"
    ] == str(tmp_path / "bird.toml")


class Held(Constant):
    """A signal of a class that no file names, with the fields of one that has a
    name.
    """


def test_a_class_that_no_file_names_is_refused_by_the_word_of_its_part(case3, tmp_path):
    other = case3.with_reference(dataclasses.replace(case3.reference, yaw=Held(0.0)))
    assert other != case3
    with pytest.raises(
        ScenarioError,
        match=r"base: must be of the same classes as the scenario in reference$",
    ):
        skyarm.save_scenario(tmp_path / "found.toml", other, "case3")


FAULT = skyarm.Fault(rotor="front_right", effectiveness=0.9, start=1.0)
BAG = skyarm.TimedPayload(name="bag", mass=0.02, pick=0.5, frame="grip")


def written_team(
    scenario: skyarm.Scenario, folder: Path, base: PathLike | Mapping[str, object]
) -> dict[str, object]:
    """Tables of the file of a team, which is read as the same one, its vehicles in the
    same order.
    """
    found = saved(scenario, folder, base)
    assert [*found["agents"]] == [*scenario.agents]
    return found


@pytest.mark.parametrize("name", ["bar", "triangle", "cables"])
def test_a_team_is_written_as_its_base_where_nothing_differs(tmp_path, name):
    base = TEAMS / f"{name}.toml"
    found, stated = (
        written_team(team(name), tmp_path, base),
        tomllib.loads(base.read_text("utf-8")),
    )
    assert [word for word in stated if found[word] != stated[word]] == []


@pytest.mark.parametrize(
    ("fields", "word"),
    [
        ({"payloads": (BAG,)}, "payloads"),
        ({"noise": skyarm.SensorNoise(position=0.01)}, "sensors"),
        ({"faults": (FAULT,)}, "faults"),
        ({"initial": first_state(team("bar").of("right"))}, "initial"),
        ({"drives": (), "delays": skyarm.Delays(command=0.01)}, "delays"),
    ],
)
def test_words_of_one_vehicle_are_written_in_its_table(tmp_path, fields, word):
    bar = team("bar")
    right = dataclasses.replace(bar.agents["right"], **fields)
    found = written_team(
        dataclasses.replace(bar, agents={**bar.agents, "right": right}),
        tmp_path,
        TEAMS / "bar.toml",
    )
    assert [{*each} for each in found["agents"].values()] == [
        {"reference"},
        {"reference", word},
    ]


def test_numbers_changes_and_forces_of_a_team_are_written_once(tmp_path):
    changes = tuple(
        skyarm.Change(at=0.1, path=f"agents.{name}.plant.vehicle.base.mass", value=0.3)
        for name in ("left", "right")
    )
    numbers = {
        "agents.right.plant.vehicle.base.mass": 0.23,
        "world.grasps.0.stiffness": 4000.0,
    }
    force = skyarm.ForceWind(force_W=[0.1, 0.0, 0.0])
    changed = dataclasses.replace(
        skyarm.with_numbers(team("bar"), numbers), changes=changes, forces=(force,)
    )
    found = written_team(changed, tmp_path, TEAMS / "bar.toml")
    assert {path: each for path, each in found["numbers"].items() if each} == numbers
    assert [each["path"] for each in found["changes"]] == [
        each.path for each in changes
    ]
    assert len(found["environment"]["forces"]) == 1


def test_another_law_of_one_vehicle_or_of_all_is_written(tmp_path):
    bar, base = team("bar"), tomllib.loads((TEAMS / "bar.toml").read_text("utf-8"))
    base |= {"plant": base["plant"] | {"kind": "mujoco"}}
    indi = team("bar", controller="indi")
    one = dataclasses.replace(
        bar, agents={**bar.agents, "left": indi.agents["left"]}
    ).with_kind("mujoco")
    found = written_team(one, tmp_path, base)
    assert (found["agents"]["left"]["controller"], found["controller"]) == (
        {"law": "indi"},
        base["controller"],
    )
    found = written_team(indi.with_kind("mujoco"), tmp_path, base)
    assert "controller" not in found
    assert [each["controller"] for each in found["agents"].values()] == [
        {"law": "indi"}
    ] * 2
    base["agents"]["left"]["controller"] = base["controller"] | {"safety": True}
    safe = skyarm.scenario_from(base, replaced={"controller": "indi"})
    file = skyarm.save_scenario(tmp_path / "found.toml", safe, base, "indi")
    assert identity(skyarm.load_scenario(file)) == identity(safe)
    layers = [
        each["controller"]
        for each in tomllib.loads(file.read_text("utf-8"))["agents"].values()
    ]
    assert layers == [{"law": "indi", "safety": True}, {"law": "indi"}]


def test_the_files_of_each_vehicle_are_named_from_the_new_folder(tmp_path):
    base = tomllib.loads((TEAMS / "bar.toml").read_text("utf-8"))
    for each in base["agents"].values():
        each["plant"] = base["plant"] | {"vehicle": "bird.toml"}
    del base["plant"]
    for folder, text in (("own", scenario_text(base)), ("new", "")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "flight.toml").write_text(text)
    (tmp_path / "own/bird.toml").write_bytes((VEHICLES / "dragonfly.toml").read_bytes())
    scenario = skyarm.load_scenario(tmp_path / "own/flight.toml")
    found = written_team(scenario, tmp_path / "new", tmp_path / "own/flight.toml")
    assert {each["plant"]["vehicle"] for each in found["agents"].values()} == {
        "../own/bird.toml"
    }


def test_vehicles_of_two_files_are_written_from_the_tables_of_both(case3, tmp_path):
    swing = skyarm.load_scenario("hover_swing")
    servo = dataclasses.replace(
        case3.agent,
        faults=(skyarm.Fault(rotor="front", effectiveness=0.9),),
        drives=(
            skyarm.JointDrive(joint="joint1", drive=LaggedTorque(time_constant=0.02)),
        ),
    )
    both = skyarm.Scenario(
        name="both",
        duration=2.0,
        solver=swing.solver,
        agents={"b": servo, "a": swing.agent},
    )
    stated = {
        name: tomllib.loads((LIBRARY / f"{name}.toml").read_text("utf-8"))
        for name in ("case3", "hover_swing")
    }
    words = {"a": "hover_swing", "b": "case3"}
    own = {
        name: {
            word: each
            for word, each in stated[file].items()
            if word in words_of_agent()
        }
        for name, file in words.items()
    }
    found = written_team(
        both, tmp_path, {"name": "both", "duration": 2.0, "agents": own}
    )
    assert found["agents"]["b"]["faults"] == [
        {"kind": "loss", "rotor": "front", "effectiveness": 0.9}
    ]
    case3_plant = stated["case3"]["plant"]
    # of one vehicle, which both are then made from
    top = stated["case3"] | {"name": "both", "duration": 2.0}
    del top["windows"]
    top["plant"] = case3_plant | {"kind": "rigid_body"}
    pair = dataclasses.replace(both, agents={"a": case3.agent, "b": servo})
    found = written_team(pair, tmp_path, top)
    assert found["agents"]["a"] == {}
    drive = {"joint1": {"kind": "lagged_torque", "time_constant": 0.02}}
    assert found["plant"] == top["plant"]
    assert found["agents"]["b"]["plant"] == case3_plant | {"drives": drive}
    freed = [{"joint": "joint1", "stuck": True}]
    found = written_team(pair, tmp_path, top | {"environment": {"faults": freed}})
    assert (found["agents"]["a"]["faults"], found["environment"]) == ([], {})


@pytest.mark.parametrize(
    ("agents", "words"),
    [
        (3, r"found\.toml: agents = 3: must be a table$"),
        ({"left": 3}, r"found\.toml: agents\.left = 3: must be a table$"),
    ],
)
def test_wrong_tables_of_a_team_are_one_line(tmp_path, agents, words):
    base = tomllib.loads((TEAMS / "bar.toml").read_text("utf-8")) | {"agents": agents}
    with pytest.raises(ScenarioError, match=words):
        skyarm.save_scenario(tmp_path / "found.toml", team("bar"), base)
    assert list(tmp_path.iterdir()) == []


def test_teams_differ_by_the_paths_of_their_vehicles():
    bar = team("bar")
    numbers = {
        "agents.left.plant.vehicle.base.mass": 0.23,
        "world.grasps.0.stiffness": 4000.0,
    }
    found = scenario_differences(plain(bar), plain(skyarm.with_numbers(bar, numbers)))
    assert found == {
        "agents.left.plant.vehicle.base.mass": (0.25, 0.23),
        "world.grasps.0.stiffness": (5000.0, 4000.0),
    }
    right = dataclasses.replace(bar.agents["right"], faults=(FAULT,))
    found = scenario_differences(
        plain(bar),
        plain(dataclasses.replace(bar, agents={**bar.agents, "right": right})),
    )
    assert found["agents.right.environment.faults.0.type"] == (
        "(none)",
        "skyarm.world.faults:Fault",
    )
    found = scenario_differences(plain(bar), plain(team("bar", controller="indi")))
    assert found["agents.left.controller.name"] == ("centroidal_joint", "indi")
