"""Who enters the comparison with which gains, what a case does to its wind, and how a
difference is counted.
"""

from __future__ import annotations

import tomllib
from importlib import resources

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Vec3
from skyarm.control.catalogue import ACCELERATION, HUMMINGBIRD, make_controller
from skyarm.records.leaves import leaves
from skyarm.studies.compare.cell_flights import SUCCESS_METRIC, Cell, successes
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.suite import CASES, turn_wind
from skyarm.world import ForceWind, Gust

MODEL = CASES["case3"].build().controller.par.model
TUNED = resources.files("skyarm.control").joinpath("tuned.toml")
FACTORS = tomllib.loads(TUNED.read_text(encoding="utf-8"))["law"]
CENTROIDAL = [name for name, each in ENTRANTS.items() if each.law == "centroidal"]


def numbers(par, path):
    """Every number below a path of a law's constants."""
    for step in path.split("."):
        par = par[int(step)] if step.isdigit() else getattr(par, step)
    return np.array([float(leaf) for leaf in leaves(par)])


@pytest.mark.parametrize(
    "name", [n for n, e in ENTRANTS.items() if e.law in FACTORS and e.group != "step"]
)
def test_published_laws_fly_the_tuned_gains_of_the_file_and_nmpc_its_own_as_well(name):
    """docs/data/results_laws.md: published laws fly gains of one file; nmpc without
    "(tuned)" was set by hand.
    """
    entrant = ENTRANTS[name]
    own = make_controller(entrant.law, MODEL, **entrant.options).par
    flown = entrant.controller(MODEL, noisy=False).par
    for path, factor in FACTORS[entrant.law].items():
        wanted = factor if name != "nmpc" else 1.0
        # one product of two numbers
        np.testing.assert_allclose(
            numbers(flown, path), wanted * numbers(own, path), rtol=1e-15, err_msg=path
        )
        assert factor != 1.0 or np.all(numbers(own, path) == 0.0), (
            f"{path} could not show a difference"
        )


def test_every_rival_has_tuned_gains_and_a_tuned_name_says_so():
    for name, each in ENTRANTS.items():
        assert each.tuned == (each.group == "published" and name != "nmpc"), name
        assert each.tuned or "(tuned)" not in name


@pytest.mark.parametrize("noisy", [False, True])
@pytest.mark.parametrize(
    "name", [n for n, e in ENTRANTS.items() if e.group in ("step", "paper")]
)
def test_the_ladder_flies_the_papers_gains(name, noisy):
    """Table A1; PD's joints alone have the gains of Table A2, on torques."""
    par = ENTRANTS[name].controller(MODEL, noisy=noisy).par
    assert [float(g) for g in leaves(par.gains)] == [
        float(g) for g in leaves(HUMMINGBIRD)
    ]
    if name != "paper_pd":
        assert [float(g) for g in leaves(par.joint_gains)] == [
            float(g) for g in leaves(ACCELERATION)
        ]


@pytest.mark.parametrize("noisy", [False, True])
@pytest.mark.parametrize("name", CENTROIDAL)
def test_the_centroidal_law_flies_its_one_preset_with_its_part_left_out(name, noisy):
    par = ENTRANTS[name].controller(MODEL, noisy=noisy).par
    mode = "joint" if name == "centroidal_joint" else "tip"
    usual = make_controller(
        "centroidal",
        MODEL,
        mode=mode,
        delay=0.005 if noisy and "prediction" not in name else 0.0,
    )
    lacking = "adaptation" if "adaptation" in name else ""
    if lacking:
        assert usual.par.parts.adaptation is not None
        usual = make_controller(
            "centroidal",
            MODEL,
            mode=mode,
            delay=0.005 if noisy else 0.0,
            adaptation=0.0,
        )
        assert par.parts.adaptation.load is None
    assert par == usual.par


@pytest.mark.parametrize("angle", [0.25, -1.3, 0.5 * np.pi, np.pi, 5.0])
def test_a_turned_wind_is_scipys_rotation_about_the_vertical(angle):
    """Tolerance: a handful of roundings of numbers below ten."""
    gust = Gust(peak=Vec3(1.0, 2.0, 3.0), start=1.0, duration=2.0)
    wind = ForceWind(
        force_W=Vec3(2.0, -3.0, 5.0),
        point_B=Vec3(0.1, 0.2, 0.3),
        air_velocity_W=Vec3(-1.0, 4.0, 7.0),
        gust=gust,
    )
    found, about_z = turn_wind(wind, angle), Rotation.from_euler("z", angle)
    np.testing.assert_allclose(
        list(found.force_W), about_z.apply([2.0, -3.0, 5.0]), rtol=0, atol=1e-14
    )
    np.testing.assert_allclose(
        list(found.air_velocity_W), about_z.apply([-1.0, 4.0, 7.0]), rtol=0, atol=1e-14
    )
    assert (found.gust, found.point_B) == (gust, wind.point_B)
    assert turn_wind(wind, 0.0) == wind


def cell(values, ended=()):
    status = np.array(
        ["fell" if i in ended else "completed" for i in range(len(values))]
    )
    return Cell({SUCCESS_METRIC: np.array(values)}, status)


def test_a_success_ends_its_flight_below_twenty_millimetres():
    good = successes(cell([0.0, 0.0199, 0.020, 0.0201, np.nan, 0.01], ended=(5,)))
    assert good.tolist() == [True, True, False, False, False, False]
