"""A reference whose velocity steps is warned of: at the start from that of the vehicle,
later from its own.
"""

import numpy as np
import pytest

import skyarm
from skyarm.studies.assess.assessment import assess_scenario
from skyarm.studies.assess.before_flight import warnings_before_flight
from skyarm.studies.assess.finding import WARNING

QUESTION = "steps of the reference"


def scenario(base, **more):
    document = {
        "name": "steps",
        "duration": 6.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "centroidal_tip"},
        "reference": {"base": {"kind": "signals", **base}},
    }
    return skyarm.scenario_from(document | more)


def step_of(built):
    return next(
        (each for each in assess_scenario(built).findings if each.question == QUESTION),
        None,
    )


def sine(speed, frequency=0.4, **more):
    """A sine whose largest speed, m/s, is that of its beginning."""
    return {
        "kind": "sine",
        "amplitude": speed / (2.0 * np.pi * frequency),
        "frequency_hz": frequency,
        **more,
    }


@pytest.mark.parametrize(
    ("base", "speed", "time"),
    [
        ({"x": sine(0.7)}, 0.7, 0.0),
        ({"x": sine(0.3), "y": sine(0.4), "z": sine(1.2)}, 1.3, 0.0),
        ({"y": sine(0.51)}, 0.51, 0.0),
        ({"x": sine(0.6, start=2.0)}, 0.6, 2.0),
        ({"x": sine(0.6, stop=2.0), "y": sine(0.7, start=1.0)}, 0.7, 1.0),
        (
            {"x": {"kind": "ramp", "start": 1.0, "duration": 1.0, "height": 2.0}},
            2.0,
            1.0,
        ),
    ],
)
def test_a_step_of_the_velocity_is_its_number_at_its_time(base, speed, time):
    found = step_of(scenario(base))
    assert found.level == WARNING
    assert (found.value, found.limit) == (
        pytest.approx(speed, rel=1e-4),
        pytest.approx(0.5),
    )
    assert f"steps by {speed:.3g} m/s at {time:.3g} s" in found.text
    assert any(
        line.startswith("reference.base: the velocity steps by")
        for line in warnings_before_flight(scenario(base))
    )


@pytest.mark.parametrize("phase", [0.0, 0.5 * np.pi])
def test_a_reference_that_is_tracked_later_steps_from_rest_at_that_time(phase):
    """A quarter of a period of 2.5 s later a sine is as fast as a cosine at first: not
    at all, or at its fastest.
    """
    base = {"kind": "signals", "x": sine(0.9, phase=phase)}
    moves = {"velocity": [3.0, 0.0, 0.0]}
    found = step_of(
        scenario({}, initial=moves, reference={"base": base, "tracking_start": 0.625})
    )
    if phase == 0.0:
        assert found is None
    else:
        assert found.value == pytest.approx(0.9, rel=1e-4)
        assert "steps by 0.9 m/s at 0.625 s" in found.text


@pytest.mark.parametrize(
    "base",
    [
        {"x": 1.0, "y": sine(0.49)},
        {
            "x": {
                "kind": "sine",
                "amplitude": 0.5,
                "frequency_hz": 0.4,
                "phase": np.pi / 2,
            }
        },
        {
            "x": {
                "kind": "ramp",
                "start": 1.0,
                "duration": 1.0,
                "height": 2.0,
                "shape": "quintic",
            }
        },
    ],
)
def test_a_motion_that_begins_at_rest_or_slowly_is_no_step(base):
    assert step_of(scenario(base)) is None


def test_a_vehicle_that_begins_as_fast_as_its_reference_is_not_struck():
    """What the warning advises takes the error of the first second away."""
    base = {"x": sine(1.0), "z": 2.0}
    struck, moving = (
        scenario(base, duration=1.0, **each)
        for each in ({}, {"initial": {"velocity": [1.0, 0.0, 0.0]}})
    )
    assert step_of(struck) is not None
    assert step_of(moving) is None
    # one that moves while its reference rests is to brake: whoever states so knows
    assert step_of(scenario({"z": 2.0}, initial={"velocity": [0.0, -6.0, 0.0]})) is None
    other = scenario(base, initial={"velocity": [0.3, 0.0, 0.0]})
    assert step_of(other).value == pytest.approx(0.7, rel=1e-4)
    errors = []
    for each in (struck, moving):
        log = skyarm.run(each)
        errors.append(
            np.linalg.norm(log.position - log.position_reference, axis=1).max()
        )
    assert errors[0] > 5.0 * errors[1]
