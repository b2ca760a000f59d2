"""A force on every rotor, ground effect: kind = "near_ground" in [[environment.forces]]."""

from dataclasses import dataclass

import skyarm
from skyarm.algebra.scalars import maximum


@skyarm.register.force("near_ground")
@dataclass(frozen=True, kw_only=True)
class GroundEffect(skyarm.Force):
    """Thrust grows near the ground by 1 / (1 - (radius / (4 h))^2); Cheeseman, Bennett 1955, eq. 5."""

    radius: float  # of a rotor, m

    def wrenches(self, memory, t, motion, rotor_speeds):
        found = []
        for rotor, speed in zip(motion.vehicle.rotors, rotor_speeds, strict=True):
            height = maximum(motion.position(rotor.position).z, 0.5 * self.radius)
            ratio = self.radius / (4.0 * height)
            extra = rotor.thrust_coefficient * (speed * speed) * (1.0 / (1.0 - ratio * ratio) - 1.0)
            found.append(skyarm.Wrench(force_W=motion.rotation.apply(rotor.axis * extra), point=rotor.position))
        return found
