"""sin, exp, log ... written in basic operations, against numbers of 120 digits and
against IEEE's special cases.
"""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest

from skyarm.algebra import scalars
from skyarm.algebra.scalars import elementary

INF, NAN = math.inf, math.nan
RNG = np.random.default_rng(20)
SAMPLES = 1500


def spread(low, high, count=SAMPLES):
    """Half of the numbers uniform, half log-uniform in magnitude down to 1e-12 of the
    range.
    """
    size = max(abs(low), abs(high))
    small = (
        size
        * 10.0 ** RNG.uniform(-12.0, 0.0, count // 2)
        * RNG.choice([-1.0, 1.0], count // 2)
    )
    return [
        x
        for x in np.concatenate([RNG.uniform(low, high, count // 2), small]).tolist()
        if low <= x <= high
    ]


def ulps(ours, exact):
    """Error in units of the last place of the true value."""
    return (
        float(abs(exact - ours) / math.ulp(abs(float(exact))))
        if exact
        else (0.0 if ours == 0.0 else INF)
    )


# the largest errors found in 1e5 samples, rounded up; the bound of a correctly rounded
# function is 0.5
BOUNDS = {
    "sin": (1.45, spread(-20.0, 20.0) + spread(-1e5, 1e5)),
    "cos": (1.45, spread(-20.0, 20.0) + spread(-1e5, 1e5)),
    "tan": (2.6, spread(-20.0, 20.0)),
    "exp": (0.9, spread(-700.0, 709.7) + spread(-1.0, 1.0)),
    "log": (0.85, [abs(x) for x in spread(1e-300, 1e300)] + spread(0.5, 2.0)),
    "asin": (2.1, spread(-1.0, 1.0)),
    "acos": (2.1, spread(-1.0, 1.0)),
    "tanh": (1.35, spread(-20.0, 20.0) + spread(-0.7, 0.7)),
}


@pytest.mark.parametrize("name", sorted(BOUNDS))
def test_a_function_is_within_its_bound_of_the_exact_value(name):
    mpmath = pytest.importorskip("mpmath")
    bound, points = BOUNDS[name]
    function, exact = getattr(elementary, name), getattr(mpmath, name)
    with mpmath.workdps(120):
        worst = max((ulps(function(x), exact(mpmath.mpf(x))), x) for x in points)
    assert worst[0] <= bound, worst


def test_atan2_is_within_its_bound_in_every_octant():
    mpmath = pytest.importorskip("mpmath")
    angles = np.concatenate(
        [RNG.uniform(-math.pi, math.pi, SAMPLES), np.arange(-16, 17) * math.pi / 8]
    )
    radii = 10.0 ** RNG.uniform(-100.0, 100.0, angles.size)
    with mpmath.workdps(120):
        for y, x in zip(
            (radii * np.sin(angles)).tolist(),
            (radii * np.cos(angles)).tolist(),
            strict=True,
        ):
            assert (
                ulps(elementary.atan2(y, x), mpmath.atan2(mpmath.mpf(y), mpmath.mpf(x)))
                <= 1.6
            ), (y, x)


def test_functions_join_without_a_step_where_their_pieces_meet():
    """At each boundary between two formulas the neighbours below and above differ by
    rounding only.
    """
    mpmath = pytest.importorskip("mpmath")
    seams = [
        ("tanh", 0.625),
        ("exp", 0.5 * math.log(2.0)),
        ("log", math.sqrt(2.0)),
        ("log", 1.0),
        ("asin", 0.55),
    ]
    seams += [("sin", k * math.pi / 4) for k in range(-8, 9)] + [
        ("cos", k * math.pi / 4) for k in range(-8, 9)
    ]
    with mpmath.workdps(120):
        for name, at in seams:
            for x in (math.nextafter(at, -INF), at, math.nextafter(at, INF)):
                ours, exact = (
                    getattr(elementary, name)(x),
                    getattr(mpmath, name)(mpmath.mpf(x)),
                )
                assert ulps(ours, exact) <= 1.6, (name, x)


SIGNED_ZEROS = [
    (elementary.sin, 0.0, 0.0),
    (elementary.sin, -0.0, -0.0),
    (elementary.tan, -0.0, -0.0),
    (elementary.tanh, -0.0, -0.0),
    (elementary.asin, -0.0, -0.0),
    (elementary.acos, 1.0, 0.0),
    (elementary.log, 1.0, 0.0),
    (elementary.exp, -0.0, 1.0),
    (elementary.cos, -0.0, 1.0),
    (elementary.sin, 5e-324, 5e-324),
    (elementary.tanh, -5e-324, -5e-324),
]


@pytest.mark.parametrize(("function", "x", "expected"), SIGNED_ZEROS)
def test_zeros_keep_their_sign_and_the_smallest_numbers_their_value(
    function, x, expected
):
    assert struct.pack("<d", function(x)) == struct.pack("<d", expected)


LIMITS = [
    ("exp", INF, INF),
    ("exp", -INF, 0.0),
    ("exp", 709.79, INF),
    ("exp", 709.78, math.exp(709.78)),
    ("exp", -745.2, 0.0),
    ("exp", -740.0, math.exp(-740.0)),
    ("log", 0.0, -INF),
    ("log", -0.0, -INF),
    ("log", -1.0, NAN),
    ("log", INF, INF),
    ("tanh", INF, 1.0),
    ("tanh", -INF, -1.0),
    ("tanh", 400.0, 1.0),
    ("asin", 1.0000001, NAN),
    ("acos", -1.0000001, NAN),
    ("acos", -1.0, math.pi),
    ("asin", 1.0, math.pi / 2),
    ("sin", INF, NAN),
    ("cos", -INF, NAN),
    ("tan", INF, NAN),
]


@pytest.mark.parametrize(("name", "x", "expected"), LIMITS)
def test_limits_are_those_of_ieee(name, x, expected):
    found = getattr(elementary, name)(x)
    # subnormal results are rounded twice: one part in 2**20 there
    assert (
        math.isnan(found)
        if math.isnan(expected)
        else found == pytest.approx(expected, rel=1e-6)
    )


@pytest.mark.parametrize("name", sorted(elementary.COMPOSED))
def test_nan_stays_nan(name):
    function = elementary.COMPOSED[name]
    if name != "atan2":
        assert math.isnan(function(NAN))
        return
    assert all(
        math.isnan(function(*pair))
        for pair in ((NAN, 1.0), (1.0, NAN), (NAN, NAN), (NAN, INF), (INF, NAN))
    )


def test_atan2_agrees_with_the_library_on_all_pairs_of_special_values():
    special = [0.0, -0.0, 1.0, -1.0, INF, -INF, 5e-324, -5e-324, 1e308, -1e308]
    for y in special:
        for x in special:
            ours, libm = elementary.atan2(y, x), math.atan2(y, x)
            assert ours == pytest.approx(libm, rel=4e-16), (y, x)
            assert math.copysign(1.0, ours) == math.copysign(1.0, libm), (y, x)


def test_the_scalars_module_gives_floats_these_functions():
    for x in (0.3, -1.7, 12.5):
        for name in ("sin", "cos", "exp", "tanh"):
            assert getattr(scalars, name)(x) == getattr(elementary, name)(x)


def test_arrays_get_the_bits_of_floats():
    """NumPy arrays through the same lines: every lane equals the float; frexp and
    copysign have twins there.
    """
    points = np.array([-3.0, -0.0, 0.1, 0.7, 2.0, 1e4])
    for name in ("sin", "cos", "tan", "log"):
        arguments = np.abs(points) + 0.1 if name == "log" else points
        one_by_one = [getattr(elementary, name)(float(x)) for x in arguments]
        assert getattr(elementary, name)(arguments).tolist() == one_by_one
