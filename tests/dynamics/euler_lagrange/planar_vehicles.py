"""A vehicle whose arm moves in a plane, and quaternions of its Euler angles."""

from __future__ import annotations

import numpy as np

from skyarm.algebra import Sym3, Vec3
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.vehicle_records import Frame, Vehicle


def planar_vehicle(tip=0.01, rod=None):
    inertia = rod or Sym3(0, 7.5e-5, 0)
    link = Body(mass=0.04, com=Vec3(0, 0, -0.075), inertia=inertia, planar=True)
    vehicle = Vehicle(
        name="planar",
        base=Body(mass=0.716, inertia=Sym3(7e-3, 7e-3, 1.2e-2)),
        links=(
            Link(name="upper", parent=BASE, joint=Joint(name="shoulder"), body=link),
            Link(
                name="lower",
                parent=0,
                joint=Joint(name="elbow", position=Vec3(0, 0, -0.15)),
                body=link,
            ),
        ),
        frames=(Frame(name="tip", link=1, position=Vec3(0, 0, -0.15)),),
        end_effector="tip",
    )
    return vehicle.with_payload(tip)


def quaternion_wxyz(q):
    half = 0.5 * q[3:6]
    (a, b, c), (sa, sb, sc) = np.cos(half), np.sin(half)
    return np.array(
        [
            a * b * c + sa * sb * sc,
            sa * b * c - a * sb * sc,
            a * sb * c + sa * b * sc,
            a * b * sc - sa * sb * c,
        ]
    )
