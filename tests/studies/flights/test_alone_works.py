"""Works whose flights fly one by one: what their rows hold, and what their keys depend
on.
"""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pytest

import skyarm
from skyarm.log.flight_log import Log
from skyarm.log.formats import log_from_npz
from skyarm.scenario.numbers import with_numbers
from skyarm.studies.flights import Work
from skyarm.studies.flights import work as module
from skyarm.studies.flights.fly import fly
from skyarm.studies.flights.store import pack_rows, unpack_rows
from support.components import same_logs

NOISY = with_numbers(
    skyarm.load_scenario("case3_wind", duration=0.1), {"sensors.position": 0.005}
)
SHORT = dataclasses.replace(NOISY, seed=5, episode=3)
MASS = "plant.vehicle.base.mass"


def measured(log: Log, factor: float = 1.0) -> dict[str, float | None]:
    """A metric that all flights have, and one that only those at the back have."""
    back = (
        {"behind": factor}
        if log.position[-1, 2] < log.position[0, 2]
        else {"above": None}
    )
    return {"height": factor * float(log.position[-1, 2]), **back}


def work(**fields: object) -> Work:
    plain = Work(
        label="x",
        scenario=SHORT,
        seed=5,
        episodes=np.array([3]),
        alone=True,
        measure=measured,
        keeps_log=True,
    )
    return dataclasses.replace(plain, **fields)  # type: ignore[arg-type]


def test_the_log_of_a_row_is_the_flight_of_the_scenario_itself() -> None:
    rows = unpack_rows(pack_rows(fly(work()), {}))
    log = log_from_npz(rows["log"][0], "row")
    assert same_logs(log, skyarm.run(SHORT))
    assert (log.info["seed"], log.info["episode"]) == (5, 3)
    other = log_from_npz(fly(work(episodes=np.array([4])))["log"][0], "row")
    assert not same_logs(log, other)


def test_a_metric_that_a_flight_lacks_is_not_a_number_there() -> None:
    heavy = work(
        columns={MASS: np.array([0.4, 2.0, 0.4])},
        episodes=np.zeros(3, int),
        keeps_log=False,
    )
    rows = fly(heavy)
    assert np.array_equal(rows["behind"], [np.nan, 1.0, np.nan], equal_nan=True)
    assert np.isnan(rows["above"]).all()
    assert np.isfinite(rows["height"]).all()
    assert "log" not in rows


def test_the_key_depends_on_what_measures_and_what_is_kept() -> None:
    other = [
        work(measure=partial(measured, factor=2.0)),
        work(measure=partial(measured, factor=3.0)),
        work(keeps_log=False),
        work(seed=6),
        work(episodes=np.array([4])),
        work(scenario=dataclasses.replace(SHORT, duration=0.2)),
    ]
    assert len({each.key for each in [work(), *other]}) == 1 + len(other)
    assert work().key == work(label="y").key


def test_the_key_depends_on_the_version_of_mujoco_only_where_it_may_fly(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    batch = partial(work, alone=False, measure=None, keeps_log=False)
    before = work().key, batch().key
    usual = module.versions
    newer = {"mujoco-core": "99.0"}
    monkeypatch.setattr(
        module,
        "versions",
        lambda *names: {n: newer.get(n, v) for n, v in usual(*names).items()},
    )
    assert (work().key == before[0], batch().key == before[1]) == (False, True)
