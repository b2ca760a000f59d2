"""Joint drives of your own: a motor that loses torque at speed, and a springy servo.

A drive turns a setpoint into the torque of a joint; the joint's own limit, friction and
faults act on what it returns. Servos and a torque with a lag ship with skyarm.
"""

import tomllib
from dataclasses import dataclass

import skyarm
from skyarm.algebra.scalars import clip, exp


@skyarm.register.drive("weak_motor")
@dataclass(frozen=True, kw_only=True)
class WeakMotor(skyarm.Drive):
    """A torque that follows its setpoint with a lag, less at speed; the memory is the
    torque.
    """

    time_constant: float = 0.02  # s
    stall: float = 0.5  # torque at rest, N m
    no_load: float = 20.0  # rate without torque, rad/s
    # Shipped laws command torques. A drive that takes angles, takes = "rad", needs a
    # law that commands angles (servo_drive.py), or ``setpoint``, as Spring below.
    takes = "N m"
    takes_torque = True

    def start(self, position):
        """Called once: the first memory."""
        return (0.0,)

    def advance(self, memory, setpoint, position, rate, dt):
        """Called at the start of each control period of dt seconds: the memory of this
        period. setpoint is the mean over the period.
        """
        keep = exp(-dt / self.time_constant)
        return (keep * memory[0] + (1.0 - keep) * setpoint,)

    def effort(self, memory, setpoint, position, rate):
        """Called several times in the period: torque (N m) or force (N) on the joint at
        its position (rad or m) and rate.
        """
        lost = self.stall * rate / self.no_load
        return clip(memory[0], -self.stall - lost, self.stall - lost)


@skyarm.register.drive("spring")
@dataclass(frozen=True, kw_only=True)
class Spring(skyarm.Drive):
    """A servo that is a spring and a damper towards the angle that it is told."""

    stiffness: float = 2.0  # N m/rad
    damping: float = 0.05  # N m s/rad
    # longest stable integration step, s: the plant divides a longer one
    largest_step = 0.0005
    takes = "rad"

    def effort(self, memory, setpoint, position, rate):
        return self.stiffness * (setpoint - position) - self.damping * rate

    def setpoint(self, memory, effort, position, rate, dt):
        """Inverse of ``effort``: by it, laws that command torques fly this drive."""
        return position + (effort + self.damping * rate) / self.stiffness


# The plant has what [plant.drives] states, and the law does not know of it. Torques
# become setpoints by [model.drives], so an angle drive stands there, too.
# [drives.JOINT] of a vehicle file is both. One drive moves one joint.
FLIGHT = """
schema = 1
name = "weak"
duration = 10.0
model = { vehicle = "hummingbird_arm2" }
controller = { preset = "paper_ct" }

[plant]
vehicle = "hummingbird_arm2_rotors"

[plant.drives]
joint1 = { kind = "weak_motor" }
joint2 = { kind = "weak_motor", time_constant = 0.01 }

[reference]
base = { kind = "hover", position = [0.0, 0.0, 1.0] }
joints = [{ kind = "sine", amplitude = 0.2, frequency_hz = 0.5 }, 0.0]
"""


def joint_error(table):
    """Mean error of the joints, mrad."""
    log = skyarm.run(skyarm.scenario_from(table))
    score = skyarm.score(log, ["joint_error_mean"])
    return 1e3 * score["joint_error_mean"]


if __name__ == "__main__":
    # at half the no-load rate half the stall torque is left
    print(WeakMotor().effort((1.0,), 1.0, 0.0, 10.0), "N m")  # 0.25 N m
    weak = tomllib.loads(FLIGHT)
    print(f"weak motors: {joint_error(weak):.1f} mrad")  # weak motors: 25.9 mrad
    ideal = weak | {"plant": {"vehicle": "hummingbird_arm2_rotors"}}
    print(f"exact torques: {joint_error(ideal):.1f} mrad")  # exact torques: 13.1 mrad
    springs = {name: {"kind": "spring"} for name in ("joint1", "joint2")}
    sprung = {key: weak[key] | {"drives": springs} for key in ("plant", "model")}
    print(f"springs: {joint_error(weak | sprung):.1f} mrad")  # springs: 14.5 mrad
