"""A law behind the error-state filter in C: readings in, commands out, with the bits of
Python.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion
from skyarm.cli.export_command import _late_periods
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.onboard.export_c import (
    EstimatedConstants,
    EstimatedMemory,
    FilterReadings,
    blank_readings,
    estimated_law,
    export_c,
    first_estimated_memory,
)
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import Reference
from skyarm.sensing.sensor_kinds import EncoderReading
from support.commands import refused
from support.commands import skyarm as typed
from support.engines import Loaded, needs_cc
from support.flights import TEXT, estimated

MOUNT = {
    "sensors__imu__position": [0.1, 0.0, -0.05],
    "sensors__imu__rpy": [0.1, 0.2, 1.0],
}


class WithReadings(Loaded):
    """An exported law whose measurement is readings: sensor and field make a member's
    name.
    """

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
@pytest.mark.parametrize(
    ("force", "mount", "late"),
    [("measured", {}, (0, 0)), ("modelled", {}, (3, 1)), ("modelled", MOUNT, (0, 0))],
)
def test_filter_and_law_in_c_have_the_bits_of_python(tmp_path, force, mount, late):
    """Fed with the readings of a flight; the filter's memory too."""
    scenario = estimated(estimator__force=force, controller__preset="paper_ct", **mount)
    controller, estimator = scenario.controller, scenario.agent.placed_estimator
    text = export_c(
        controller, name="law", period=0.005, estimator=estimator, late=late
    ).text
    assert (
        "The law receives the estimate of an error-state filter: pose, inertial unit."
        in text
    )
    in_c = WithReadings(text, tmp_path, ("-O0", "-ffp-contract=off"))
    step, memory = (
        estimated_law(controller, late),
        first_estimated_memory(controller, estimator, max(late)),
    )
    constants = EstimatedConstants(
        parameters=controller.par, estimator=estimator, period=0.005
    )
    for readings, reference in recorded(scenario, 15):
        memory, command = step(constants, readings, reference, memory)
        found = in_c(readings, reference)
        assert memory.sent == command
        assert np.array_equal(found, [*command.rotor_speeds, *command.efforts])
    assert np.array_equal(
        in_c.memory.estimate_covariance_8, memory.estimate.covariance[8]
    )
    assert in_c.memory.estimate_taken == 2.0  # the pose of time 0 has not come


@needs_cc
def test_the_filter_starts_when_every_reading_has_come_and_hovers_until_then(tmp_path):
    """Zeros, NaN, one reading that lacks, a quaternion of zeros: none is the truth that
    the filter starts from.
    """
    scenario = estimated(controller__preset="paper_ct")
    controller, estimator = scenario.controller, scenario.agent.placed_estimator
    in_c = WithReadings(
        export_c(controller, name="law", period=0.005, estimator=estimator).text,
        tmp_path,
    )
    *_, (readings, reference) = recorded(scenario, 8)
    zero, nan = (
        rebuild(readings, iter([value] * len(leaves(readings))))
        for value in (0.0, math.nan)
    )
    unset = dataclasses.replace(
        readings.pose, quaternion=Quaternion(0.0, 0.0, 0.0, 0.0)
    )
    early = [
        dataclasses.replace(readings, **{key: getattr(zero, key)})
        for key in ("imu", "pose", "encoders")
    ]
    first, hover = (
        bytes(in_c.memory),
        [
            *in_c.memory.sent_rotor_speeds,
            *in_c.memory.sent_efforts,
        ],
    )
    for each in (zero, nan, *early, dataclasses.replace(readings, pose=unset)):
        assert in_c(each, reference) == hover
        assert bytes(in_c.memory) == first
    assert in_c(readings, reference) != hover
    assert in_c.memory.estimate_started == 1.0
    assert [*in_c.memory.estimate_belief_quaternion] == pytest.approx(
        [*readings.pose.quaternion]
    )
    # poses of NaN are refused: the command shows none of them, the memory does
    for i in range(1, 6):
        time = {"time": readings.imu.time + 0.005 * i}
        lost = (
            dataclasses.replace(nan.pose, **time),
            dataclasses.replace(readings.imu, **time),
        )
        assert np.isfinite(
            in_c(dataclasses.replace(readings, pose=lost[0], imu=lost[1]), reference)
        ).all()
    assert (in_c.memory.estimate_taken, in_c.memory.estimate_refused) == (0.0, 3.0)


