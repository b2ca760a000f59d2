"""Gate of real flights, without a network: its halves, its coverage, and what it says
of logs that are not there.
"""

from __future__ import annotations

import hashlib
import urllib.error
from pathlib import Path

import measure_real
import numpy as np
import pytest
from planted_flights import POSES, measured, planted

from skyarm.flight_data.flight_data import Channel, FlightData

pytest.importorskip("scipy", reason="needs the extra 'identify'")

COLUMNS = """[time]
column = "t"
[gyro]
columns = ["p", "q", "r"]
[accelerometer]
columns = ["ax", "ay", "az"]
[rotor_commands]
columns = ["m1", "m2", "m3", "m4"]
low = 0.0
high = 1.0
"""

LIST = """[vehicles.hummingbird]
mass = {mass}
inertia = [{xx}, {yy}, {zz}]
places = {places}
hover = {hover}
moment_coefficient = 0.016
max_speed = {fastest}

[vehicles.heavy]
like = "hummingbird"
mass = 40.0
hover = 0.02

[[flights]]
name = "ours"
file = "ours.csv"
vehicle = "hummingbird"
rate = 500
"""


def written(folder: Path, rows: str = "") -> FlightData:
    """Write a simulated flight and its list into a folder, as a lab would lay its own
    logs.
    """
    case = planted("quad", 0, seconds=8.0)
    flight = measured(case, "low", POSES)
    (name,) = [each for each in flight if each.startswith("rotor")]
    fastest = float(case.vehicle.rotors[0].max_speed)
    signal = flight[name].values / (fastest if name == "rotor_speed_commands" else 1.0)
    sensors = [flight[each].values for each in ("gyro", "accelerometer")]
    table = np.column_stack([flight["gyro"].time, *sensors, signal])
    head = "t,p,q,r,ax,ay,az,m1,m2,m3,m4"
    np.savetxt(
        folder / "ours.csv", table, delimiter=",", header=head, comments="", fmt="%.9g"
    )
    (folder / "columns.toml").write_text(COLUMNS, "utf-8")
    inertia = {
        axis: float(getattr(case.start.base.inertia, axis))
        for axis in ("xx", "yy", "zz")
    }
    places = [
        [float(each.position.x), float(each.position.y), each.direction]
        for each in case.start.rotors
    ]
    numbers = {
        "places": places,
        "mass": float(case.start.mass),
        "hover": float(np.median(signal)),
        "fastest": fastest,
        **inertia,
    }
    (folder / measure_real.LIST).write_text(LIST.format(**numbers) + rows, "utf-8")
    return flight


def test_a_log_of_a_folder_is_fitted_on_one_half_and_predicted_on_the_other(
    tmp_path, monkeypatch, capsys
):
    """Its own list counts; a missing log and one of another SHA-256 are named. Take-off
    and landing are cut.
    """
    more = """
[[flights]]
name = "away"
vehicle = "hummingbird"
rate = 500
[[flights]]
name = "changed"
file = "ours.csv"
sha256 = "0"
vehicle = "hummingbird"
rate = 500
[[flights]]
name = "too heavy"
file = "ours.csv"
vehicle = "heavy"
rate = 500
"""
    written(tmp_path, more)
    monkeypatch.setenv("REAL_LOGS", str(tmp_path))
    assert measure_real.main(["--real"]) == 1
    printed = capsys.readouterr()
    heads, _, row, heavy = [
        line.strip("| ").split(" | ") for line in printed.out.strip().splitlines()
    ]
    cells = dict(zip(heads, row, strict=True))
    assert (cells["flight"], cells["commands, Hz"], cells["each half, s"]) == (
        "ours",
        "500",
        "3",
    )
    assert float(cells["identified, rad/s"]) < float(cells["hold, rad/s"])
    assert 0.0 <= float(cells["coverage, %"]) <= 100.0
    assert heavy[0] == "too heavy"
    assert heavy[3] == "refused"
    said = printed.err.splitlines()
    assert any(line.startswith("away: skipped: ") for line in said)
    digest = hashlib.sha256((tmp_path / "ours.csv").read_bytes()).hexdigest()
    assert f"changed: sha256 = {digest}: must be 0: fetch it anew" in said
    assert any("too heavy: refused: " in line and "lift" in line for line in said)


