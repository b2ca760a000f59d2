"""Flights as their sensors measure them, of vehicles whose motors and joint drives
lag.
"""

import dataclasses

import numpy as np
from planted_vehicles import lagging_drives, with_slower_motors

import skyarm
from skyarm.log.flight_log import rows_of
from skyarm.log.sensor_data import fields_of
from skyarm.simulate.assemble_log import Piece, join_pieces
from skyarm.studies.tune.excitation import of_vehicle, tuning_flight
from support.flights import fly


def as_measured(scenario):
    """The log of a flight as a vehicle keeps it: what its sensors said in place of the
    true state.
    """
    engine = fly(scenario).engine
    (found,) = engine.recorder.samples(0, engine.tick)
    log = join_pieces(scenario, [Piece(scenario, engine.inputs, 0, (found,))], None)
    # the log has what the law received; a reading stands at the instant at which it was
    # taken
    late = round(scenario.delays.measurement * scenario.rates.control)
    measured = {
        name: array[late:]
        for name, _, array in fields_of(found.measurement, len(log.time))
    }
    measured["quaternion"] /= np.linalg.norm(
        measured["quaternion"], axis=1, keepdims=True
    )
    parts = {
        name: measured[name]
        for name in (
            "position",
            "quaternion",
            "velocity",
            "rate",
            "joints",
            "joint_rates",
        )
    }
    return dataclasses.replace(rows_of(log, slice(0, len(log.time) - late)), **parts)


def planted(believed, seconds, late, slower, drive, seed):
    """Log as measured of a vehicle whose commands are late, and whose motors and drives
    are slower than believed.
    """
    base = tuning_flight(of_vehicle(believed))
    return as_measured(
        dataclasses.replace(
            base,
            duration=seconds,
            seed=seed,
            drives=() if believed.drives else lagging_drives(believed, drive),
            delays=skyarm.Delays(measurement=0.005, command=late),
            plant=dataclasses.replace(
                base.plant, vehicle=with_slower_motors(believed, slower)
            ),
        )
    )


def truths_of(believed, late, slower, drive):
    """True values of the rotors' and of the joints' delay and lag together, delay, time
    constants up and down, s.
    """
    rotor = believed.rotors[0]
    up, down = slower * rotor.time_constant_up, slower * rotor.time_constant_down
    return (late + 2.0 / (1.0 / up + 1.0 / down), late, up, down), (
        late + drive,
        late,
        drive,
        drive,
    )


def numbers_of(lag):
    return lag.together, lag.delay, lag.up, lag.down
