"""Electric energy of the rotors' drag: metrics = ["rotor_energy"] in a study, or skyarm.score(log, ["rotor_energy"])."""

from dataclasses import dataclass

import skyarm


@skyarm.register.metric("rotor_energy", title="work of the rotors' drag torque over the flight, J")
@dataclass(frozen=True, kw_only=True)
class RotorEnergy(skyarm.Metric):
    """Sum of k_m k_f W^3 dt over the rotors, for a quadrotor of these coefficients."""

    thrust_coefficient: float = 8.54858e-6  # N s^2/rad^2, RotorS's Hummingbird
    moment_coefficient: float = 0.016  # m

    def start(self):
        return (0.0,)

    def count(self, memory, now):
        cubes = sum(speed * speed * speed for speed in now.state.rotor_speeds)
        return (memory[0] + self.thrust_coefficient * self.moment_coefficient * cubes,)

    def result(self, memory, instants, period):
        return memory[0] * period
