"""A position servo: the joint's setpoint is an angle. kind = "servo" in [plant.drives.JOINT]."""

from dataclasses import dataclass

import skyarm
from skyarm.algebra.scalars import clip


@skyarm.register.drive("servo")
@dataclass(frozen=True, kw_only=True)
class Servo(skyarm.Drive):
    """PID on the angle with a bounded integral; memory is the integral, rad s."""

    stiffness: float = 8.0  # N m/rad
    damping: float = 0.1  # N m s/rad
    integral: float = 20.0  # N m/(rad s)
    most: float = 0.05  # bound of the integral, rad s
    inertia: float = 8e-5  # the least that the joint moves, kg m^2: with it stiffness and damping say how fast
    largest_step = property(lambda s: 1.0 / max((s.stiffness / s.inertia) ** 0.5, s.damping / s.inertia))  # s
    start = staticmethod(lambda position: (0.0,))

    def advance(self, memory, setpoint, position, rate, dt):
        return (clip(memory[0] + (setpoint - position) * dt, -self.most, self.most),)

    def effort(self, memory, setpoint, position, rate):
        return self.stiffness * (setpoint - position) - self.damping * rate + self.integral * memory[0]


@skyarm.register.law("angles")
def make_angles(model: skyarm.Model) -> skyarm.Controller:
    """The paper's baseline for the base; each joint's command is its reference angle."""
    base = skyarm.preset("paper_pd", model)

    def law(memory, measurement, reference, dt, *, par):
        memory, command = base.law(memory, measurement, reference, dt, par=par)
        return memory, skyarm.Command(rotor_speeds=command.rotor_speeds, efforts=reference.joints)

    return skyarm.Controller(name="angles", law=law, par=base.par, memory=base.memory)
