"""A force of your own: the drag of a ball at the tip, and a drag that comes late.

A force returns wrenches (forces and torques) on any bodies of the vehicle. It acts on
the plant alone; the controller is not told. If only the velocity of the air changes,
write a wind (own_wind.py); a rigid mass is a payload, and touch is contact
(own_world_part.py). help(skyarm.Force) lists more that a force may define: events that
pictures mark, warnings before the flight, limits of the rotor commands.
"""

import math
import tomllib
from dataclasses import dataclass

import skyarm
from skyarm.world.scene import Scene, Shape


@skyarm.register.force("ball")
@dataclass(frozen=True, kw_only=True)
class Ball(skyarm.Force):
    """Drag of a ball at the tip, with the coefficient of a sphere, 0.47."""

    radius: float = 0.05  # m
    density: float = 1.2  # kg/m^3
    # array, label and unit of each number that ``logged`` returns: log.ball_drag,
    # columns of files, panels of ``skyarm plot --kind parts``, now.part("ball_drag")
    columns = tuple(("ball_drag", axis, "N") for axis in "xyz")

    def drag(self, motion):
        tip, link = motion.frame()  # a point in axes of its body, and the body's number
        wind = motion.air_velocity(tip, link) - motion.velocity(tip, link)
        area = math.pi * self.radius * self.radius
        return wind * (0.5 * self.density * 0.47 * area * wind.norm())

    def wrenches(self, memory, t, motion, rotor_speeds):
        """Called at each stage of the integrator. motion describes the vehicle now: see
        help(skyarm.dynamics.point_motion.PointMotion). Forces are in world axes, their
        point in axes of its body; motion.to_world(vector, body) turns a vector. Without
        ``body`` a wrench acts on the base. The result is a tuple: mind the comma.
        """
        tip, link = motion.frame()
        return (skyarm.Wrench(force_W=self.drag(motion), point=tip, body=link),)

    def logged(self, memory, motion):
        """Optional, called each control period: one number for each of ``columns``."""
        return tuple(self.drag(motion))

    def shapes(self, seen):
        """Optional, called after the flight: what films, the studio and path pictures
        draw. seen.place(point, body) is where a point was, (N, 3) in world axes, for
        lines.
        """
        tip = seen.vehicle.frame()
        place = tuple(tip.position)
        ball = Shape("ball", "object", "sphere", tip.link, (self.radius,), place)
        return Scene(attached=(ball,))


@skyarm.register.force("late_drag")
@dataclass(frozen=True, kw_only=True)
class LateDrag(skyarm.Force):
    """A drag that follows the air with a lag: its memory changes within the period."""

    drag: float = 0.05  # N s/m
    lag: float = 0.01  # s
    # the plant integrates the memory with the vehicle's state, by ``slope``; without it
    # ``advance`` returns the next memory once a period, as in own_wind.py
    coupled = True
    # longest stable integration step, s; state it where a stiff force lets flights
    # diverge
    largest_step = property(lambda self: self.lag)

    def start(self, period, draws):
        return (0.0, 0.0, 0.0)  # velocity that the force follows, m/s

    def slope(self, memory, t, motion, rotor_speeds):
        """Time derivative of each number of the memory."""
        air = motion.air_velocity(*motion.frame())
        pairs = zip(air, memory, strict=True)
        return tuple((now - past) / self.lag for now, past in pairs)

    def wrenches(self, memory, t, motion, rotor_speeds):
        tip, link = motion.frame()
        force = skyarm.Vec3(*memory) * self.drag
        return (skyarm.Wrench(force_W=force, point=tip, body=link),)


FLIGHT = """
schema = 1
name = "windy_ball"
duration = 20.0
plant = { vehicle = "hummingbird_arm2_rotors" }
model = { vehicle = "hummingbird_arm2" }
controller = { preset = "paper_ct" }
reference = { base = { kind = "hover", position = [0.0, 0.0, 1.0] } }

[environment]
wind = { mode = "moving_air", velocity = [5.0, 0.0, 0.0] }
forces = [{ kind = "ball", radius = 0.1 }]
"""


def bent(table):
    """The flight of a table, and how far its arm is bent at the end, rad."""
    log = skyarm.run(skyarm.scenario_from(table))
    return log, math.hypot(*(log.joints[-1] - log.joints_reference[-1]))


if __name__ == "__main__":
    windy = tomllib.loads(FLIGHT)
    log, angle = bent(windy)
    drag = log.ball_drag[-1, 0]
    # the formula says 0.5 * 1.2 * 0.47 * pi * 0.1**2 * 5**2 = 0.2215
    print(f"{drag:.4f} N, joints {angle:.2f} rad off")  # 0.2215 N, joints 0.46 rad off
    windy["environment"]["forces"] = [{"kind": "late_drag", "drag": 0.2215 / 5}]
    # the same force in the end, so the same angle
    print(f"late drag: {bent(windy)[1]:.2f} rad")  # late drag: 0.46 rad
    windy["environment"]["forces"] = []
    print(f"without: {bent(windy)[1]:.2f} rad")  # without: 0.08 rad
