"""Geodetic coordinates against PROJ and PyMap3D, and by the geometry of the
ellipsoid.
"""

from __future__ import annotations

import math

import pytest

from skyarm.links.autopilots.px4_sensors import (
    from_earth_fixed,
    to_earth_fixed,
    to_geodetic,
)

ZURICH = (47.397742, 8.545594, 488.0)

REFERENCE = [
    (
        ZURICH,
        (120.5, -310.25, 42.0),
        (47.3988256777787, 8.5414844267428, 530.008671016),
    ),
    (
        (-35.363262, 149.165237, 584.0),
        (-2500.0, 5000.0, 300.0),
        (-35.3857795269668, 149.2202605084811, 886.448877410),
    ),
    (
        (71.2, -179.9995, 10.0),
        (1000.0, -4000.0, 1500.0),
        (71.2089273910370, 179.8893103261967, 1511.328414670),
    ),
    (
        (0.0, 0.0, 0.0),
        (-30000.0, 20000.0, -5.0),
        (-0.2713076662417, 0.1796626088120, 97.385382670),
    ),
    ((89.9999, 15.0, 0.0), (50.0, 0.0, 3.0), (89.9996523485083, -165.0, 3.000195323)),
    (
        (-89.9, -170.0, 2000.0),
        (-20000.0, 100.0, 100.0),
        (-89.9209935693899, 9.3509244533359, 2131.242437664),
    ),
]
"""Origin; north, east, up (m); latitude, longitude (degrees), height (m) by PROJ 9.5.1
through pyproj 3.7.2 (inverse of topocentric, inverse of cart, ellipsoid WGS84). PyMap3D
3.2.0 (enu2geodetic) differs by at most 1e-13 degrees and 12 nm: PROJ's error of the
height."""


@pytest.mark.parametrize(("origin", "local", "expected"), REFERENCE)
def test_a_local_point_is_where_proj_puts_it(origin, local, expected):
    """1e-11 degrees are a micrometre of latitude; nearer to a pole a longitude is less
    sharp.
    """
    latitude, longitude, height = to_geodetic(*local, origin)
    assert latitude == pytest.approx(expected[0], abs=1e-11)
    assert longitude == pytest.approx(
        expected[1], abs=1e-11 / math.cos(math.radians(expected[0]))
    )
    assert height == pytest.approx(expected[2], abs=3e-8)


def test_the_origin_is_itself():
    for origin in (
        ZURICH,
        (-60.0, -120.0, -30.0),
        (90.0, 0.0, 10.0),
        (-90.0, 0.0, 0.0),
        (0.0, 180.0, 0.0),
    ):
        assert to_geodetic(0.0, 0.0, 0.0, origin) == pytest.approx(origin, abs=1e-8)


def test_a_metre_north_and_a_metre_east_are_degrees_by_the_radii_of_curvature():
    """Meridian a (1 - e2) / (1 - e2 sin2)^1.5, normal a / (1 - e2 sin2)^0.5; f = 1 /
    298.257223563 (Torge, 2001).
    """
    f = 1.0 / 298.257223563
    e2, latitude = 2.0 * f - f * f, math.radians(ZURICH[0])
    w = math.sqrt(1.0 - e2 * math.sin(latitude) ** 2)
    meridian, normal = (
        6378137.0 * (1.0 - e2) / w**3 + ZURICH[2],
        6378137.0 / w + ZURICH[2],
    )
    north = to_geodetic(1.0, 0.0, 0.0, ZURICH)
    east = to_geodetic(0.0, 1.0, 0.0, ZURICH)
    above = to_geodetic(0.0, 0.0, 1.0, ZURICH)
    assert north[0] - ZURICH[0] == pytest.approx(math.degrees(1.0 / meridian), rel=1e-6)
    assert east[1] - ZURICH[1] == pytest.approx(
        math.degrees(1.0 / (normal * math.cos(latitude))), rel=1e-6
    )
    assert north[1] == pytest.approx(ZURICH[1], abs=1e-12)
    assert above == pytest.approx((ZURICH[0], ZURICH[1], 489.0), abs=1e-8)


@pytest.mark.parametrize("height", [-10_000.0, 0.0, 500.0, 20_000.0, 2e7])
def test_earth_fixed_coordinates_convert_back_to_rounding(height):
    """Latitudes to 1e-12 degrees, heights to 20 nm beside 2.6e7 m."""
    for latitude in (-90.0, -89.999, -45.0, -0.001, 0.0, 30.0, 60.0, 89.0, 90.0):
        for longitude in (-179.0, -90.0, 0.0, 1.0, 135.0):
            found = from_earth_fixed(*to_earth_fixed((latitude, longitude, height)))
            assert found[0] == pytest.approx(latitude, abs=1e-12)
            assert found[2] == pytest.approx(height, abs=2e-8)
            if abs(latitude) < 90.0:
                assert found[1] == pytest.approx(longitude, abs=1e-10)


def test_poles_and_equator_are_at_the_semi_axes():
    """6378137 m and 6356752.314245 m, of WGS 84; that of GRS 80 is 0.1 mm less."""
    assert to_earth_fixed((0.0, 0.0, 0.0)) == pytest.approx(
        (6378137.0, 0.0, 0.0), abs=1e-9
    )
    assert to_earth_fixed((0.0, 90.0, 5.0)) == pytest.approx(
        (0.0, 6378142.0, 0.0), abs=1e-8
    )
    assert to_earth_fixed((-90.0, 0.0, 7.0)) == pytest.approx(
        (0.0, 0.0, -6356759.314245), abs=2e-6
    )


@pytest.mark.parametrize(
    ("local", "words"),
    [
        (
            (math.nan, 0.0, 0.0),
            r"^position = \[nan, 0, 0\]: must be finite numbers, m north, east and up$",
        ),
        ((0.0, math.inf, 0.0), r"^position = \[0, inf, 0\]: must be finite"),
        ((0.0, 0.0, -math.inf), r"^position = \[0, 0, -inf\]: must be finite"),
    ],
)
def test_a_point_that_is_none_is_refused_in_one_line(local, words):
    with pytest.raises(ValueError, match=words) as refused:
        to_geodetic(*local, ZURICH)
    assert "\n" not in str(refused.value)
