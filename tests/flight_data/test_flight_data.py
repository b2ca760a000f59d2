"""Records of measured flights, and the formats of their files."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from skyarm.flight_data.flight_data import (
    Channel,
    FlightData,
    FlightFormat,
    load_flight,
)
from skyarm.records.registry import RegistryError, load_plugin
from skyarm.records.registry.registrations import registering_for
from support.components import registry_kept

TIME = np.array([0.0, 0.1, 0.2, 0.4])


def channel(width: int = 3, start: float = 0.0) -> Channel:
    return Channel(time=TIME + start, values=np.ones((4, width)), source="a, b, c")


@pytest.mark.parametrize(
    ("time", "values", "words"),
    [
        (TIME, np.ones((3, 3)), r"values = \(3, 3\) at times \(4,\): must be"),
        (TIME, np.ones(4), r"values = \(4,\) at times \(4,\): must be"),
        (
            np.array([0.0, 0.1, 0.1, 0.2]),
            np.ones((4, 3)),
            "time of a: must be finite and rise",
        ),
        (
            np.array([0.0, 0.1, np.nan, 0.2]),
            np.ones((4, 3)),
            "time of a: must be finite and rise",
        ),
        (TIME, np.full((4, 3), np.inf), "values of a: must be finite numbers"),
    ],
)
def test_a_channel_holds_finite_numbers_at_rising_times(
    time: np.ndarray, values: np.ndarray, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        Channel(time=time, values=values, source="a")


def test_a_flight_names_what_it_lacks_and_refuses_what_it_does_not_know() -> None:
    flight = FlightData(
        name="one", file="", channels={"gyro": channel(), "voltage": channel(1, 0.5)}
    )
    assert "gyro" in flight
    assert list(flight) == ["gyro", "voltage"]
    assert (flight.start, flight.end, flight.duration) == (0.0, 0.9, 0.9)
    assert flight["gyro"].rate == pytest.approx(10.0)
    with pytest.raises(
        ValueError, match="one: position: is not in this flight; there is gyro, voltage"
    ):
        flight["position"]
    with pytest.raises(ValueError, match=r"channel = 'gyros': .*'gyro'"):
        FlightData(name="one", file="", channels={"gyros": channel()})
    with pytest.raises(
        ValueError, match="channel quaternion: has 3 columns: must be 4"
    ):
        FlightData(name="one", file="", channels={"quaternion": channel()})
    part = flight.section(0.1, 0.6)
    np.testing.assert_allclose(part["gyro"].time, [0.1, 0.2, 0.4])
    np.testing.assert_allclose(part["voltage"].time, [0.5, 0.6])


class _OverError(Exception):
    """End of a test, after which its registrations are dropped."""


PLUGIN = """
import numpy as np, skyarm
from skyarm.flight_data.flight_data import Channel, FlightData, FlightFormat

def read(path, columns):
    rows = np.loadtxt(path, skiprows=1)
    gyro = Channel(time=rows[:, 0], values=rows[:, 1:], source="rows")
    return FlightData(name=path.stem, file=str(path), channels={"gyro": gyro})

lab = FlightFormat(read, ("csv",), (b"LAB1",))
skyarm.register.flight_format("lab", title="our laboratory's text")(lab)
"""


def test_a_format_of_one_s_own_is_found_by_first_bytes_suffix_and_name(
    tmp_path: Path,
) -> None:
    (tmp_path / "lab_format.py").write_text(PLUGIN)
    (tmp_path / "flight.csv").write_text("LAB1\n0 1 2 3\n1 4 5 6\n")
    (tmp_path / "other.dat").write_text("LAB1\n0 1 2 3\n1 4 5 6\n")
    (tmp_path / "named.dat").write_text("head\n0 1 2 3\n1 4 5 6\n")
    with suppress(_OverError), registry_kept(), registering_for("a test"):
        load_plugin(str(tmp_path / "lab_format.py"))
        for name, kind in (("flight.csv", ""), ("other.dat", ""), ("named.dat", "lab")):
            np.testing.assert_array_equal(
                load_flight(tmp_path / name, kind=kind)["gyro"].values,
                [[1, 2, 3], [4, 5, 6]],
            )
        with pytest.raises(
            ValueError, match=r"format 'dat' is unknown: must be one of .*lab \(csv\)"
        ):
            load_flight(tmp_path / "named.dat")
        raise _OverError


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("(FlightFormat(lambda path: path))", "cannot be called as read"),
        (
            "(print)",
            (
                r"is print: must be FlightFormat\(read, suffixes, begins\)|must be"
                r" FlightFormat"
            ),
        ),
        ("(FlightFormat)", "is FlightFormat: must be FlightFormat"),
    ],
)
def test_what_is_no_format_is_refused_where_it_is_registered(
    tmp_path: Path, line: str, words: str
) -> None:
    head = "import skyarm\nfrom skyarm.flight_data.flight_data import FlightFormat\n"
    (tmp_path / "wrong_format.py").write_text(
        f'{head}skyarm.register.flight_format("lab"){line}\n'
    )
    with pytest.raises(RegistryError, match=words) as error:
        load_plugin(str(tmp_path / "wrong_format.py"))
    assert "\n" not in str(error.value)


def test_a_format_is_frozen_and_names_are_checked(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t\n1\n")
    with pytest.raises(ValueError, match=r"kind = 'cvs': .*'csv'"):
        load_flight(tmp_path / "a.csv", kind="cvs")
    with pytest.raises(ValueError, match=r"flight = .*nothing.ulg.*: no such file"):
        load_flight(tmp_path / "nothing.ulg")
    assert (
        FlightFormat(
            lambda path, columns: FlightData(name="", file="", channels={})
        ).suffixes
        == ()
    )


def test_an_empty_file_is_called_empty_and_a_folder_must_be_a_bag(
    tmp_path: Path,
) -> None:
    (tmp_path / "log07").touch()
    with pytest.raises(ValueError, match=r"^flight = '.*log07': is empty$"):
        load_flight(tmp_path / "log07")
    (tmp_path / "bad").mkdir()
    with pytest.raises(
        ValueError,
        match=(
            r"^flight = '.*bad': folder: must be a bag of ROS 2, with metadata\.yaml$"
        ),
    ):
        load_flight(tmp_path / "bad")
