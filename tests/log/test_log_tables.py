"""Logs as tables of pandas and of Arrow: the columns of the CSV file, to the bit, with
their units.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.log.log_columns import columns
from skyarm.log.log_tables import log_frame, log_table
from support.logs import drawn


@pytest.fixture(scope="module")
def log() -> skyarm.Log:
    return drawn(skyarm.load_vehicle("hummingbird_arm2_rotors"), count=5)


def heads(log: skyarm.Log, folder: Any) -> list[str]:
    """Heads of the columns of the log's CSV file."""
    return (
        log.save_csv(folder / "log.csv").read_text("utf-8").splitlines()[0].split(",")
    )


def test_an_arrow_table_is_the_csv_file_with_units(
    log: skyarm.Log, tmp_path: Any
) -> None:
    pytest.importorskip("pyarrow")
    table = log.to_arrow()
    told = {each.name: each.metadata[b"unit"].decode() for each in table.schema}
    assert [
        f"{name} [{unit}]" if unit else name for name, unit in told.items()
    ] == heads(log, tmp_path)
    for each in columns(log):
        assert np.array_equal(table[each.name].to_numpy(), each.of(log)), each.name
        assert (
            table.schema.field(each.name).metadata[b"meaning"].decode() == each.meaning
        )
    assert (told["velocity_x"], told["rotor_speed_front"], told["joint_1"]) == (
        "m/s",
        "rad/s",
        "rad",
    )


def test_a_data_frame_is_the_csv_file_over_time_with_units(
    log: skyarm.Log, tmp_path: Any
) -> None:
    pytest.importorskip("pandas", reason="needs the extra 'pandas'")
    frame = log.to_pandas()
    assert frame.index.name == "time"
    assert np.array_equal(frame.index, log.time)
    units = frame.attrs["units"]
    assert [
        f"{name} [{unit}]" if unit else name for name, unit in units.items()
    ] == heads(log, tmp_path)
    for each in columns(log):
        if each.name != "time":
            assert np.array_equal(frame[each.name], each.of(log)), each.name
            assert frame.attrs["meanings"][each.name] == each.meaning
    assert list(frame.columns) == [name for name in units if name != "time"]


@pytest.mark.parametrize(
    ("function", "package", "words"),
    [
        (
            log_frame,
            "pandas",
            (
                r"pandas: is missing; a log as a DataFrame needs the extra 'pandas':"
                r" .*\[pandas\]\" from an index$"
            ),
        ),
        (
            log_table,
            "pyarrow",
            (
                r"pyarrow: is missing; a log as a table needs the extra 'sweep':"
                r" .*\[sweep\]\" from an index$"
            ),
        ),
    ],
)
def test_what_is_missing_is_named_with_the_command_that_installs_it(
    function: Any,
    package: str,
    words: str,
    log: skyarm.Log,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ValueError, match=f"^{words}"):
        function(log)
