"""Delays and lags planted in noisy flights, found in what the sensors said of them: the table of docs/delays.md."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from planted_lags import lagging_drives, with_slower_motors
from shared_programs import fly
from skyarm.log.flight_log import rows_of
from skyarm.log.sensor_data import fields_of
from skyarm.simulate.assemble_log import Piece, join_pieces
from skyarm.studies.identify.loop_lags import loop_lags
from skyarm.studies.tune.excitation import of_vehicle, tuning_flight

pytest.importorskip("scipy", reason="needs the extra 'identify'")


def as_measured(scenario):
    """The log of a flight as a vehicle keeps it: what its sensors said in place of the true state."""
    engine = fly(scenario).engine
    found = engine.samples(0, engine.tick)
    log = join_pieces(scenario, [Piece(scenario, engine.inputs, 0, found)], None)
    # the log has what the law received; a reading stands at the instant at which it was taken
    late = round(scenario.delays.measurement * scenario.rates.control)
    measured = {name: array[late:] for name, _, array in fields_of(found.measurement, len(log.time))}
    measured["quaternion"] /= np.linalg.norm(measured["quaternion"], axis=1, keepdims=True)
    parts = {name: measured[name] for name in ("position", "quaternion", "velocity", "rate", "joints", "joint_rates")}
    return dataclasses.replace(rows_of(log, slice(0, len(log.time) - late)), **parts)


@pytest.mark.thorough
@pytest.mark.parametrize("vehicle", ["hummingbird_arm2_rotors", "crazyflie_arm1", "hexarotor_arm6"])
@pytest.mark.parametrize(("late", "slower", "drive"), [(0.005, 0.5, 0.01), (0.01, 2.0, 0.02), (0.02, 1.0, 0.0)])
def test_twelve_noisy_seconds_tell(vehicle, late, slower, drive):
    believed = skyarm.load_vehicle(vehicle)
    base = tuning_flight(of_vehicle(believed, "centroidal_tip"))
    scenario = dataclasses.replace(
        base,
        duration=12.0,
        seed=23,
        drives=lagging_drives(believed, drive),
        delays=skyarm.Delays(measurement=0.005, command=late),
        plant=dataclasses.replace(base.plant, vehicle=with_slower_motors(believed, slower)),
    )
    log = as_measured(scenario)
    found = loop_lags(log, believed).rotors
    assert found.is_known
    assert found.delay.low <= late <= found.delay.high
    # a law that predicts across the delay moves calmly: of fast motors only the sum of delay and lag shows
    if (vehicle, slower) != ("hummingbird_arm2_rotors", 0.5):
        assert found.apart
        assert abs(found.delay.value - late) < 0.0035
        assert found.factor == pytest.approx((slower, slower), rel=0.12)
