"""Draws of a sweep: distributions, grids, Sobol points, and independence of the company
they are drawn in.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from skyarm.algebra.scalars import exp, log
from skyarm.studies.sweep.design import extremes, values
from skyarm.studies.sweep.distributions import distribution_from, normal_quantile
from skyarm.studies.sweep.sobol import BITS, DIMENSIONS, sobol
from support.studies import MASS, WIND, small_study

COUNT = 20_000

KINDS: list[tuple[dict[str, Any], Any]] = [
    ({"uniform": [0.5, 2.0]}, stats.uniform(0.5, 1.5)),
    ({"normal": [1.0, 0.1]}, stats.norm(1.0, 0.1)),
    ({"log_uniform": [0.5, 50.0]}, stats.loguniform(0.5, 50.0)),
]


def drawn(
    design: str, *tables: dict[str, Any], episodes: int = COUNT, seed: int = 3
) -> list[np.ndarray]:
    paths = [MASS, WIND, "environment.wind.force_W.y", "environment.wind.force_W.z"][
        : len(tables)
    ]
    study = small_study(
        design=design,
        vary=dict(zip(paths, tables, strict=True)),
        episodes=episodes,
        seed=seed,
    )
    return list(values(study, np.arange(episodes)).values())


@pytest.mark.parametrize("design", ["random", "sobol"])
@pytest.mark.parametrize(("table", "truth"), KINDS, ids=lambda each: str(each)[:20])
def test_draws_follow_their_distribution(
    design: str, table: dict[str, Any], truth: Any
) -> None:
    (column,) = drawn(design, table)
    # a wrong law of these is off by over 0.02; 20000 random draws of the right one by
    # 0.014 once in 1000 seeds
    assert stats.kstest(column, truth.cdf).statistic < 0.014
    if design == "random":
        assert stats.kstest(column, truth.cdf).pvalue > 1e-3


def test_draws_have_the_bits_of_no_library_and_the_values_of_scipy() -> None:
    """Of u near 0, 1/2 and 1 too; log-uniform draws are the floats' own exponential,
    which every engine evaluates.
    """
    ends = [
        1e-300,
        1e-20,
        1e-9,
        0.0749,
        0.0751,
        0.5,
        0.9249,
        0.9251,
        1.0 - 1e-9,
        1.0 - 2.0**-53,
    ]
    u = np.concatenate([ends, np.random.default_rng(1).uniform(size=2000)])
    np.testing.assert_allclose(
        normal_quantile(u), stats.norm.ppf(u), rtol=2e-15, atol=1e-15
    )
    drawn = distribution_from({"log_uniform": [0.0005, 0.01]}, "x").quantile(u)
    assert drawn.tolist() == [
        0.0005 * exp(log(0.01 / 0.0005) * each) for each in u.tolist()
    ]


@pytest.mark.thorough
def test_a_bit_exact_sweep_has_the_same_rows_where_libm_takes_no_fused_operations(
    tmp_path: Path,
) -> None:
    plain = "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX2_Usable"
    names = []
    for folder, more in (("with", {}), ("without", {"GLIBC_TUNABLES": plain})):
        study = tmp_path / "study.toml"
        study.write_text(STUDY)
        command = [
            sys.executable,
            "-m",
            "skyarm",
            "sweep",
            study,
            "--out",
            tmp_path / folder,
        ]
        subprocess.run(command, check=True, capture_output=True, env=os.environ | more)
        names.append(
            sorted(each.name for each in (tmp_path / folder / "rows").iterdir())
        )
    assert names[0] == names[1]


STUDY = """
schema = 1
name = "bit_exact_draws"
scenario = "case3_wind"
controllers = ["paper_ct"]
episodes = 1200
design = "sobol"
duration = 0.1
precision = "bit_exact"
[vary]
"plant.payload.mass" = { uniform = [0.0, 0.2] }
"environment.wind.force.x" = { normal = [2.0, 0.5] }
"plant.vehicle.links.0.joint.damping" = { log_uniform = [0.0005, 0.01] }
"""


def test_two_parameters_are_independent_and_seeds_differ() -> None:
    a, b = drawn("random", {"uniform": [0.5, 1.0]}, {"uniform": [0.0, 1.0]})
    # the deviation of a correlation of 20000 independent pairs is 0.007; four are
    # allowed
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.028
    assert abs(np.corrcoef(a[1:], a[:-1])[0, 1]) < 0.028
    (other,) = drawn("random", {"uniform": [0.5, 1.0]}, seed=4)
    assert not np.any(a == other)


def test_a_list_is_drawn_with_equal_chances() -> None:
    (column,) = drawn("random", {"list": [0.7, 0.5, 0.9]})
    found, counts = np.unique(column, return_counts=True)
    assert found.tolist() == [0.5, 0.7, 0.9]
    assert stats.chisquare(counts).pvalue > 1e-3


def test_a_grid_design_is_every_combination_once_in_the_order_of_nested_loops() -> None:
    study = small_study(
        design="grid",
        episodes=None,
        vary={
            MASS: {"grid": [0.5, 0.8, 4]},
            "sensors.position": {"uniform": [0.0, 0.1]},
            WIND: {"list": [2.0, 0.0, 1.0]},
        },
    )
    assert study.episodes == 12
    found = values(study, np.arange(12))
    wanted = [
        (mass, wind) for mass in np.linspace(0.5, 0.8, 4) for wind in (2.0, 0.0, 1.0)
    ]
    assert list(zip(found[MASS].tolist(), found[WIND].tolist(), strict=True)) == wanted
    assert np.unique(found["sensors.position"]).size == 12


def test_more_episodes_repeat_the_grid_with_other_draws() -> None:
    vary = {MASS: {"grid": [0.5, 0.8, 4]}, "sensors.position": {"uniform": [0.0, 0.1]}}
    found = values(small_study(design="grid", episodes=8, vary=vary), np.arange(8))
    assert np.array_equal(found[MASS][:4], found[MASS][4:])
    assert np.unique(found["sensors.position"]).size == 8


@pytest.mark.parametrize("design", ["random", "sobol", "grid"])
def test_an_episode_draws_the_same_in_any_company(design: str) -> None:
    vary = {MASS: {"grid": [0.5, 0.8, 4]}, WIND: {"normal": [0.0, 1.0]}}
    study = small_study(design=design, episodes=40, vary=vary)
    together = values(study, np.arange(40))
    for episodes in ([7], [39, 7], range(5, 12)):
        some = values(study, np.array(episodes))
        assert all(
            np.array_equal(some[path], together[path][list(episodes)]) for path in vary
        )


def test_unshifted_points_are_those_of_another_generator_in_every_dimension() -> None:
    wanted = qmc.Sobol(DIMENSIONS, scramble=False, bits=30).random(2**10)
    for dimension in range(DIMENSIONS):
        assert np.array_equal(
            sobol(np.arange(2**10), dimension) * 2.0**-BITS, wanted[:, dimension]
        ), dimension


def test_sobol_points_are_more_even_than_random_ones() -> None:
    tables = [{"uniform": [0.0, 1.0]}] * 4
    even = np.array(
        drawn("sobol", *[{"uniform": [0.5, 1.0]}, *tables[1:]], episodes=1024)
    ).T
    even[:, 0] = 2.0 * even[:, 0] - 1.0
    loose = np.random.default_rng(0).random((1024, 4))
    assert qmc.discrepancy(even) < 0.1 * qmc.discrepancy(loose)


def test_extremes_are_those_of_all_episodes() -> None:
    study = small_study(episodes=70_000, vary={MASS: {"normal": [1.0, 0.1]}})
    found = values(study, np.arange(70_000))[MASS]
    assert extremes(study) == {
        MASS: (found.min(), found.max(), found.argmin(), found.argmax())
    }


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({}, "exactly one of uniform, normal, log_uniform, list, grid"),
        ({"uniform": [0, 1], "normal": [0, 1]}, "exactly one of"),
        ({"gauss": [0, 1]}, "exactly one of"),
        (3, "must be a table"),
        ({"uniform": [1, 1]}, "the first below the second"),
        ({"uniform": [0, float("inf")]}, "uniform[1] = inf: must be a finite number"),
        ({"uniform": [0]}, "a list of 2 numbers"),
        ({"log_uniform": [0, 1]}, "log_uniform[0] = 0.0: must be above 0"),
        ({"normal": [0, 0]}, "normal[1] = 0.0: must be above 0"),
        ({"normal": [0, "a"]}, "normal[1] = 'a'"),
        ({"list": []}, "must be a list of 1 to"),
        ({"list": [1, 1.0]}, "twice"),
        ({"grid": [0, 1]}, "[start, stop, count]"),
        ({"grid": [0, 1, 1]}, "grid[2] = 1: must be a whole number from 2"),
        ({"grid": [0, 1, 2.0]}, "grid[2] = 2.0"),
        ({"grid": [1, 0, 3]}, "the first below the second"),
    ],
)
def test_a_wrong_distribution_is_refused_by_name(table: Any, words: str) -> None:
    with pytest.raises(ValueError, match=r"^here") as caught:
        distribution_from(table, "here")
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("design", "masses", "winds"),
    [
        (
            "random",
            [0.8600502718301463, 0.9677975508983473, 0.7319031803823807],
            [0.67087474, -0.65287045, 0.78374009],
        ),
        (
            "sobol",
            [0.7437012131558731, 1.2437012131558731, 1.4937012131558731],
            [-0.93009508, 0.45699013, -0.18615673],
        ),
    ],
)
def test_a_study_has_the_numbers_that_it_had_in_every_version_before(
    design: str, masses: list[float], winds: list[float]
) -> None:
    """Else rows of a study that is gone on with would not belong together."""
    mass, wind = drawn(
        design, {"uniform": [0.5, 1.5]}, {"normal": [0.0, 1.0]}, episodes=3
    )
    assert mass.tolist() == masses
    assert wind == pytest.approx(winds, abs=1e-8)
