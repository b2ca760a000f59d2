"""A plant of your own: rotors that follow at once, for laws to be tried without lag."""

import tomllib

import skyarm
from skyarm.plant.compiled import RigidBodyPlant


@skyarm.register.plant(
    "instant_rotors", title="rigid bodies whose rotors follow at once"
)
class InstantRotors(RigidBodyPlant):
    """Rotor speeds are the commanded ones from the beginning of each interval on."""

    def advance(self, state, command, around, seconds):
        """The state after some seconds; the rotor speeds are its last numbers."""
        rotors = len(self.vehicle.rotors)
        now = (*state[:-rotors], *command[:rotors])
        return super().advance(now, command, around, seconds)


# A plant is made with (world, around, integrator, physics_step). It also gives
# specific_force and, for a placed imu, angular_acceleration: here as the shipped one.
FLIGHT = """
schema = 1
name = "step"
duration = 4.0
plant = { vehicle = "hummingbird_arm2_rotors", kind = "instant_rotors" }
model = { vehicle = "hummingbird_arm2" }
controller = { preset = "paper_ct" }
reference = { base = { kind = "hover", position = [0.0, 0.0, 1.0] } }
initial = { position = [0.3, 0.0, 1.0] }
"""


def behind(kind):
    """How far the rotors of a plant are behind their commands at most, rad/s."""
    table = tomllib.loads(FLIGHT.replace("instant_rotors", kind))
    log = skyarm.run(skyarm.scenario_from(table))
    # a row holds the speeds before its command acts
    return abs(log.rotor_speeds[1:] - log.rotor_commands[:-1]).max()


if __name__ == "__main__":
    print(f"lagging: {behind('rigid_body'):.1f} rad/s")  # lagging: 44.5 rad/s
    print(f"instant: {behind('instant_rotors'):.1f} rad/s")  # instant: 0.0 rad/s
