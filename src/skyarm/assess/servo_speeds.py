"""Along a scenario's reference: how fast the servos of the joints would have to turn."""

from __future__ import annotations

import math

import numpy as np

from skyarm.actuation.servo import Servo
from skyarm.assess.arm_poses import Array
from skyarm.assess.finding import FAULT, OK, WARNING, Finding
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.unlikely_numbers import no_load_speed

OFTEN = 0.05
"""Share of the flight in saturation above which the reference cannot be followed."""


def servos(scenario: Scenario) -> list[tuple[int, Servo]]:
    """Indices of the joints with servos, and these."""
    given = {each.joint: each.drive for each in scenario.joint_drives}
    named = [(i, given.get(link.joint.name)) for i, link in enumerate(scenario.world.vehicle.links)]
    return [(i, drive) for i, drive in named if isinstance(drive, Servo)]


def servo_speeds(scenario: Scenario, time: Array, every_rate: Array) -> list[Finding]:
    """Fastest rate that the reference asks of each servo against its own limit and the motor's speed without load.

    Args:
        scenario: whose reference is followed exactly.
        time: (K,) s.
        every_rate: (n, K) of the reference's joints, rad/s or m/s.
    """
    found = []
    for i, servo in servos(scenario):
        joint, top = scenario.world.vehicle.links[i].joint, min(float(servo.speed_limit), no_load_speed(servo))
        if math.isinf(top):
            continue
        rates, unit = np.abs(every_rate[i]), "rad/s" if joint.kind == "revolute" else "m/s"
        k = int(np.argmax(rates))
        late = float(np.mean(rates > top))
        field = f"drives.{joint.name}.speed_limit" if top == servo.speed_limit else f"drives.{joint.name}.voltage"
        level = OK if not late else FAULT if late > OFTEN else WARNING
        asked = f"the reference asks for up to {rates[k]:.3g} {unit} (at {time[k]:.3g} s)"
        text = f"{asked}, the servo turns at {top:.3g}"
        found.append(
            Finding(
                question=f"joints[{joint.name}] servo's speed",
                level=level,
                text=text + (f": too fast for {late:.1%} of the flight" if late else ""),
                field=field,
                value=float(rates[k]),
                limit=top,
                unit=unit,
                remedy="" if level == OK else f"a slower reference, or more of {field}",
            )
        )
    return found
