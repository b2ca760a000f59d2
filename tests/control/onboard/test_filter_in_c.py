"""A law behind the error-state filter in C: readings in, commands out, with the bits of Python."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.onboard.export_c import (
    EstimatedConstants,
    FilterReadings,
    blank_readings,
    estimated_law,
    export_c,
    first_estimated_memory,
)
from skyarm.records.leaves import leaves
from skyarm.reference import Reference
from skyarm.sensing.sensor_kinds import EncoderReading
from support.commands import skyarm as typed
from support.engines import Loaded, needs_cc
from support.flights import TEXT, estimated

MOUNT = {"sensors__imu__position": [0.1, 0.0, -0.05], "sensors__imu__rpy": [0.1, 0.2, 1.0]}


class WithReadings(Loaded):
    """An exported law whose measurement is readings: sensor and field make a member's name."""

    def __call__(self, readings, reference, parameters=None):
        flat = {
            f"{name}_{field.name}": getattr(reading, field.name)
            for name in ("imu", "pose", "encoders")
            for reading in (getattr(readings, name),)
            for field in dataclasses.fields(reading)
        }
        made = dataclasses.make_dataclass("Flat", list(flat))(**flat)
        return super().__call__(made, reference, parameters)


@needs_cc
@pytest.mark.parametrize(("force", "mount"), [("measured", {}), ("modelled", {}), ("modelled", MOUNT)])
def test_filter_and_law_in_c_have_the_bits_of_python(tmp_path, force, mount):
    """Fed with the readings of a flight; the filter's memory too."""
    scenario = estimated(estimator__force=force, controller__preset="paper_ct", **mount)
    controller, estimator = scenario.controller, scenario.agent.placed_estimator
    text = export_c(controller, name="law", period=0.005, estimator=estimator).text
    assert "The law receives the estimate of an error-state filter: pose, inertial unit." in text
    in_c = WithReadings(text, tmp_path, ("-O0", "-ffp-contract=off"))
    step, memory = estimated_law(controller), first_estimated_memory(controller, estimator)
    constants = EstimatedConstants(parameters=controller.par, estimator=estimator, period=0.005)
    for readings, reference in recorded(scenario, 15):
        memory, command = step(constants, readings, reference, memory)
        found = in_c(readings, reference)
        assert memory.sent == command
        assert np.array_equal(found, [*command.rotor_speeds, *command.efforts])
    assert np.array_equal(in_c.memory.estimate_covariance_8, memory.estimate.covariance[8])
    assert in_c.memory.estimate_taken == 3.0


def test_a_force_sensor_goes_past_the_filter_to_the_law():
    scenario = estimated()
    model, estimator = scenario.controller.par.model, scenario.estimator
    law = make_centroidal(model, mode="tip", interaction=(0.3, 0.1), force_sensor=True)
    assert "double tip_force[3];" in export_c(law, name="law", period=0.005, estimator=estimator).text
    constants = EstimatedConstants(parameters=law.par, estimator=estimator, period=0.005)
    still = dict.fromkeys(("joints", "joint_rates", "joint_accelerations"), (0.0, 0.0))
    reference = Reference(**still, push=(1.0, 0.1, -1.0, 0.0, 0.0))
    readings = blank_readings(estimator, 2, tip_force=3)
    felt = []
    for told in ((0.0, 0.0, 0.0), (0.6, 0.0, 0.8)):
        first = first_estimated_memory(law, estimator)
        following, _ = estimated_law(law)(constants, dataclasses.replace(readings, tip_force=told), reference, first)
        felt.append(np.linalg.norm([*following.law.parts.interaction.felt]))
    assert felt == pytest.approx([0.0, 1.0 - np.exp(-60.0 * 0.005)])


def recorded(scenario, periods):
    """Readings of a flight as they arrive, with references."""
    session = skyarm.Session(scenario, machine_code=False)
    arm = {f"joint{w}": (0.0, 0.0) for w in ("s", "_rates", "_accelerations", "_jerks", "_snaps")}
    for _ in range(periods):
        session.step()
        held = session.now.agent.estimate
        encoders = session.now.agent.sensors[3].memory.own
        reading = EncoderReading(time=held.joints.read, joints=encoders, joint_rates=(0.0, 0.0))
        yield FilterReadings(imu=held.inertial[-1], pose=held.aiding[0][-1], encoders=reading), Reference(**arm).dense()


def test_the_command_line_exports_the_filter_of_a_scenario(tmp_path):
    file = tmp_path / "flight.toml"
    file.write_text(TEXT)
    result = typed("export", "--to", "c", str(file), "-o", str(tmp_path / "law.c"))
    assert result.code == 0, result.err
    text = (tmp_path / "law.c").read_text()
    for member in (
        "double pose_quaternion[4]; /* attitude w x y z, base to world */",
        "double estimator_gyro;",
        "double imu_time;",
    ):
        assert member in text
    assert leaves(estimated().estimator)
