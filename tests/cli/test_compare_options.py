"""Every option of ``skyarm compare`` arrives where its help says, and ``skyarm show``
of rotors without a limit.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from command_files import VEHICLE

from skyarm.studies.compare.comparison import Comparison
from support.commands import refused, skyarm


@pytest.fixture
def asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> list[tuple[Comparison, Path, int]]:
    """What is to be flown; nothing is."""
    monkeypatch.chdir(tmp_path)
    found: list[tuple[Comparison, Path, int]] = []

    def fly(
        comparison: Comparison,
        folder: Path,
        *,
        workers: int,
        on: str | None,
        progress: Any,
    ) -> None:
        found.append((comparison, folder, workers))
        raise ValueError("nothing is flown here")

    monkeypatch.setattr("skyarm.cli.compare_command.fly_suite", fly)
    return found


def test_each_number_is_that_of_its_own_option(
    asked: list[tuple[Comparison, Path, int]],
) -> None:
    numbers = ("--plants", "11", "--seeds", "3", "--seed", "17", "--workers", "2")
    refused(
        skyarm("compare", *numbers, "--plant", "mujoco", "--out", "here"),
        "nothing is flown here",
    )
    ((comparison, folder, threads),) = asked
    assert (
        comparison.conditions["plants"].episodes,
        comparison.conditions["noisy"].episodes,
    ) == (11, 3)
    assert (comparison.seed, comparison.plant, folder.name, threads) == (
        17,
        "mujoco",
        "here",
        2,
    )


def test_names_may_have_spaces_about_them_and_keep_the_order_of_the_comparison(
    asked: list[tuple[Comparison, Path, int]],
) -> None:
    refused(
        skyarm(
            "compare",
            "--laws",
            " centroidal_tip ,paper_ct, ",
            "--only",
            "noisy , perfect",
        ),
        "nothing is flown here",
    )
    ((comparison, _, _),) = asked
    assert list(comparison.entrants) == ["paper_ct", "centroidal_tip"]
    assert list(comparison.conditions) == ["perfect", "noisy"]


def test_rotors_without_a_highest_speed_have_no_thrust_margin_and_hover(
    tmp_path: Path,
) -> None:
    bounded, free = tmp_path / "bounded.toml", tmp_path / "free.toml"
    bounded.write_text(VEHICLE)
    free.write_text(
        "\n".join(
            line
            for line in VEHICLE.splitlines()
            if not line.strip().startswith("max_speed")
        )
    )
    with_limit, without = skyarm("show", str(bounded)), skyarm("show", str(free))
    assert (with_limit.code, without.code) == (0, 0), without.err
    assert "thrust margin" in with_limit.out
    assert "hover rotor speed" in without.out
    assert not [
        word
        for word in ("thrust margin", "not possible", "inf")
        if word in without.out.split("hover rotor speed")[1]
    ]
