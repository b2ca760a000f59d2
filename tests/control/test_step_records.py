"""What a stepped law hands to its parts: the continued reference field by field, and
the command that acts now.
"""

from __future__ import annotations

import dataclasses

import pytest
from published_laws import DT, MODEL, gentle, measured, vec

from skyarm.control.catalogue import make_controller
from skyarm.control.laws import ladder as room
from skyarm.dynamics.actuators import Command
from skyarm.reference import Reference

SAMPLE = Reference(
    position=vec((0.1, 0.2, 0.3)),
    velocity=vec((0.4, 0.5, 0.6)),
    acceleration=vec((0.7, 0.8, 0.9)),
    yaw=1.0,
    yaw_rate=1.1,
    yaw_acceleration=1.2,
    joints=(1.3, 1.4),
    joint_rates=(1.5, 1.6),
    joint_accelerations=(1.7, 1.8),
).dense()


def test_at_a_fresh_sample_the_continued_reference_is_that_sample_in_every_field():
    controller = make_controller("ct_ladder", MODEL, steps=room.EXTRAPOLATION)
    now, _, _ = room._present(controller.memory, SAMPLE, DT, controller.par)
    for name in (
        "position",
        "velocity",
        "acceleration",
        "yaw",
        "yaw_rate",
        "yaw_acceleration",
        "joints",
        "joint_rates",
        "joint_accelerations",
    ):
        found, given = getattr(now, name), getattr(SAMPLE, name)
        parts = (
            ([*found], [*given]) if hasattr(found, "__iter__") else ([found], [given])
        )
        assert parts[0] == pytest.approx(parts[1], rel=1e-12), name


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_the_observer_is_told_the_command_that_left_when_its_measurement_was_taken(
    monkeypatch, delay
):
    """The queue holds the commands since: the oldest acts on what is measured, the
    newest was sent a period ago.
    """
    controller = make_controller(
        "ct_ladder", MODEL, steps=room.OBSERVER, delay_periods=delay
    )
    sent = tuple(
        Command(rotor_speeds=(400.0 + 10.0 * k,) * 4, efforts=(0.01 * k, 0.0))
        for k in range(delay + 1)
    )
    memory = dataclasses.replace(controller.memory, sent=sent)
    told = []
    observe = room.observe_uncompensated

    def recorded(model, gains, before, measurement, acted, *rest):
        told.append(acted)
        return observe(model, gains, before, measurement, acted, *rest)

    monkeypatch.setattr(room, "observe_uncompensated", recorded)
    following, command = controller.law(
        memory, measured(gentle(1)), SAMPLE, DT, par=controller.par
    )
    assert told == [sent[0]]
    assert following.sent == (*sent[1:], command)
