"""A metric of your own: work of the rotors, metrics = ["rotor_energy"] in a study.

A metric sums up a quantity over the flight, here the work that the rotors do against
their drag torque: a rotor of speed W has the thrust k_f W^2 and the torque k_m k_f W^2.
"""

from dataclasses import dataclass

import skyarm


@skyarm.register.metric("rotor_energy", title="work of the rotors' drag torque, J")
@dataclass(frozen=True, kw_only=True)
class RotorEnergy(skyarm.Metric):
    """Sum of k_m k_f W^3 dt over the rotors of a Hummingbird."""

    # a metric is named without values, so every field has a default; the constants of
    # the vehicle are not in ``now``, so they are fields
    thrust_coefficient: float = 8.54858e-6  # k_f, N s^2/rad^2, RotorS's Hummingbird
    moment_coefficient: float = 0.016  # k_m, m
    words = "work of the rotors' drag torque"  # on axes and in tables
    unit = "J"
    # a property ``window`` would name another interval of [windows], as "steady"

    def start(self):
        """Called once. For a largest value start at -math.inf, and keep
        maximum(memory[0], value) of skyarm.algebra.scalars.
        """
        return (0.0,)

    def count(self, memory, now):
        """Called at each control instant. Numbers may be arrays over episodes that fly
        side by side, so write where(condition, a, b) in place of ``if``. now has time,
        state, the tip as tool, command, the references held and continuous, phase,
        push, limits, and part("NAME"), which a force or another part logs: see
        help(skyarm.log.metrics.metric.MetricInstant).
        """
        cubes = sum(speed * speed * speed for speed in now.state.rotor_speeds)
        power = self.thrust_coefficient * self.moment_coefficient * cubes  # W
        return (memory[0] + power,)

    def result(self, memory, instants, period):
        """Called once, at the end; period is the time between two instants, s. A mean
        divides by instants. NaN says that the flight ended before the window began.
        """
        return memory[0] * period


# In a study: metrics = ["rotor_energy"], plugins = { need = ["own_metric.py"] }, and
# [success] rotor_energy = 650.0 for a limit. skyarm sweep FILE --plugin own_metric.py
# then writes a column of this name, skyarm compare a last column of its table. skyarm
# tune does not use it.
if __name__ == "__main__":
    log = skyarm.run(skyarm.load_scenario("case2", duration=4.0))
    scored = skyarm.score(log, ["rotor_energy"])["rotor_energy"]
    direct = 8.54858e-6 * 0.016 * (log.rotor_speeds**3).sum() * 0.005
    # the same sum, from the arrays of the log and its period of 0.005 s
    print(f"{scored:.4f} J, {direct:.4f} J")  # 249.7910 J, 249.7910 J
