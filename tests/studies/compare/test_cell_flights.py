"""Cells of the comparison: a batch is its flights one by one; cells are flown once;
summaries count right.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.log.metrics.windows import Windows
from skyarm.scenario.paths import LATE
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate import Delays, Window
from skyarm.studies.compare.cell_flights import (
    SUCCESS_METRIC,
    Cell,
    CellFlights,
    summary,
)
from skyarm.studies.compare.comparison import comparison_report
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.perturbed_plants import Spread
from skyarm.studies.compare.suite import CASES, Case, Condition, conditions
from skyarm.studies.flights.fly import one_scenario
from skyarm.studies.trial.trial import NOISE
from support.studies import cell_of

EARLY = Windows(steady=Window(1.0, 2.0), gust=Window(0.5, 2.0), last=0.5)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ShortCase(Case):
    """Two seconds of a case."""

    def build(self):
        # not super(): a dataclass with slots is a new class
        return dataclasses.replace(Case.build(self), duration=2.0)


SHORT = ShortCase(
    name="case3_wind", title="two seconds", scenario="case3_wind", windows=EARLY
)
WRONG = Condition(
    name="plants_noisy",
    title="wrong",
    noisy=True,
    episodes=4,
    cases=("case3_wind",),
    spread=Spread(),
)
NOISY = Condition(
    name="noisy", title="noise", noisy=True, episodes=3, cases=("case3_wind",)
)


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SKYARM_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def flights(condition=NOISY, **changes):
    return CellFlights(
        entrant=ENTRANTS["paper_ct"], case=SHORT, condition=condition, seed=5, **changes
    )


WHOLE = dataclasses.replace(WRONG, spread=Spread(delay=0.0))
"""Single flights have delays of whole milliseconds: this one has none."""


@pytest.mark.parametrize("condition", [NOISY, WHOLE], ids=lambda each: each.name)
def test_a_batch_is_its_flights_one_by_one(condition):
    work = flights(condition).work()
    cell, single = cell_of(work), cell_of(dataclasses.replace(work, alone=True))
    assert (
        list(single.status) == list(cell.status) == ["completed"] * condition.episodes
    )
    assert list(single.metrics) == list(cell.metrics)
    assert not set(work.columns) & set(cell.metrics)
    for name, numbers in single.metrics.items():
        # a batch takes the integration steps of its stiffest plant, a single flight its
        # own
        assert np.allclose(cell.metrics[name], numbers, rtol=1e-4, atol=1e-9), name


def test_single_flights_round_their_delay_to_physics_steps():
    work = flights(WRONG).work()
    for late, rounded in ((0.0094, 0.009), (0.0091, 0.009), (0.0004, 0.0)):
        delayed = dataclasses.replace(
            work, columns={**work.columns, LATE: np.full(4, late)}
        )
        assert one_scenario(delayed, 1).delays == Delays(command=rounded)


@pytest.mark.parametrize(
    "change",
    [
        {"condition": dataclasses.replace(NOISY, episodes=4)},
        {"case": dataclasses.replace(SHORT, wind=0.1)},
        {"seed": 6},
        {"entrant": dataclasses.replace(ENTRANTS["paper_pd"], name="paper_ct")},
    ],
    ids=lambda change: next(iter(change)),
)
def test_cells_of_one_name_are_other_works_if_anything_differs(change):
    one, other = flights().work(), dataclasses.replace(flights(), **change).work()
    assert one.label == other.label
    assert one.key == flights().work().key != other.key


def test_the_rows_of_a_cell_name_it_and_each_of_its_flights():
    work = flights(WRONG).work()
    assert {name: work.fixed[name] for name in ("condition", "case", "law")} == {
        **{"condition": "plants_noisy", "case": "case3_wind", "law": "paper_ct"}
    }
    assert list(work.fixed["trial"]) == list(work.episodes) == [0, 1, 2, 3]
    assert work.seed == 5


def made(errors, status):
    return Cell({SUCCESS_METRIC: np.array(errors)}, np.array(status))


def test_a_success_flies_to_its_end_near_its_reference():
    found = summary(
        made(
            [0.019, 0.021, 0.001, np.nan],
            ["completed", "completed", "ground", "completed"],
        )
    )
    assert (found["episodes"], found["completed"], found["success"]) == (4, 3, 1)
    assert found["endings"] == {"completed": 3, "ground": 1}
    assert found["metrics"][SUCCESS_METRIC]["mean"] == pytest.approx(0.020)


def test_a_cell_in_which_nobody_flew_to_the_end_has_no_means():
    assert summary(made([0.1], ["diverged"]))["metrics"][SUCCESS_METRIC] is None


def test_tables_have_a_row_for_every_law_that_flew():
    cells = {"noisy": {"case3_wind": {"paper_ct": summary(cell_of(flights()))}}}
    found = {"summaries": cells}
    text = comparison_report(
        found, ENTRANTS, {"noisy": conditions()["noisy"]}
    ).markdown()
    assert "| paper_ct |" in text
    assert "| paper_pd |" not in text
    assert CASES["case3_wind_side"].title in text


def test_conditions_are_what_their_titles_say():
    every = conditions()
    plain, noisy = (
        every[name].apply(CASES["case3_wind"].build()) for name in ("perfect", "noisy")
    )
    assert (plain.noise, plain.delays) == (SensorNoise(), Delays())
    assert (noisy.noise, noisy.delays) == (NOISE, Delays(measurement=0.005))
    spread = every["plants_noisy"].apply(CASES["case3_wind"].build())
    assert (spread.noise, spread.delays) == (NOISE, Delays(longest_command=0.010))
    assert every["plants"].apply(CASES["case3"].build()).noise == SensorNoise()


def test_cases_turn_the_wind_and_carry_the_load():
    side, quarter = (
        CASES["case3_wind_side"].build().wind,
        CASES["case3_wind_45"].build().wind,
    )
    assert tuple(side.force_W) == pytest.approx((0.0, 2.0, 0.0))
    assert tuple(quarter.air_velocity_W) == pytest.approx((2.0**0.5, 2.0**0.5, 0.0))
    loaded, bare = (
        CASES[name].build().plant.vehicle.mass
        for name in ("case3_wind_payload", "case3_wind")
    )
    assert loaded - bare == pytest.approx(0.05)


def test_laws_that_can_use_a_known_delay_are_told_of_it_where_there_is_noise():
    model = CASES["case3"].build().controller.par.model
    assert (
        ENTRANTS["centroidal_tip"].controller(model, noisy=True).par.delay_periods == 1
    )
    assert (
        ENTRANTS["centroidal_tip"].controller(model, noisy=False).par.delay_periods == 0
    )
    assert (
        ENTRANTS["centroidal_tip without prediction"]
        .controller(model, noisy=True)
        .par.delay_periods
        == 0
    )


def test_peaks_to_either_side_are_no_small_peak():
    peaks = np.array([-0.012, 0.011])
    cell = Cell(
        {SUCCESS_METRIC: np.zeros(2), "gust_ee_peak_x_continuous": peaks},
        np.array(["completed"] * 2),
    )
    found = summary(cell)["metrics"]["gust_ee_peak_x_continuous"]
    assert (found["mean"], found["max"]) == pytest.approx((0.0115, 0.012))