def test_without_a_network_nothing_is_measured_and_each_log_is_named(
    tmp_path, monkeypatch, capsys
):
    def no_network(address, timeout):
        raise urllib.error.URLError("Network is unreachable")

    monkeypatch.delenv("REAL_LOGS", raising=False)
    monkeypatch.setattr(measure_real, "CACHE", tmp_path / "cache")
    monkeypatch.setattr("urllib.request.urlopen", no_network)
    assert measure_real.main(["--real"]) == 0
    printed = capsys.readouterr()
    assert printed.out == "skipped: none of the logs is there\n"
    assert printed.err.count("skipped: <urlopen error Network is unreachable>") == 10
    assert not (tmp_path / "cache").exists()


class Answer:
    """Answer of a server: content that is read once."""

    def __init__(self, content: bytes) -> None:
        self.content = content

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    def read(self) -> bytes:
        return self.content


def test_a_log_is_fetched_once_and_only_if_it_is_what_the_list_says(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(measure_real, "CACHE", tmp_path / "cache")
    monkeypatch.setattr("urllib.request.urlopen", lambda *_, **__: Answer(b"log"))
    digest = hashlib.sha256(b"log").hexdigest()
    row = {
        "name": "a",
        "file": "a.bin",
        "url": "https://example.org/a.bin",
        "licence": "MIT",
        "sha256": digest,
    }
    with pytest.raises(ValueError, match="must be 1"):
        measure_real.file_of({**row, "sha256": "1"}, None)
    assert not (tmp_path / "cache").exists()
    assert measure_real.file_of(row, None).read_bytes() == b"log"
    assert (
        "a: fetched from https://example.org/a.bin; licence: MIT"
        in capsys.readouterr().err
    )
    monkeypatch.setattr(
        "urllib.request.urlopen", lambda *_, **__: pytest.fail("is there already")
    )
    assert measure_real.file_of(row, None) == tmp_path / "cache" / "a.bin"


def test_every_log_of_the_list_has_an_address_a_sum_a_licence_and_a_start_vehicle():
    flights, vehicles = measure_real.listed(None)
    assert len(flights) == 10
    assert (
        len({each["file"] for each in flights})
        == len({each["sha256"] for each in flights})
        == 10
    )
    for each in flights:
        assert each["url"].startswith("https://raw.githubusercontent.com/")
        assert each["url"].endswith("/" + each["file"])
        assert len(bytes.fromhex(each["sha256"])) == 32
        assert each["licence"]
        start = measure_real.vehicle_of(each["vehicle"], vehicles)
        speeds = [
            vehicles[each["vehicle"]]["hover"] * float(one.max_speed)
            for one in start.rotors
        ]
        lift = sum(
            float(one.thrust_coefficient) * speed**2
            for one, speed in zip(start.rotors, speeds, strict=True)
        )
        assert lift == pytest.approx(float(start.mass) * 9.81)


def test_halves_meet_in_the_middle_of_the_longest_time_in_the_air():
    """Two hops, of 2 and 30 s: each half is of 10 s at most, before and behind the
    middle of the second.
    """
    start = measure_real.vehicle_of("racer", measure_real.listed(None)[1])
    time = np.arange(0.0, 60.0, 0.01)
    flies = ((time > 5.0) & (time < 7.0)) | ((time > 20.0) & (time < 50.0))
    signal = Channel(
        time=time, values=np.where(flies, 0.35, 0.0)[:, None] * np.ones(4), source="m"
    )
    rates = Channel(time=time, values=np.zeros((time.size, 3)), source="g")
    flight = FlightData(
        name="a", file="a.csv", channels={"rotor_commands": signal, "gyro": rates}
    )
    fitted, other = measure_real.halves(flight, start)
    assert fitted.end == pytest.approx(35.0, abs=0.2)
    assert other.start == pytest.approx(35.0, abs=0.2)
    assert fitted.duration == pytest.approx(measure_real.HALF, abs=0.03)
    assert other.duration == pytest.approx(measure_real.HALF, abs=0.03)
