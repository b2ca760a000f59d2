"""``skyarm identify``: logs of skyarm and of others, what is refused, and what a flight
does not tell.
"""

from __future__ import annotations

import dataclasses
import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm as library
from skyarm.identify.identify_command import OPTIONS, SUBCOMMANDS
from support.commands import refused, skyarm

pytest.importorskip("scipy", reason="needs the extra 'identify'")


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """A flight with late commands on a vehicle without an arm, the same as another
    program would log it, and none.
    """
    folder: Path = tmp_path_factory.mktemp("flights")
    document = {
        "schema": 1,
        "name": "late",
        "duration": 1.1,
        "plant": {"vehicle": "hummingbird"},
        "controller": {"preset": "rotors_sim_hummingbird"},
        "delays": {"command": 0.01},
        "sensors": {"rate": 0.02, "attitude": 0.005},
        "reference": {
            "base": {
                "kind": "circle",
                "radius": 0.5,
                "frequency_hz": 0.5,
                "center": [0.0, 0.0, 1.0],
            }
        },
    }
    log = library.run(library.scenario_from(document))
    library.save_log(log, folder / "late.npz")
    other = {
        name: value for name, value in log.info.items() if name != "scenario_record"
    }
    library.save_log(dataclasses.replace(log, info=other), folder / "other.npz")
    still = dataclasses.replace(
        log, rotor_commands=np.full_like(log.rotor_commands, 450.0)
    )
    library.save_log(still, folder / "still.npz")
    return folder


@pytest.fixture(autouse=True)
def here(flights, monkeypatch):
    monkeypatch.chdir(flights)


def test_a_flight_says_its_delay_and_the_lines_to_paste():
    done = skyarm("identify", "late.npz", "-o", "found.toml")
    assert (done.code, done.err) == (0, "")
    assert "The scenario states: command 10 ms, measurement 0 ms" in done.out
    found = tomllib.loads(Path("found.toml").read_text())
    assert found["delays"]["command"] == pytest.approx(0.01, abs=0.0015)
    assert done.out.endswith(
        f"\n{Path('found.toml').read_text()}\nwritten: found.toml\n"
    )


def test_a_log_of_another_program_needs_a_vehicle_and_is_told_what_its_delay_is():
    refused(
        skyarm("identify", "other.npz"),
        "--vehicle: is missing; the log does not say which vehicle flew",
    )
    done = skyarm("identify", "other.npz", "--lags", "--vehicle", "hummingbird")
    assert "shows the sum of both only" in done.out
    assert "The log holds the true state" not in done.out


def test_a_flight_of_a_file_is_named_by_its_number():
    refused(
        skyarm("identify", "flights", "late.npz#2", "--vehicle", "hummingbird"),
        "flight = 'late.npz#2': flight #2: must be 1 to 1, the flights of this file",
    )


@pytest.mark.parametrize(
    "words",
    [("other.npz",), ("late.npz", "--begin", "0.5", "--end", "0.6"), ("still.npz",)],
)
def test_a_flight_that_gives_no_lines_leaves_no_folder(words):
    assert skyarm("identify", *words, "-o", "new/inner/found.toml").code in (2, 3)
    assert not Path("new").exists()


def test_a_flight_that_does_not_tell_ends_with_3():
    done = skyarm("identify", "still.npz", "-o", "empty.toml")
    assert (done.code, "rotors: not known: the commands hardly change" in done.out) == (
        3,
        True,
    )
    assert "the flight does not tell" in done.err
    assert not Path("empty.toml").exists()
    found = json.loads(skyarm("identify", "still.npz", "--json").out)
    assert (
        bool(found["rotors"]["reason"]),
        found["rotors"]["delay"]["value"],
        found["tables"],
    ) == (True, None, "")


START = ("--vehicle", "hummingbird")


