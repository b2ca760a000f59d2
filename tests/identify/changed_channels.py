"""Channels of a flight that no vehicle flies, and changes of them."""

from __future__ import annotations

import dataclasses

import numpy as np

import skyarm
from skyarm.flight_data.flight_data import Channel, FlightData

VEHICLE = skyarm.load_vehicle("hummingbird_arm2_rotors")
ARM = [link.joint.name for link in VEHICLE.links]


def unit(rows):
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def made(seconds=8.0, rate=100.0):
    """Channels of smooth random motion, which no vehicle flies, at the lift of a
    hover.
    """
    draw, time = np.random.default_rng(3), np.arange(0.0, seconds, 1.0 / rate)

    def smooth(width, size=1.0):
        waves = [
            np.sin(
                draw.uniform(1.0, 4.0, width) * time[:, None]
                + draw.uniform(0, 6, width)
            )
            for _ in range(3)
        ]
        return size * sum(waves) + 0.01 * draw.normal(size=(len(time), width))

    hover = np.sqrt(9.81 * VEHICLE.mass / 4.0 / VEHICLE.rotors[0].thrust_coefficient)
    rows = {
        "gyro": smooth(3),
        "accelerometer": smooth(3, 0.5) + np.array([0.0, 0.0, 9.81]),
        "position": smooth(3),
        "velocity": smooth(3),
        "quaternion": unit(smooth(4, 0.1) + np.array([1.0, 0.0, 0.0, 0.0])),
        "rotor_speed_commands": smooth(4, 5.0) + hover,
        "joint_positions": smooth(2, 0.3),
        "joint_rates": smooth(2),
        "joint_efforts": smooth(2, 0.1),
    }
    channels = {
        name: Channel(time=time, values=each, source=name)
        for name, each in rows.items()
    }
    return FlightData(name="flight", file="flight.csv", channels=channels)


SOUND = made()


def rows_of(name, values):
    return lambda flight: flight.with_channels(
        {name: dataclasses.replace(flight[name], values=values(flight[name].values))}
    )


def times_of(names, time):
    return lambda flight: flight.with_channels(
        {
            name: dataclasses.replace(flight[name], time=time(flight[name].time))
            for name in names
            if name in flight
        }
    )


def then(*changes):
    def both(flight):
        for each in changes:
            flight = each(flight)
        return flight

    return both


def columns(*order):
    return lambda rows: rows[:, list(order)]


def times(*factors):
    return lambda rows: rows * np.array(factors)


POSE = ("position", "quaternion", "velocity")
DEGREES = 180.0 / np.pi


def same(one, other):
    """True for flights of the same channels; an attitude and its opposite are the
    same.
    """
    if set(one) != set(other):
        return False
    return all(
        np.allclose(one[name].time, other[name].time, atol=1e-9)
        and (
            np.allclose(one[name].values, other[name].values, atol=1e-9)
            or (
                name == "quaternion"
                and np.allclose(one[name].values, -other[name].values, atol=1e-9)
            )
        )
        for name in one
    )
