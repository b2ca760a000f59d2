"""Internal state of the contact model, which a plant integrates together with the
vehicles.
"""

from __future__ import annotations

from typing import Any

from skyarm.algebra import Force, Mat3, Scalar, Scalars, Vec3
from skyarm.records.immutable import immutable
from skyarm.world.contact.gripper import Grip


@immutable
class ContactMemory:
    """Internal state of the contact model: time of moving surfaces, friction bristles,
    movable bodies and grippers.

    Attributes:
        finer: steps in the place of one in this interval; empty where hits take no
            more.
        clock: s, of surfaces that move; empty where none does.
        apart: 1 after an interval in which nothing could touch: then bristles of pairs
            of bodies stand up, whatever is written of them; empty without such pairs.
        bristles: deflection of each pair's bristle, m, world axes, in the order of
            :func:`skyarm.world.contact.meetings.meetings_of`.
        carried: memories of the carriers. grips: memories of the grippers.
        turns: attitudes that fixed grasps keep, from the axes of the body to those of
            the vehicle's frame.
        places: places on their bodies at which grasps with ``close`` have closed, m.
        constraints: force and torque on the body of each grasp that the plant closes;
            empty where grasps are springs.
        touches: logged numbers of each contact whose force the plant finds: normal
            force, friction (N) and penetration (m) of points, normal force and place
            (m) of bodies; else empty.
    """

    finer: Scalars
    clock: Scalars
    apart: Scalars
    bristles: tuple[Vec3, ...]
    carried: tuple[Any, ...] = ()
    grips: tuple[Grip, ...] = ()
    turns: tuple[Mat3, ...] = ()
    places: tuple[Vec3, ...] = ()
    constraints: tuple[Force, ...] = ()
    touches: tuple[Scalars, ...] = ()

    @property
    def time(self) -> Scalar:
        """Time of the world's surfaces, s; 0 where none moves."""
        return (*self.clock, 0.0)[0]
