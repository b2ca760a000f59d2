"""Accuracy that a flight allows, as it is told: of positive numbers in per cent, of all
windows by some of them.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_fits import fit_of

from skyarm.identify import information
from skyarm.identify.identified_numbers import scale_of
from skyarm.identify.information import NOT_EXCITED, ExpectedNumber, expected_numbers
from skyarm.identify.unknowns import Reported, Unknown

pytest.importorskip("scipy", reason="needs the extra 'identify'")


def number(**changes):
    values = {
        "name": "rotors.inertia",
        "unit": "kg m^2",
        "start": 0.0,
        "half_width": 0.01234,
        "relative": 0.0,
    }
    return ExpectedNumber(**{**values, "data_share": 0.9, **changes})


@pytest.mark.parametrize(
    ("changes", "title", "verdict"),
    [
        ({}, "inertia of a rotor", "excited (± 0.012 kg m^2)"),
        (
            {"name": "base.inertia.xx", "relative": 0.0312},
            "roll inertia",
            "excited (± 3.1 %)",
        ),
        (
            {"name": "sag", "unit": ""},
            "exponent of the thrust over the voltage",
            "excited (± 0.012)",
        ),
        (
            {"name": "gyro_bias.y"},
            "bias of the gyro about y",
            "excited (± 0.012 kg m^2)",
        ),
        (
            {"name": "place.z", "data_share": 0.5},
            "place of the IMU along z",
            "excited (± 0.012 kg m^2)",
        ),
        (
            {"name": "offset.x", "data_share": 0.49},
            "offset of the accelerometer along x",
            NOT_EXCITED,
        ),
        ({"name": "links.arm.mass"}, "links.arm.mass", "excited (± 0.012 kg m^2)"),
    ],
)
def test_a_number_is_told_in_words_with_the_accuracy_to_expect(changes, title, verdict):
    found = number(**changes)
    assert (found.title, found.verdict) == (title, verdict)
    assert found.is_excited == (verdict != NOT_EXCITED)


def test_all_windows_tell_more_than_those_that_are_fitted(monkeypatch):
    """A quarter of them fitted: half of the width. Of a lag that commands below 40 Hz
    do not show, no share.
    """
    unknowns = [
        Unknown(name="delay", unit="s", start=0.005, spread=0.1),
        Unknown(
            name="rotors.moment_coefficient",
            unit="m",
            start=0.016,
            spread=0.5,
            positive=True,
        ),
        Unknown(name="sag", unit="", start=1.0, spread=1e-3),
    ]
    reported = [
        Reported(name=each.name, unit=each.unit, parts=(each.name,))
        for each in unknowns
    ]
    # so that half of that is known to 1 ms and 2 %
    fit = fit_of(
        [0.003, math.log(0.02), 1.0], np.diag([2e-3, 0.04, 0.1]) ** 2, blocks=200
    )
    search = SimpleNamespace(
        unknowns=unknowns,
        flights="flights",
        start="vehicle",
        whole=0.25,
        sample=0.002,
        scale=lambda found: scale_of(found, unknowns, reported, {}),
        hidden_lags=lambda: {"delay"},
    )
    monkeypatch.setattr(information, "search_of", lambda flights, start: search)
    monkeypatch.setattr(
        information,
        "first_fits",
        lambda _: (SimpleNamespace(windows=SimpleNamespace(count=60)), fit),
    )

    def windows(*given):
        assert given == ("flights", "vehicle", 0.25)
        return SimpleNamespace(count=240)

    monkeypatch.setattr(information, "ClockedWindows", windows)
    late, moment, sag = expected_numbers(["flight"], "vehicle")
    student = 1.97196  # of 199 degrees of freedom
    assert (late.name, late.unit, late.start, late.relative) == (
        "delay",
        "s",
        0.005,
        0.0,
    )
    assert late.half_width == pytest.approx(student * 1e-3, rel=1e-4)
    assert (late.data_share, late.verdict) == (0.0, NOT_EXCITED)
    assert moment.relative == pytest.approx(student * 0.02, rel=1e-4)
    assert moment.half_width == pytest.approx(0.016 * moment.relative)
    assert moment.data_share == pytest.approx(
        1.0 - (student / 1.959964 * 0.02 / 0.5) ** 2, rel=1e-4
    )
    assert moment.verdict == "excited (± 3.9 %)"
    # known before to a hundredth of what the flight tells
    assert sag.half_width == pytest.approx(1.959964e-3)
    assert sag.data_share == pytest.approx(0.0, abs=1e-9)
