"""``skyarm compare envelope-suite``: its options arrive, what it does not know is
refused in one line.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from skyarm.studies.compare.envelope import LAWS, TUNED_LAWS, Envelope
from skyarm.studies.compare.envelope_axes import AXES
from skyarm.studies.flights.store import files_by_label
from support.commands import refused, skyarm
from support.components import registry_kept


@pytest.fixture
def asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> list[tuple[Envelope, Path, int]]:
    """What is to be flown; nothing is."""
    monkeypatch.chdir(tmp_path)
    found: list[tuple[Envelope, Path, int]] = []

    def fly(
        envelope: Envelope, folder: Path, *, workers: int, on: str | None, progress: Any
    ) -> None:
        found.append((envelope, folder, workers))
        raise ValueError("nothing is flown here")

    monkeypatch.setattr("skyarm.cli.compare_command.fly_suite", fly)
    monkeypatch.setattr(Envelope, "plan_cells", lambda _envelope: ([], {}))
    return found


def test_left_out_options_are_the_whole_envelope_of_the_paper_s_vehicle(
    asked: list[tuple[Envelope, Path, int]],
) -> None:
    refused(
        skyarm("compare", "envelope-suite", "--workers", "2"), "nothing is flown here"
    )
    ((envelope, folder, threads),) = asked
    assert envelope == Envelope()
    assert (envelope.laws, envelope.axes) == (LAWS, tuple(AXES))
    assert (folder, threads) == (Path("out/envelope"), 2)


def test_every_option_arrives(asked: list[tuple[Envelope, Path, int]]) -> None:
    options = (
        "--only",
        "swing, circle",
        "--vehicle",
        "hexarotor_arm6",
        "--quick",
        "--seed",
        "7",
        "--out",
        "here",
    )
    refused(skyarm("compare", "envelope-suite", *options), "nothing is flown here")
    refused(
        skyarm("compare", "envelope-suite", "--laws", "centroidal_tip,indi"),
        "nothing is flown here",
    )
    (first, folder, _), (second, _, _) = asked
    assert (first.axes, first.vehicle, first.quick, first.seed) == (
        ("circle", "swing"),
        "hexarotor_arm6",
        True,
        7,
    )
    assert (first.laws, folder) == (TUNED_LAWS, Path("here"))
    assert second.laws == ("centroidal_tip", "indi")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ("envelope-suite", "--only", "sircle"),
            "--only = 'sircle': did you mean 'circle'?",
        ),
        (("envelope-suite", "--only", ","), "--only: must name at least one"),
        (("envelope-suite", "--laws", "exakt"), "--laws = 'exakt': "),
        (("envelope-suite", "--laws", "centroidal_tip,centroidal_tip"), "are one"),
        (
            ("envelope-suite", "--only", "noisy"),
            "--only = 'noisy': did you mean 'noise'? must be",
        ),
        (
            ("envelope-suite", "--vehicle", "hummingbird"),
            "--vehicle = 'hummingbird': must have an arm",
        ),
        (("envelope-suite", "--vehicle", "nothing.toml"), "nothing.toml"),
        (
            ("envelope-suite", "--laws", "paper_ct", "--vehicle", "crazyflie_arm1"),
            "2 values, must be 1",
        ),
        (
            ("contact-suite", "--only", "press_and_holt"),
            "--only = 'press_and_holt': did you mean 'press_and_hold'?",
        ),
        (("contact-suite", "--only", ","), "--only: must name at least one"),
        (
            ("survive-suite", "--only", "bumps"),
            "--only = 'bumps': did you mean 'bump'?",
        ),
        (
            ("survive-suite", "--vehicle", "hummingbird"),
            "--vehicle = 'hummingbird': must have an arm",
        ),
        (
            ("survive-suite", "--seeds", "4"),
            "--seeds: must be left out for survive-suite",
        ),
        (
            ("contact-suite", "--only", "slide_up,slide_up"),
            "--only = 'slide_up': must be named once",
        ),
        (("contact-suite", "--laws", "centroidal,centroidal"), "are one"),
        (
            ("contact-suite", "--laws", "centroidal_movement"),
            "--laws = 'centroidal_movement': ",
        ),
        (
            ("team-suite", "--scenario", "case3"),
            "case3: team: must be stated for team-suite, whose laws share a load",
        ),
        (
            ("paper-suite", "--scenario", "case3"),
            "--scenario: must be left out for paper-suite; it is of team-suite",
        ),
        (("team-suite", "--only", "nosy"), "--only = 'nosy': did you mean 'noisy'?"),
        (
            ("team-suite", "--laws", "own_path"),
            "team-suite: 'own_path': did you mean 'own_paths'?",
        ),
        (
            ("team-suite", "--laws", "paper_ct"),
            "team-suite: 'paper_ct': must be one of own_paths, leader_follower",
        ),
        (
            ("team-suite", "--quick"),
            "--quick: must be left out for team-suite; it is of envelope-suite and",
        ),
        (("contact-suite", "--plants", "0"), "--plants = 0: must be from 1 to "),
        (
            ("contact-suite", "--plants", "3", "--quick"),
            "--plants: must be left out beside --quick, which flies 16",
        ),
        (
            ("case3", "--only", "circle"),
            "--only: must be left out for scenario case3; it is of paper-suite and env",
        ),
        (
            ("case3", "--quick"),
            (
                "--quick: must be left out for scenario case3; it is of envelope-suite"
                " and survive-suite and contact-suite"
            ),
        ),
        (
            ("paper-suite", "--vehicle", "hexarotor_arm6"),
            "--vehicle: must be left out for paper-suite; it is of envelope-suite",
        ),
        (
            ("case3", "--plants", "1000"),  # given with its usual value
            (
                "--plants: must be left out for scenario case3; it is of paper-suite"
                " and contact-suite"
            ),
        ),
        (
            ("envelope-suite", "--seeds", "4"),
            (
                "--seeds: must be left out for envelope-suite; it is of paper-suite and"
                " team-suite and a scenario"
            ),
        ),
        (
            ("envelope",),
            (
                "must be one of paper-suite, envelope-suite, survive-suite,"
                " contact-suite, team-suite, a suite"
            ),
        ),
    ],
)
def test_what_it_does_not_know_is_refused_in_one_line(
    options: tuple[str, ...],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    refused(skyarm("compare", *options), words)
    assert not list(tmp_path.iterdir()), "nothing is left behind"


def test_the_survive_suite_flies_what_is_named_on_the_vehicle_that_is_named(
    tmp_path: Path,
) -> None:
    options = (
        "--laws",
        "indi_tuned",
        "--only",
        "turn_round",
        "--quick",
        "--json",
        "--out",
        str(tmp_path / "x"),
    )
    done = skyarm("compare", "survive-suite", "--vehicle", "pelican_arm2", *options)
    assert done.code == 0, done.err
    found = json.loads(done.out)
    assert (found["vehicle"], found["quick"]) == ("pelican_arm2", True)
    assert list(found["rows"]) == ["turn round 180 deg"]
    assert found["rows"]["turn round 180 deg"]["laws"]["indi_tuned"]["of"] == 1


def test_a_law_of_a_file_flies(tmp_path: Path) -> None:
    law = f"{Path(__file__).resolve().parents[2] / 'examples' / 'own_law.py'}:make_lqr"
    options = (
        "--laws",
        law,
        "--only",
        "swing_amplitude",
        "--quick",
        "--out",
        str(tmp_path / "x"),
    )
    with registry_kept():
        first = skyarm("compare", "envelope-suite", *options)
    assert first.code == 0, first.err
    assert "own_law.py:make_lqr" in first.out
    (label,) = files_by_label(tmp_path / "x" / "rows")
    assert "own_law.py-make_lqr" in label


def test_its_result_is_plain_data_on_standard_output(tmp_path: Path) -> None:
    options = (
        "--laws",
        "paper_pd",
        "--only",
        "swing_amplitude",
        "--quick",
        "--json",
        "--out",
        str(tmp_path / "x"),
    )
    done = skyarm("compare", "envelope-suite", *options)
    assert done.code == 0, done.err
    found = json.loads(done.out)
    assert found["axes"]["swing_amplitude"]["values"] == [0.25, 1.25]
    assert found["axes"]["swing_amplitude"]["laws"]["paper_pd"]
    assert "1 of 1 perfect swing_amplitude paper_pd" not in done.out
