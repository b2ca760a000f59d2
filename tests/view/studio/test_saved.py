"""A flight that a hand has led, saved: its log flies it again to the bit."""

from pathlib import Path

import pytest

import skyarm
from skyarm.view.studio.fleet import Fleet

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
    fleet = Fleet(source)
    fleet.join(fleet.make_flight(law))
    fleet.go(60)
    fleet.move({"environment.wind.force.y": 0.5, "sensors.position": 0.002})
    fleet.go(120)
    fleet.push((0.0, 1.0, 0.0), 10.0, 0.1, "main")
    fleet.move(
        {"plant.payload.mass": 0.02, "reference.base.z": 1.1, "delays.command": 0.003}
    )
    fleet.go(200)
    fleet.move(
        {"plant.payload.mass": 0.04, "environment.faults.front.effectiveness": 0.98}, 0
    )
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
    file = folder / "case2_gust_paper_ct.npz"
    assert (
        fleet.save(folder)
        == f"saved; fly it again: skyarm run {file.with_suffix('.toml')}"
    )
    return file


def test_a_saved_flight_is_flown_again_to_the_bit(fleet: Fleet, saved: Path) -> None:
    scenario = saved.with_suffix(".toml")
    shown = fleet.flights[0].session.log
    logs = [
        skyarm.run(skyarm.load_scenario(saved, duration=1.6)),
        skyarm.run(skyarm.load_scenario(scenario)),
    ]
    for log in logs:
        for field in BITS:
            assert getattr(log, field).tobytes() == getattr(shown, field).tobytes(), (
                field
            )
    plain = skyarm.run(skyarm.load_scenario("case2_gust", duration=1.6))
    assert abs(plain.position - log.position).max() > 0.02


def test_the_log_has_what_was_moved_and_when(saved: Path) -> None:
    moved = [(each.at, each.path) for each in skyarm.load_scenario(saved).changes]
    assert moved[:2] == [(0.3, "environment.wind.force.y"), (0.3, "sensors.position")]
    assert moved[-1] == (1.3, "controller.gains.position.x")


def test_a_second_file_takes_the_place_of_none(fleet: Fleet, saved: Path) -> None:
    before = saved.read_bytes()
    assert "case2_gust_paper_ct_1.toml" in fleet.save(saved.parent)
    assert saved.with_stem("case2_gust_paper_ct_1").is_file()
    assert saved.read_bytes() == before


def test_a_lost_vehicle_is_lost_again(tmp_path: Path) -> None:
    fleet = Fleet("case1")
    fleet.join(fleet.make_flight("paper_pd"))
    fleet.go(40)
    fleet.move({"environment.faults.left.effectiveness": 0.0})
    fleet.go(900)
    flight = fleet.flights[0]
    assert flight.lost
    fleet.save(tmp_path)
    log = skyarm.run(skyarm.load_scenario(tmp_path / "case1_paper_pd.toml"))
    assert (log.status, log.info["cause"]) == (flight.session.ended.status, flight.lost)  # type: ignore[union-attr]
    assert log.position.tobytes() == flight.session.log.position.tobytes()


def test_nothing_flown_is_nothing_to_save(tmp_path: Path) -> None:
    fleet = Fleet("case1")
    fleet.join(fleet.make_flight("paper_pd"))
    with pytest.raises(skyarm.ScenarioError, match="nothing has been flown"):
        fleet.save(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_flight_of_a_log_is_repeated_from_its_own_log(
    saved: Path, tmp_path: Path
) -> None:
    fleet = Fleet(str(saved))
    fleet.join(fleet.make_flight(None))
    fleet.go(10)
    words = fleet.save(tmp_path)
    (file,) = tmp_path.iterdir()
    assert words.startswith(
        f"saved; fly it again: skyarm run {file} --duration 0.05; no file of the"
        " scenario: base: "
    )
    assert "\n" not in words
    log = skyarm.run(skyarm.load_scenario(file, duration=0.05))
    assert log.position.tobytes() == fleet.flights[0].session.log.position.tobytes()


def test_a_pair_of_files_keeps_one_name(fleet: Fleet, tmp_path: Path) -> None:
    (tmp_path / "case2_gust_paper_ct.toml").write_text("my own")
    fleet.save(tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [
        "case2_gust_paper_ct.toml",
        "case2_gust_paper_ct_1.npz",
        "case2_gust_paper_ct_1.toml",
    ]
    assert (tmp_path / "case2_gust_paper_ct.toml").read_text() == "my own"
