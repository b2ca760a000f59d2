"""A law of your own, an LQR, flown by: skyarm run case3 --laws own_law.py:make_lqr"""

from dataclasses import dataclass

import skyarm
from skyarm.algebra import E_Z, Motion, Vec3
from skyarm.dynamics import inverse_dynamics


@dataclass(frozen=True, kw_only=True)
class Constants:
    model: skyarm.Model
    mixer: skyarm.Mixer
    base: tuple[float, float]  # 1/s^2, 1/s
    tilt: tuple[float, float] = (180.0, 25.0)
    joints: tuple[float, float] = (200.0, 25.0)


def law(memory, seen, wanted, dt, *, par):
    """Double integrators in position, attitude and joints, coupled by the believed inverse dynamics."""
    R, (kp, kv), (kr, kw), (kq, kd) = seen.quaternion.rotation(), par.base, par.tilt, par.joints
    pull = (wanted.position - seen.position) * kp + (wanted.velocity - seen.velocity) * kv
    push = wanted.acceleration + pull + E_Z * par.model.gravity
    lean = E_Z.cross(R.apply_T(push * (1.0 / push.norm())))
    turn = Vec3(kr * lean.x, kr * lean.y, 4.0 * (0.5 * wanted.yaw - seen.quaternion.z)) - seen.rate * kw
    arm = [kq * (a - b) for a, b in zip(wanted.joints, seen.joints, strict=True)]
    arm = [q + kd * (a - b) for q, a, b in zip(arm, wanted.joint_rates, seen.joint_rates, strict=True)]
    motion = Motion(turn, R.apply_T(push))
    force, torques = inverse_dynamics(par.model.vehicle, seen.joints, seen.rate, seen.joint_rates, motion, arm)
    speeds, _ = skyarm.mix(par.mixer, force.torque, force.force.z)
    return memory, skyarm.Command(rotor_speeds=speeds, efforts=torques)


def make_lqr(model: skyarm.Model, *, weight: float = 16.0) -> skyarm.Controller:
    """Gains that minimise the integral of weight e^2 + v^2 + a^2 along each axis."""
    base = (weight**0.5, (1.0 + 2.0 * weight**0.5) ** 0.5)
    par = Constants(model=model, mixer=skyarm.make_mixer(model.vehicle), base=base)
    return skyarm.Controller(name="lqr", law=law, par=par)