@pytest.mark.parametrize(
    ("delays", "late"),
    [
        ({}, (0, 0)),
        ({"command": 0.012}, (2, 2)),
        ({"command": 0.005, "rotors": 0.01}, (3, 1)),
    ],
)
def test_the_exported_filter_predicts_by_the_command_that_acts_as_the_simulator_s(
    delays, late
):
    """From a state of the flight on, estimate and command have the bits of the loop's
    own filter and law.
    """
    scenario = estimated(
        controller__preset="paper_ct", estimator__force="modelled", delays=delays
    )
    assert _late_periods(scenario) == late
    constants = EstimatedConstants(
        parameters=scenario.controller.par,
        estimator=scenario.agent.placed_estimator,
        period=0.005,
    )
    session = skyarm.Session(scenario, machine_code=False)
    session.step()
    own = session.now.agent
    memory = EstimatedMemory(
        estimate=own.estimate,
        law=own.memory,
        sent=own.queue[-1],
        underway=tuple(own.queue[-1 - max(late) : -1]),
    )
    for _ in range(20):
        reference = session.reference
        session.step()
        readings = readings_of(session)
        memory, _ = estimated_law(scenario.controller, late)(
            constants, readings, reference, memory
        )
        assert memory.estimate == session.now.agent.estimate
        assert memory.sent == session.now.agent.queue[-1]


def test_single_precision_with_an_estimator_is_refused_with_the_cure(tmp_path):
    (tmp_path / "flight.toml").write_text(TEXT)
    file, written = str(tmp_path / "flight.toml"), tmp_path / "law.c"
    result = typed("export", "--to", "c", file, "--float32", "-o", str(written))
    refused(
        result,
        "--float32: must be left out with an estimator",
        "export in double, or the law alone",
    )
    assert not written.exists()


def test_the_opening_has_the_rules_of_the_readings_and_what_shows_a_lost_filter():
    scenario = estimated()
    opening = export_c(
        scenario.controller, name="law", period=0.005, estimator=scenario.estimator
    ).text.split("*/")[0]
    for words in (
        "one clock for all time stamps",
        "repeat the old one",
        "every stamp is above 0",
        "estimate_refused",
    ):
        assert words in opening, words
    assert "A NaN that the law reads reaches the command" not in opening
    alone = export_c(scenario.controller, name="law", period=0.005).text.split("*/")[0]
    assert "A NaN that the law reads reaches the command" in alone


def test_a_force_sensor_goes_past_the_filter_to_the_law():
    scenario = estimated()
    model, estimator = scenario.controller.par.model, scenario.estimator
    law = make_centroidal(model, mode="tip", interaction=(0.3, 0.1), force_sensor=True)
    assert (
        "double tip_force[3];"
        in export_c(law, name="law", period=0.005, estimator=estimator).text
    )
    constants = EstimatedConstants(
        parameters=law.par, estimator=estimator, period=0.005
    )
    still = dict.fromkeys(("joints", "joint_rates", "joint_accelerations"), (0.0, 0.0))
    reference = Reference(**still, push=(1.0, 0.1, -1.0, 0.0, 0.0))
    blank = blank_readings(estimator, 2, tip_force=3)
    at = {
        name: dataclasses.replace(getattr(blank, name), time=0.1)
        for name in ("imu", "pose", "encoders")
    }
    readings = dataclasses.replace(blank, **at)
    felt = []
    for told in ((0.0, 0.0, 0.0), (0.6, 0.0, 0.8)):
        first = first_estimated_memory(law, estimator)
        following, _ = estimated_law(law)(
            constants, dataclasses.replace(readings, tip_force=told), reference, first
        )
        felt.append(np.linalg.norm([*following.law.parts.interaction.felt]))
    assert felt == pytest.approx([0.0, 1.0 - np.exp(-60.0 * 0.005)])


def recorded(scenario, periods):
    """Readings of a flight as they arrive, with references."""
    session = skyarm.Session(scenario, machine_code=False)
    arm = {
        f"joint{w}": (0.0, 0.0)
        for w in ("s", "_rates", "_accelerations", "_jerks", "_snaps")
    }
    for _ in range(periods):
        session.step()
        yield readings_of(session), Reference(**arm).dense()


def readings_of(session):
    """Readings that the filter was given in the last period."""
    held = session.now.agent.estimate
    encoders = session.now.agent.sensors[3].memory.own
    reading = EncoderReading(
        time=held.joints.read, joints=encoders, joint_rates=(0.0, 0.0)
    )
    return FilterReadings(
        imu=held.inertial[-1], pose=held.aiding[0][-1], encoders=reading
    )


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
