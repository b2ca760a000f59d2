"""Viscous joint friction over a control period, as an inertia that it adds to the joints of a law's model.

With the effort u held for a period h a joint I q'' = u - d q' ends it with q'_1 = e^(-x) q'_0 + (1 - e^(-x)) u / d,
x = d h / I. One step q'_1 = q'_0 + h q'' gives the same if the friction is taken at the time w h of the period,

    (I + w h d) q'' = u - d q'_0,    w = 1 / (1 - e^(-x)) - 1 / x:

the midpoint rule for slow friction, implicit Euler for quick one. With w h d as armature the prediction is stable
whatever the friction, and the inverse dynamics asks for the effort that reaches the rate within the period. Without it
a prediction diverges above x = 2. I is the least that the joint moves, the others free.

Dry friction c tanh(q' / v) that stops a joint within a period acts on the model from the rate c h / I on, where it
would turn the joint round below: v is at least that.

Source: Hairer, Wanner 1996, Solving Ordinary Differential Equations II, IV.3 (exponential fitting).
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from skyarm.algebra import Mat3
from skyarm.control.model import Model
from skyarm.dynamics import mass_matrix

SLOW = 1e-4
"""Decay x within a period below which w is 1/2."""


def with_held_damping(model: Model, period: float) -> Model:
    """Model whose joints have the armature that their damping adds over a control period (s), and calm dry friction."""
    vehicle = model.vehicle
    if not any(float(link.joint.damping) or float(link.joint.coulomb) for link in vehicle.links):
        return model
    M = np.array(mass_matrix(vehicle, Mat3.identity(), (0.0,) * vehicle.n), dtype=float)
    links = []
    for link, mobility in zip(vehicle.links, np.diag(np.linalg.inv(M))[6:], strict=True):
        joint, mobility = link.joint, float(mobility)
        armature = float(joint.armature) + held_damping(float(joint.damping), mobility, period)
        rate = max(float(joint.coulomb_rate), float(joint.coulomb) * mobility * period)
        joint = dataclasses.replace(joint, armature=armature, coulomb_rate=rate)
        links.append(dataclasses.replace(link, joint=joint))
    return dataclasses.replace(model, vehicle=dataclasses.replace(vehicle, links=tuple(links)))


def held_damping(damping: float, mobility: float, period: float) -> float:
    """Armature (kg m^2 or kg) of a joint's damping, from its mobility: acceleration per effort."""
    x = damping * mobility * period
    return damping * period * (0.5 if x < SLOW else -1.0 / math.expm1(-x) - 1.0 / x)
