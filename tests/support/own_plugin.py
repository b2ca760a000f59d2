"""A plugin as a user would write it: every kind of component, a law, a motion, a plant
and a log format.
"""

from __future__ import annotations

from skyarm import register
from skyarm.control.catalogue import make_controller
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.reference import hover
from support import components as own

SKYARM_API = 1

register.air("own_turbulence")(own.Turbulence)
register.air("own_shear")(own.Shear)
register.force("own_push")(own.RandomPush)
register.force("own_tether")(own.Tether)
register.sensor("own_fix")(own.Fix)
register.estimator("own_blend")(own.Blend)
register.drive("own_lag")(own.Lag)
register.ending("own_ceiling")(own.Ceiling)


@register.law("own_law")
def law(model, *, gain: float = 1.0):
    """The paper's law under a name of our own."""
    del gain
    return make_controller("hybrid_computed_torque", model)


@register.motion("own_motion")
def motion(*, height: float = 2.0):
    """Hover at a height."""
    return hover((0.0, 0.0, height))


@register.plant("own_plant")
class OwnPlant(RigidBodyPlant):
    """Our own multibody plant under another name."""


def make(model):
    """A law of a file on the command line."""
    return make_controller("decoupled_pd", model)
