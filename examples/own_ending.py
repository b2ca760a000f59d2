"""An ending of your own: a flight ends when the base leaves a corridor along x.

An ending has one condition, ``fine``, which is true while the flight may go on.
Divergence, joint limits, the ground and contact ship with skyarm.
"""

import tomllib
from dataclasses import dataclass

import skyarm
from skyarm.algebra.scalars import absolute


@skyarm.register.ending("corridor")
@dataclass(frozen=True, kw_only=True)
class Corridor(skyarm.Ending):
    """A base outside a corridor along x."""

    # a key of the scenario's table; sweeps vary endings.corridor.half_width
    half_width: float  # m
    # one word, for the log and the row of a sweep
    status = "left_corridor"

    def fine(self, scenario, state, goal, slack):
        """Called at each control instant, not between them, and compiled: no ``if``,
        ``and`` or ``a < y < b`` on numbers of the flight, but logical_and(a < y, y <
        b), logical_or, logical_not of skyarm.algebra.scalars. State what is allowed, so
        that a NaN ends the flight, too. state is the plant's, with position, velocity
        (m, m/s, world axes), quaternion, rate, joints, joint_rates, rotor_speeds and
        tilts; goal is where the held reference wants the base. slack is 0 in flight;
        after a batch it is small, when the ending of each flight is named: subtract it
        from the limit.
        """
        return absolute(state.position.y) <= self.half_width - slack

    def cause(self, scenario, state, goal):
        """Called once, after the flight: the sentence in log.info["cause"]."""
        return f"y = {state.position.y:.3f} m is outside of {self.half_width:g} m"


# An ending has no memory, so it cannot count or wait. With a class attribute sees = ("wrist",)
# fine gets a further argument images=(), the newest picture of each of these cameras.
# skyarm run narrow.toml --plugin own_ending.py ends with exit code 3 here.
FLIGHT = """
schema = 1
name = "narrow"
duration = 20.0
plant = { vehicle = "hummingbird_arm2_rotors" }
model = { vehicle = "hummingbird_arm2" }
controller = { preset = "paper_ct" }
endings = [{ kind = "corridor", half_width = 0.2 }]

[reference.base]
kind = "circle"
radius = 0.3
frequency_hz = 0.1
center = [0.0, 0.0, 1.0]
"""

if __name__ == "__main__":
    # the circle of 0.3 m leaves the corridor of 0.2 m on each side
    log = skyarm.run(skyarm.scenario_from(tomllib.loads(FLIGHT)))
    print(f"{log.status} at {log.time[-1]:.2f} s")  # left_corridor at 1.24 s
    print(log.info["cause"])  # y = 0.200 m is outside of 0.2 m
