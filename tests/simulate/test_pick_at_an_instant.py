"""300 g are picked up at 8 s and set down at 14 s from one file: the page's own, on
both plants.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.scenario.scenario_file import scenario_from

PAGE = (
    Path(__file__).resolve().parents[2] / "docs" / "disturbances_and_payloads.md"
).read_text(encoding="utf-8")
FILES = dict(re.findall(r'```toml title="(\w+)\.toml"\n(.*?)```', PAGE, re.DOTALL))


@pytest.mark.parametrize(
    "plant", ["rigid_body", pytest.param("mujoco", marks=pytest.mark.thorough)]
)
@pytest.mark.parametrize("told", [True, False])
def test_the_tip_is_there_when_it_picks_and_when_it_places(plant, told):
    """Within 5 mm if the law is told of the load, within 20 mm if it has to learn
    it.
    """
    document = tomllib.loads(FILES["pick_and_place"])
    document["payloads"][0]["believed"] = told
    document["plant"]["kind"] = plant
    log = skyarm.run(scenario_from(document))
    assert log.status == "completed"
    error = np.linalg.norm(log.tip - log.tip_reference, axis=1)
    for t in (8.0, 14.0):
        assert error[np.searchsorted(log.time, t)] < (0.005 if told else 0.020)
    held = np.where((log.time >= 8.0) & (log.time < 14.0), 0.3, 0.0)
    assert np.array_equal(log.payload_mass[:, 0], held)


def test_the_tables_of_the_page_disturb_one_flight():
    """Those of its sections, added to its first file."""
    wind, *tables = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert len(tables) == 5
    hanging = tables.pop(3)
    for name, table in {"gusts": wind, "pick_and_place": hanging}.items():
        document = tomllib.loads(FILES[name]) | {"duration": 0.5}
        (key,) = told = tomllib.loads(table)
        document[key] = told[key]
        assert skyarm.run(scenario_from(document)).time.size == 100
    scenario = scenario_from(tomllib.loads("\n".join([FILES["gusts"], *tables])))
    log = skyarm.run(scenario)
    assert log.status == "completed"
    assert np.ptp(log.joints[log.time > 3.005, 1]) < 1e-12
    error = np.linalg.norm(log.tip - log.tip_reference, axis=1)
    assert 0.02 < error.max() < 0.05
    assert 3.5 < np.linalg.norm(log.air_velocity, axis=1).max() < 5.0
    for table in tables:
        document = tomllib.loads(FILES["gusts"] + table)
        assert skyarm.run(scenario_from(document | {"duration": 0.5})).time.size == 100
