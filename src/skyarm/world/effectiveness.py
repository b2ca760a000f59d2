"""Actuator effectiveness: the remaining fraction of each actuator's force."""

from __future__ import annotations

from skyarm.algebra import Scalars
from skyarm.records.immutable import positional


@positional
class Effectiveness:
    """Remaining fraction of each rotor's thrust and of each joint drive's effort, and
    the stuck joints.

    Attributes:
        rotors: share of thrust, drag torque, hub drag and all else that the air does to
            a rotor, one per rotor.
        joints: share of the drive's effort, one per joint; friction stays.
        stuck: 1 for a joint that is held where it is, one number per joint; empty where
            none can be.
    """

    rotors: Scalars
    joints: Scalars
    stuck: Scalars = ()
