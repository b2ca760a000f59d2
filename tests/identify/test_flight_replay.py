"""Replay of a measured flight for ``skyarm studio --vehicle``: its faults, and what was
identified of it.
"""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.identify.flight_replay import replay_of
from skyarm.vehicle.vehicle_text import vehicle_text

FLIGHTS = Path(__file__).resolve().parents[1] / "data" / "flights"


def test_the_faults_of_a_replayed_flight_are_said_in_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    trefoil = str(next((FLIGHTS / "nanobench").glob("*.csv")))
    shown = replay_of(trefoil, "hummingbird", 1.0, None, None)
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"skyarm: warning: {shown.warning}"
    row = r"[a-z]+ \([\d.]+ times its noise\)"
    assert re.search(
        rf"^B9_trefoil\S+: 1 fault: model: does not explain {row}(, {row})*( and"
        r" leaves |$)",
        shown.warning,
    ), shown.warning
    assert re.search(r"[ ,]velocity \(\d+ times its noise\)", shown.warning)


def test_surroundings_of_another_vehicle_are_not_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trefoil = str(next((FLIGHTS / "nanobench").glob("*.csv")))
    file, beside = tmp_path / "vehicle.toml", tmp_path / "identified.json"
    file.write_text(
        vehicle_text(
            dataclasses.replace(
                skyarm.load_vehicle("hummingbird"), name="kite_identified"
            )
        )
    )
    for start, used in (("kite", True), ("hummingbird", False)):
        beside.write_text(
            json.dumps({"start": start, "surroundings": {"delay": 0.05}, "known": {}})
        )
        replay_of(trefoil, str(file), 1.0, None, None)
        said = capsys.readouterr()
        assert ("delays and offsets: " in said.out) is used
        assert (
            "is not used: it is of 'hummingbird_identified', and the vehicle is"
            " 'kite_identified'" in said.err
        ) != used


def test_a_replayed_flight_has_the_thrust_that_was_identified_of_it(
    tmp_path: Path,
) -> None:
    trefoil = next((FLIGHTS / "nanobench").glob("*.csv"))
    file, beside = tmp_path / "vehicle.toml", tmp_path / "identified.json"
    file.write_text(
        vehicle_text(
            dataclasses.replace(
                skyarm.load_vehicle("hummingbird"), name="kite_identified"
            )
        )
    )
    climb = []
    for name in (trefoil.stem, "another"):
        numbers = [{"name": f"thrust.{name}", "value": 1.2}]
        beside.write_text(
            json.dumps(
                {"start": "kite", "surroundings": {}, "known": {}, "numbers": numbers}
            )
        )
        model = replay_of(str(trefoil), str(file), 0.5, None, None).model
        climb.append(np.nanmean(model.position[:, 2]))
    assert climb[0] > climb[1] + 1e-3
