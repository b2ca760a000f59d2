"""``skyarm identify`` of a flight with a fault: one line that names it, exit code 2, and nothing written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import skyarm as library
from commanded import refused, skyarm

pytest.importorskip("scipy", reason="needs the extra 'identify'")

VEHICLE = library.load_vehicle("hummingbird")
HEAD = "t,p,q,r,ax,ay,az,w0,w1,w2,w3"
COLUMNS = """
[time]
column = "t"
[gyro]
columns = ["p", "q", "r"]
[accelerometer]
columns = ["ax", "ay", "az"]
[rotor_speed_commands]
columns = ["w0", "w1", "w2", "w3"]
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Hover with noise; the accelerometer's unit is g."""
    monkeypatch.chdir(tmp_path)
    noise = np.random.default_rng(0)
    time = np.arange(0.0, 2.7, 0.005)
    hover = np.sqrt(9.81 * VEHICLE.mass / 4.0 / VEHICLE.rotors[0].thrust_coefficient)
    rows = np.concatenate(
        [
            noise.normal(scale=0.1, size=(len(time), 3)),
            noise.normal([0.0, 0.0, 1.0], 0.01, (len(time), 3)),
            noise.normal(hover, 5.0, (len(time), 4)),
        ],
        axis=1,
    )
    np.savetxt("hover.csv", np.column_stack([time, rows]), delimiter=",", header=HEAD, comments="")
    Path("columns.toml").write_text(COLUMNS)


def test_a_fault_is_named_in_one_line_and_nothing_is_written():
    refused(
        skyarm("identify", "hover.csv", "--vehicle", "hummingbird", "--out", "found"),
        "hover.csv: accelerometer: is 1 on the median",
        "it looks like g; state its unit in columns.toml",
    )
    assert not Path("found").exists()


def test_a_fault_is_warned_of_if_the_flight_is_wanted_despite_it():
    done = skyarm("identify", "hover.csv", "--vehicle", "hummingbird", "--despite-faults")
    assert "warning: hover.csv: accelerometer: is 1 on the median" in done.err
