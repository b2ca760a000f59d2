"""``skyarm identify`` of a damaged flight: one line that names the fault, exit code 2,
and nothing written.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import skyarm as library
from skyarm.identify import identify_windows
from skyarm.identify.window_fit import fit_windows
from support.commands import refused, skyarm
from support.vehicles import CRAZYFLIE_LOG

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
    monkeypatch.chdir(tmp_path)
    Path("columns.toml").write_text(COLUMNS)


def hover():
    """Rows of 2.7 s of hover with noise."""
    noise = np.random.default_rng(0)
    time = np.arange(0.0, 2.7, 0.005)
    speed = np.sqrt(9.81 * VEHICLE.mass / 4.0 / VEHICLE.rotors[0].thrust_coefficient)
    rates = noise.normal(scale=0.1, size=(len(time), 3))
    forces = noise.normal([0.0, 0.0, 9.81], 0.1, (len(time), 3))
    return np.column_stack(
        [time, rates, forces, noise.normal(speed, 5.0, (len(time), 4))]
    )


def write(rows, end=None):
    np.savetxt("hover.csv", rows, delimiter=",", header=HEAD, comments="")
    if end is not None:
        text = Path("hover.csv").read_text()
        Path("hover.csv").write_text(text[: int(end * len(text))])


def grams(rows):
    rows[:, 4:7] /= 9.80665


def gaps(rows):
    rows[np.arange(len(rows)) % 3 == 0, 5] = np.nan


def endless(rows):
    rows[np.arange(len(rows)) % 3 == 0, 2] = np.inf


def standing(rows):
    rows[1::3, 0] = rows[0::3, 0][: len(rows[1::3])]


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (
            grams,
            (
                "hover.csv: accelerometer: is 1 on the median",
                "it looks like g; state its unit in columns.toml",
            ),
        ),
        (gaps, ("hover.csv: accelerometer: 180 of 540 rows are without numbers",)),
        (endless, ("hover.csv: gyro: 180 of 540 rows are without numbers",)),
        (
            standing,
            (
                (
                    "hover.csv: gyro: 180 of 540 rows are left out, as their times do"
                    " not rise"
                ),
            ),
        ),
    ],
)
def test_a_fault_is_named_in_one_line_and_nothing_is_written(damage, words):
    rows = hover()
    damage(rows)
    write(rows)
    refused(
        skyarm("identify", "hover.csv", "--vehicle", "hummingbird", "--out", "found"),
        *words,
    )
    assert not Path("found").exists()


def test_a_file_that_is_cut_off_is_too_short_or_damaged():
    write(hover(), end=0.3)
    refused(
        skyarm("identify", "hover.csv", "--vehicle", "hummingbird"),
        "hover.csv: flight:",
        "too short, or cut off",
    )
    Path("log").write_bytes(CRAZYFLIE_LOG.read_bytes()[:150])
    refused(skyarm("identify", "log", "--vehicle", "hummingbird"), "log")


def test_a_fault_is_warned_of_if_the_flight_is_wanted_despite_it(monkeypatch):
    # what is found does not matter
    monkeypatch.setattr(identify_windows, "fit_windows", partial(fit_windows, turns=2))
    rows = hover()
    grams(rows)
    write(rows)
    done = skyarm(
        "identify", "hover.csv", "--vehicle", "hummingbird", "--despite-faults"
    )
    assert "warning: hover.csv: accelerometer: is 1 on the median" in done.err
