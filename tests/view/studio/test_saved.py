"""A flight that a hand has led, saved: the file flies it again to the bit."""

from pathlib import Path

import pytest

import skyarm
from skyarm.records.files import read_toml
from skyarm.scenario.scenario_file import scenario_from
from skyarm.view.studio.fleet import (
    Fleet,
    flown_document,
    load_fleet,
    make_flight,
    prepare,
    read_document,
    save_flights,
    saved_document,
)

BITS = (
    "position",
    "quaternion",
    "rate",
    "joints",
    "joint_rates",
    "rotor_speeds",
    "rotor_commands",
    "measured_position",
)


def led(source: str, law: str) -> Fleet:
    """A flight under pushes, noise, a payload, a fault and another delay."""
    fleet = load_fleet(source)
    fleet.join(make_flight(fleet.prepared, law))
    fleet.go(60)
    fleet.move({"environment.wind.force.y": 0.5, "sensors.position": 0.002})
    fleet.go(120)
    fleet.push((0.0, 1.0, 0.0), 10.0, 0.1)
    fleet.move({"plant.payload.mass": 0.02, "reference.base.z": 1.1, "delays.command": 0.003})
    fleet.go(200)
    fleet.move({"plant.payload.mass": 0.04, "environment.faults.front.effectiveness": 0.98}, 0)
    fleet.go(400)
    fleet.go(260)
    fleet.move({"environment.wind.force.y": 0.0, "controller.gains.position.x": 5.0})
    fleet.go(320)
    return fleet


@pytest.fixture(scope="module")
def fleet() -> Fleet:
    return led("case2_gust", "paper_ct")


@pytest.fixture(scope="module")
def saved(fleet: Fleet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("saved")
    words = save_flights(fleet, folder)
    file = folder / "case2_gust_paper_ct.toml"
    assert words == f"saved; fly it again: skyarm run {file}"
    return file


def test_a_saved_scenario_flies_the_flight_again_to_the_bit(fleet: Fleet, saved: Path) -> None:
    log, shown = skyarm.run(skyarm.load_scenario(saved)), fleet.flights[0].session.log
    for field in BITS:
        assert getattr(log, field).tobytes() == getattr(shown, field).tobytes(), field
    plain = skyarm.run(skyarm.load_scenario("case2_gust", duration=1.6))
    assert abs(plain.position - log.position).max() > 0.02


def test_the_file_says_what_was_moved_and_nothing_else(saved: Path) -> None:
    document = read_toml(saved.read_bytes())
    assert document["controller"] == {"preset": "paper_ct"}
    assert document["duration"] == 1.6
    moved = [(each["at"], each["path"]) for each in document["changes"]]
    assert moved[:2] == [(0.3, "environment.wind.force.y"), (0.3, "sensors.position")]
    assert moved[-1] == (1.3, "controller.gains.position.x")
    assert document["environment"]["forces"][0]["kind"] == "force_wind"
    # windows of the paper lie beyond the flight
    assert "windows" not in document


def test_a_second_file_takes_the_place_of_none(fleet: Fleet, saved: Path) -> None:
    before = saved.read_bytes()
    assert "case2_gust_paper_ct_1.toml" in save_flights(fleet, saved.parent)
    assert saved.read_bytes() == before


def test_an_untouched_flight_is_saved_as_the_scenario_was() -> None:
    document, folder = read_document("case1")
    kept = flown_document(prepare(document, folder), None, 30.0, (), Path())
    assert kept == document


@pytest.mark.parametrize(
    "path",
    [
        "environment.wind.force.x",
        pytest.param("delays.command", marks=pytest.mark.thorough),
        pytest.param("environment.faults.0.effectiveness", marks=pytest.mark.thorough),
    ],
)
def test_parts_of_the_file_that_its_changes_need_are_saved(tmp_path: Path, path: str) -> None:
    values = {"delays.command": 0.01, "environment.wind.force.x": 2.0, "environment.faults.0.effectiveness": 0.9}
    document, folder = read_document("case1")
    document["duration"] = 1.0
    del document["windows"]
    document["environment"] = {
        "wind": {"mode": "force_wind"},
        "faults": [{"rotor": "front", "effectiveness": 1.0, "start": 0.0}],
    }
    document["delays"] = {"longest_command": 0.03}
    document["changes"] = [{"at": 0.1, "path": path, "value": values[path]}]
    fleet = Fleet(prepare(document, folder), "case1")
    fleet.join(make_flight(fleet.prepared, None))
    fleet.go(60)
    kept = saved_document(fleet, fleet.flights[0], tmp_path)
    assert [kept[table] for table in ("environment", "delays", "changes")] == [
        document[table] for table in ("environment", "delays", "changes")
    ]
    save_flights(fleet, tmp_path)
    log = skyarm.run(skyarm.load_scenario(next(tmp_path.glob("*.toml"))))
    assert log.position.tobytes() == fleet.flights[0].session.log.position.tobytes()
    del document["changes"]
    assert log.position.tobytes() != skyarm.run(scenario_from({**document, "duration": 0.3}, folder)).position.tobytes()


def test_a_lost_vehicle_is_lost_again(tmp_path: Path) -> None:
    fleet = load_fleet("case1")
    fleet.join(make_flight(fleet.prepared, "paper_pd"))
    fleet.go(40)
    fleet.move({"environment.faults.left.effectiveness": 0.0})
    fleet.go(900)
    flight = fleet.flights[0]
    assert flight.lost
    save_flights(fleet, tmp_path)
    log = skyarm.run(skyarm.load_scenario(tmp_path / "case1_paper_pd.toml"))
    assert (log.status, log.info["cause"]) == (flight.session.ended.status, flight.lost)  # type: ignore[union-attr]
    assert log.position.tobytes() == flight.session.log.position.tobytes()


def test_nothing_flown_is_nothing_to_save(tmp_path: Path) -> None:
    fleet = load_fleet("case1")
    fleet.join(make_flight(fleet.prepared, "paper_pd"))
    with pytest.raises(skyarm.ScenarioError, match="nothing has been flown"):
        save_flights(fleet, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_vehicle_of_ones_own_is_found_from_the_new_place(tmp_path: Path) -> None:
    own = tmp_path / "mine"
    own.mkdir()
    source = Path(skyarm.__file__).parent / "vehicle" / "library" / "hummingbird_arm2_rotors.toml"
    (own / "bird.toml").write_bytes(source.read_bytes())
    text = (Path(skyarm.__file__).parent / "scenario" / "library" / "case1.toml").read_text()
    file = own / "flight.toml"
    file.write_text(text.replace('"hummingbird_arm2_rotors"', '"bird.toml"'))
    fleet = load_fleet(str(file))
    fleet.join(make_flight(fleet.prepared, None))
    fleet.go(20)
    document = saved_document(fleet, fleet.flights[0], tmp_path / "out")
    assert document["plant"]["vehicle"] == "../mine/bird.toml"
    assert document["controller"] == {"preset": "paper_ct"}
