"""The bias of a channel as signals of time: read as said, at the instant of the
reading, by path, and at no cost.
"""

from __future__ import annotations

import pytest

import skyarm
from skyarm.records.coerce import RecordError
from skyarm.reference import Constant, Sine
from skyarm.reference.signal_tables import SignalList
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.sensing.channel import Channel

DOCUMENT = {
    "name": "biased",
    "duration": 0.2,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {"preset": "centroidal_joint"},
    "sensors": {
        "gps": {
            "kind": "position",
            "position": {
                "sigma": 0.0,
                "bias": [1.0, 0.0, 0.0],
                "offset": [
                    {"kind": "ramp", "start": 1.0, "duration": 2.0, "height": 0.4},
                    0,
                    -0.1,
                ],
            },
        }
    },
}


def test_a_reading_is_off_by_the_signals_at_its_instant():
    scenario = scenario_from(DOCUMENT)
    path = "sensors.gps.position.offset.signals.0.height"
    assert number_at(scenario, path) == 0.4
    for height, changed in (
        (0.4, scenario),
        (0.8, with_numbers(scenario, {path: 0.8})),
    ):
        sensor = changed.sensors[0].sensor
        state = skyarm.Session(changed, machine_code=False).state
        vehicle = changed.plant.vehicle
        draws = [0.5] * sensor.uniforms(vehicle)
        for t, share in ((0.5, 0.0), (2.0, 0.5), (5.0, 1.0)):
            _, reading = sensor.measure(
                sensor.start(vehicle), t, state, state.velocity, draws, 0.1
            )
            off = reading.position - state.position
            assert tuple(off) == pytest.approx((1.0 + share * height, 0.0, -0.1))


def test_signals_that_are_too_few_are_one_line():
    channel = Channel(
        offset=SignalList((Constant(1.0), Sine(amplitude=1.0, frequency_hz=1.0)))
    )
    with pytest.raises(
        RecordError, match=r"^gyro\.offset = 2 signals: must be 3, or none$"
    ):
        channel.require_count(3, "gyro")
    gps = {"kind": "position", "position": {"offset": 0.1}}
    with pytest.raises(
        ValueError, match=r"offset = 0\.1: must be a list of signals of time"
    ):
        scenario_from({**DOCUMENT, "sensors": {"gps": gps}})


def test_a_channel_without_signals_reads_its_bits():
    assert Channel(bias=(0.1,)).read((0.3,), (), (), 0.005) == (0.3 + 0.1,)
    none = Channel(bias=(0.1,), offset=SignalList((Constant(0),)))
    assert none.read((0.3,), (), (), 0.005, 7.0) == (0.3 + 0.1,)
