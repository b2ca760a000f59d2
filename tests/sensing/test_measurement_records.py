"""Readings without errors: every field of the state under its own name."""

import dataclasses

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.records.leaves import leaves
from skyarm.sensing.measurement import blank_measurement, measurement_of

STATE = State(
    position=Vec3(1.0, 2.0, 3.0),
    quaternion=Quaternion(0.1, 0.7, 0.5, 0.5),
    velocity=Vec3(4.0, 5.0, 6.0),
    rate=Vec3(7.0, 8.0, 9.0),
    joints=(10.0, 11.0),
    joint_rates=(12.0, 13.0),
    rotor_speeds=(14.0, 15.0, 16.0, 17.0),
)


def test_a_reading_of_a_state_has_each_of_its_fields():
    force = Vec3(0.5, 0.6, 9.7)
    found = measurement_of(STATE, force)
    for field in dataclasses.fields(STATE):
        assert getattr(found, field.name) == getattr(STATE, field.name), field.name
    assert (found.time, found.specific_force) == (0.0, force)


def test_an_example_has_the_structure_of_a_reading_and_a_level_attitude():
    blank = blank_measurement(2, 4)
    assert len(leaves(blank)) == len(leaves(measurement_of(STATE, Vec3(0.0, 0.0, 0.0))))
    assert tuple(blank.quaternion) == (1.0, 0.0, 0.0, 0.0)
    assert all(isinstance(leaf, float) for leaf in leaves(blank)), "data, nothing folds"
