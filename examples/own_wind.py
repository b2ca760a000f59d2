"""A wind of your own: turbulence of first order, kind = "gusty" in [[environment.air]].

A wind returns the velocity of the air at a place; the drag of rotors and body makes
forces of it. Steady wind, gusts, Dryden turbulence and measured wind ship with skyarm.

Air moves only what has drag: of most shipped vehicles that is the rotors alone, which
vertical wind does not move, and nothing at all of ``dragonfly``. State ``drag.area`` in
the vehicle file, or write a force (own_force.py), if the vehicle does not move.
"""

import tomllib
from dataclasses import dataclass

import skyarm
from skyarm.algebra.scalars import exp, sqrt


@skyarm.register.air("gusty")
@dataclass(frozen=True, kw_only=True)
class Gusty(skyarm.Air):
    """Three components that wander as Ornstein-Uhlenbeck processes, exact at any
    period.
    """

    # fields are keys of the scenario's table, and sweeps vary them by their path,
    # here environment.air.gusty.sigma
    sigma: float  # standard deviation of each component, m/s
    seconds: float = 1.0  # time constant, s
    # random numbers that each period needs; leave it out where nothing is random
    uniforms = 4

    def start(self, period, draws):
        """Called once. The memory is a tuple of floats; a wind without one has
        ``velocity`` alone. draws holds 2 * uniforms numbers in (0, 1), and normals
        turns an even number of them into normal ones. They depend on seed, episode,
        component and period only, so a flight can be repeated: never use random numbers
        of Python or NumPy.
        """
        return tuple(skyarm.normals(draws)[:3])  # stationary from the first period on

    def advance(self, memory, t, dt, state, draws):
        """Called each control period of dt seconds, which begins at t: the next memory.
        state is the vehicle's then. A memory that changes within the period is a force
        with ``coupled = True``.
        """
        keep = exp(-dt / self.seconds)
        new = sqrt(1.0 - keep * keep)
        normal = skyarm.normals(draws)[:3]
        return tuple(keep * m + new * n for m, n in zip(memory, normal, strict=True))

    def velocity(self, memory, t, position_W):
        """Called at each stage of the integrator: velocity of the air at a place, both
        in world axes. Use position_W for a wind that differs from place to place.
        """
        return skyarm.Vec3(*memory) * self.sigma


# As a file, mine.toml, it also says plugins = { need = ["own_wind.py"] }, and
# skyarm run mine.toml --plugin own_wind.py flies it. One wind may stand under
# [environment.wind], too, with ``mode`` in place of ``kind``.
FLIGHT = """
schema = 1
name = "breezy"
duration = 100.0
plant = { vehicle = "hummingbird_arm2_rotors" }
model = { vehicle = "hummingbird_arm2" }
controller = { preset = "paper_ct" }
reference = { base = { kind = "hover", position = [0.0, 0.0, 1.0] } }
environment = { air = [{ kind = "gusty", sigma = 2.0, seconds = 0.5 }] }
"""

if __name__ == "__main__":
    log = skyarm.run(skyarm.scenario_from(tomllib.loads(FLIGHT)))
    # close to sigma, once the flight lasts some hundred time constants
    print(f"{log.air_velocity[:, 0].std():.2f} m/s along x")  # 2.02 m/s along x
    off = abs(log.position - log.position_reference).max(axis=0)
    print(f"base {100 * off[0]:.0f} cm off at most")  # base 23 cm off at most
