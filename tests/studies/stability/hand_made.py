"""A double integrator under sampled PD, whose margins are known by hand."""

from __future__ import annotations

import dataclasses

import numpy as np

from skyarm.studies.stability.closed_loop import OpenLoop
from skyarm.studies.stability.loop_channels import (
    COMMANDS,
    MEASUREMENTS,
    LoopChannel,
    single,
)

KP, KD, T = 160.0, 18.0, 0.005


def numbered_channels(
    rotors: int, joints: int, measurements: int
) -> tuple[LoopChannel, ...]:
    """Channels by index, of a loop whose rotors, joints and measurements have no
    names.
    """
    size = rotors + joints
    rows = (
        ("rotor", "rotors", COMMANDS, rotors, size, 0),
        ("joint", "joints", COMMANDS, joints, size, rotors),
        ("measurement", "measured", MEASUREMENTS, measurements, measurements, 0),
    )
    return tuple(
        channel
        for word, group, port, count, length, first in rows
        for channel in single(
            [f"{word} {i + 1}" for i in range(count)], group, port, length, first
        )
    )


def double_integrator(*, delay: float = 0.0, measured_late: int = 0) -> OpenLoop:
    """x = [position, velocity], u = acceleration held from ``late`` on, all in closed
    form.
    """
    lates = np.arange(5) * 0.001
    x_x = np.array([[[1.0, T], [0.0, 1.0]]] * 5)
    new = [[[0.5 * (T - late) ** 2], [T - late]] for late in lates]
    old = [[[0.5 * late**2 + late * (T - late)], [late]] for late in lates]
    nothing = np.zeros((0, 0))
    return OpenLoop(
        period=T,
        rotors=1,
        lates=lates,
        x_x=x_x,
        x_old=np.array(old),
        x_new=np.array(new),
        y_x=np.eye(2),
        y_old=np.zeros((2, 1)),
        m_m=nothing,
        m_y=np.zeros((0, 2)),
        u_m=np.zeros((1, 0)),
        u_y=np.array([[-KP, -KD]]),
        measurement_delay=measured_late,
        command_delay=delay,
        channels=numbered_channels(1, 0, 2),
    )


def coupled(seed=3, channels=3):
    """A stable loop of several channels that act on one another, with a memory in the
    law.
    """
    rng = np.random.default_rng(seed)
    one = double_integrator()
    mixed = np.eye(channels) + 0.35 * rng.normal(size=(channels, channels))
    lates = one.lates

    def each(a):
        return np.kron(np.eye(channels), a)

    return dataclasses.replace(
        one,
        rotors=channels - 1,
        lates=lates,
        x_x=np.array([each(a) for a in one.x_x]),
        x_old=np.array([np.kron(mixed, b) for b in one.x_old]),
        x_new=np.array([np.kron(mixed, b) for b in one.x_new]),
        y_x=each(one.y_x),
        y_old=np.zeros((2 * channels, channels)),
        m_m=0.8 * np.eye(channels),
        m_y=each(np.array([[0.0, 0.2]])),
        u_m=0.5 * each(one.u_y[:, 1:]),
        u_y=each(one.u_y * np.array([1.0, 0.5])),
        command_delay=0.007,
        measurement_delay=1,
        channels=numbered_channels(channels - 1, 1, 2 * channels),
    )
