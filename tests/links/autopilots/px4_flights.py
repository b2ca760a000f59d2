"""Flights under the stand-in for PX4: its program, short scenarios, and the flight of
one.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from skyarm import load_vehicle
from skyarm.control.controller import autopilot_of, innermost, with_innermost
from skyarm.links.autopilots.px4 import PX4
from skyarm.links.autopilots.px4_ports import open_ports
from skyarm.links.transcript import Tape
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import NamedSensor, Scenario
from skyarm.sensing.channel import Channel
from skyarm.sensing.navigation_sensors import Barometer, Gnss, Magnetometer
from skyarm.sensing.sensor_kinds import Imu

STAND_IN = Path(__file__).with_name("stand_in_px4.py")

SCENARIO = """
schema = 1
name = "swing"
duration = {duration}
[plant]
vehicle = "{vehicle}"
[controller]
autopilot = "px4"
[reference.base]
kind = "hover"
position = [0.5, -0.3, 1.5]
[reference.yaw]
kind = "constant"
value = {yaw}
"""


def make_program(folder: Path, fault: str = "") -> Path:
    """Program of the stand-in with a fault, where PX4's would be: with a folder ``etc``
    beside it.
    """
    (folder / "etc").mkdir(parents=True, exist_ok=True)
    program = folder / "px4"
    path = ":".join(part for part in sys.path if part)
    program.write_text(
        f'#!/bin/sh\nexport STAND_IN="{fault}" PYTHONPATH="{path}"\nexec'
        f' {sys.executable} {STAND_IN} "$@"\n',
        "utf-8",
    )
    program.chmod(0o755)
    return program


def scenario_of(
    folder: Path,
    vehicle: str = "hummingbird_arm2_rotors",
    duration: float = 2.0,
    yaw: float = 0.0,
    swing: float = 0.0,
    program: str = "",
    **options: Any,
) -> Scenario:
    """Scenario of a hover under PX4, with options of its record.

    Args:
        swing: frequency (Hz) of a sine of 0.5 rad of the first joint about a lateral
            axis; 0 for none.
    """
    file = folder / "swing.toml"
    text = SCENARIO.format(vehicle=vehicle, duration=duration, yaw=yaw)
    axes = (
        [
            link.joint.axis
            for link in load_vehicle(vehicle).links
            if link.joint is not None
        ]
        if swing
        else []
    )
    moved = next(
        (place for place, axis in enumerate(axes) if abs(float(axis[1])) > 0.9), -1
    )
    for place in range(len(axes)):
        signal = (
            f'kind = "sine"\namplitude = 0.5\nfrequency_hz = {swing}\nstart = 1.0\n'
        )
        text += "[[reference.joints]]\n" + (
            signal if place == moved else 'kind = "constant"\nvalue = 0.0\n'
        )
    lines = "".join(f"{name} = {toml(value)}\n" for name, value in options.items())
    file.write_text(
        text.replace('autopilot = "px4"\n', 'autopilot = "px4"\n' + lines), "utf-8"
    )
    scenario = load_scenario(file)
    par = scenario.controller.par
    own = innermost(par)
    own = dataclasses.replace(
        own, autopilot=dataclasses.replace(own.autopilot, program=program)
    )
    started = with_innermost(par, own)
    return dataclasses.replace(
        scenario, controller=dataclasses.replace(scenario.controller, par=started)
    )


def free_instance() -> int:
    """Number of a PX4 whose ports are free now."""
    ports = open_ports(-1)
    ports.listener.close()
    ports.onboard.close()
    return ports.instance


def toml(value: Any) -> str:
    """Value as it stands in a TOML file."""
    if isinstance(value, dict):
        return (
            "{ "
            + ", ".join(f"{name} = {number}" for name, number in value.items())
            + " }"
        )
    return json.dumps(value)


def record_of(scenario: Scenario) -> PX4:
    """Record of PX4 in a scenario."""
    found: PX4 = autopilot_of(scenario.controller)
    return found


class Fixed(Tape):
    """Tape that gives answers of a function in the program's place, and keeps what was
    sent.
    """

    def __init__(self, answer: Callable[[str], bytes]) -> None:
        super().__init__()
        self.plays, self.sent, self._answer = True, list[tuple[str, bytes]](), answer

    def send(self, channel: str, data: bytes, send: Callable[[bytes], Any]) -> None:
        self.sent.append((channel, data))

    def receive(self, channel: str, receive: Callable[[], bytes]) -> bytes:
        return self._answer(channel)


READINGS = {
    "imu": (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.81),
    "magnetometer": (0.0, 0.215, 0.0, -0.427),
    "barometer": (0.0, 955.0, 11.8),
    "gnss": (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
}
"""Readings of a level vehicle at rest that points north."""


QUIET = (
    NamedSensor(
        name="imu",
        sensor=Imu(
            gyro=Channel(resolution=2**-13), accelerometer=Channel(resolution=2**-10)
        ),
    ),
    NamedSensor(
        name="magnetometer",
        sensor=Magnetometer(field=Channel(sigma=0.001, resolution=2**-9)),
    ),
    NamedSensor(
        name="barometer",
        sensor=Barometer(
            pressure=Channel(sigma=0.012, resolution=2**-6),
            temperature=Channel(resolution=2**-4),
        ),
    ),
    NamedSensor(name="gnss", sensor=Gnss()),
)
"""Sensors whose readings take little room in a transcript: an inertial unit without
noise, and coarse steps."""