@pytest.mark.parametrize(
    ("before", "now"),
    [
        (("late.npz",), ("lags", "late.npz")),
        (
            ("--lags", "other.npz", *START, "--json"),
            ("lags", "other.npz", *START, "--json"),
        ),
        (("still.npz", "-q"), ("lags", "still.npz", "-q")),
        (("late.npz", "--begin", "9"), ("lags", "late.npz", "--begin", "9")),
        (("none.csv", *START), ("flights", "none.csv", *START)),
        (
            ("other.npz", *START, "--held-out", "no"),
            ("flights", "other.npz", *START, "--held-out", "no"),
        ),
        (
            ("other.npz", *START, "--known", "mass"),
            ("flights", "other.npz", *START, "--known", "mass"),
        ),
        (
            ("--design", "hummingbird", "--box", "0"),
            ("design", "hummingbird", "--box", "0"),
        ),
        (
            ("--design", "hummingbird", "-o", "a.npz"),
            ("design", "hummingbird", "-o", "a.npz"),
        ),
    ],
)
def test_a_word_of_its_own_does_what_the_options_did(before, now):
    assert skyarm("identify", *now) == skyarm("identify", *before)


def test_of_a_log_of_skyarm_the_word_decides_what_is_identified():
    refused(
        skyarm("identify", "flights", "late.npz"),
        "--vehicle: is missing: must be the vehicle as its data sheet",
    )


@pytest.mark.parametrize("word", SUBCOMMANDS)
def test_the_help_of_a_word_has_its_options_and_the_command_takes_them_without_it(word):
    text = skyarm("identify", word, "--help", columns=100).out
    assert text.startswith(f"Usage: skyarm identify {word} [OPTIONS] ")
    assert len(text.splitlines()) <= 26
    shown = set(re.findall(r"^  (?:-o, )?--([\w-]+)", text, re.MULTILINE)) - {
        "json",
        "plugin",
        "debug",
    }
    assert shown == {each.replace("_", "-") for each in OPTIONS[word]} - {"gravity"}
    for option in shown - {"curve", "despite-faults", "drag-height", "force"}:
        refused(
            skyarm("identify", f"--{option}"),
            f"Option '--{option}' requires an argument; see 'skyarm identify -",
        )
        refused(
            skyarm("identify", word, f"--{option}"),
            f"requires an argument; see 'skyarm identify {word} --help'",
        )


def test_the_help_of_the_command_lists_the_words_and_hides_former_options():
    lines = skyarm("identify", "--help", columns=100).out.splitlines()
    begin = lines.index("Commands:")
    assert [line.split()[0] for line in lines[begin + 1 : begin + 4]] == [*SUBCOMMANDS]
    assert begin < lines.index("Options:")
    # the two former spellings, and none of the options that one word has and another
    # lacks
    assert [
        line.split("  ")[1]
        for line in lines
        if line.startswith(("  --lags", "  --design"))
    ] == [
        "--lags",
        "--design VEHICLE",
    ]
    assert not any(
        line.startswith(("  --vehicle", "  --curve", "  --box")) for line in lines
    )
    assert skyarm("--help", "identify") == skyarm("--help")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("none.npz",), "flight = 'none.npz': no such file"),
        (("late.txt",), "flight = 'late.txt': no such file"),
        (
            ("late.npz", "--begin", "1", "--end", "0.5"),
            "--end = 0.5: must be after --begin = 1",
        ),
        (
            ("late.npz", "--begin", "9"),
            "--begin = 9: nothing of the flight is left, whose times are 0 to",
        ),
        (("late.npz", "--end", "0.5"), "time: 0.5 s are too short"),
        (
            ("late.npz", "--lags", "--vehicle", "pelican_arm2"),
            "joints: the log has 0, vehicle 'pelican_arm2' 2",
        ),
        (
            ("late.npz", "--lags", "--vehicle", "tilted_hexarotor"),
            "rotor_commands: the log has 4",
        ),
        (("late.npz", "--gravity", "nan"), "--gravity = nan"),
        (
            ("late.npz", "--curve"),
            "--curve: must be left out without --vehicle, and with --lags",
        ),
        (("late.npz", "other.npz", "--lags"), "flights = 2: must be one with --lags"),
        (
            ("late.npz", "other.npz"),
            "--vehicle: is missing: must be the vehicle as its data sheet",
        ),
    ],
)
def test_what_cannot_be_is_one_line(words, message):
    refused(skyarm("identify", *words), message)
