"""A plant of your own: a point that tilts at once, for laws that are to be tried without rotors' lag."""

import skyarm
from skyarm.plant.compiled import RigidBodyPlant


@skyarm.register.plant("instant_rotors", title="rigid bodies whose rotors follow at once")
class InstantRotors(RigidBodyPlant):
    """Rotor speeds are the commanded ones from the beginning of each interval on."""

    def advance(self, state, command, around, seconds):
        rotors = len(self.vehicle.rotors)
        return super().advance((*state[:-rotors], *command[:rotors]), command, around, seconds)
