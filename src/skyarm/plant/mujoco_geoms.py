"""MuJoCo's own contacts: surfaces, objects, and points and shapes of vehicles as its
geoms.

Their forces are those of MuJoCo's solver. A contact is a soft constraint as a weld
(:mod:`skyarm.plant.mujoco_welds`): at the least impedance d it is a spring of stiffness
K and a damper D along the normal, with

    solref = (-(1 - d) A K, -(1 - d) A D)

where A is the sum of both bodies' inverse weights. K is that of the material. From a
slow impact of speed v the law of Hunt and Crossley of dissipation c takes the share
2/3 c v of that speed, and a damper of the ratio zeta, up to a few tenths, takes pi
zeta. Both are equal at v = ``SPEED``: D = 2 zeta sqrt(K / A), zeta = 2/3 c ``SPEED`` /
pi, at most 1.

Friction has a reference of its own: slip decays at the rate ``STICK``, as far as the
cone allows. Its regularisation is ``IMPRATIO`` times less than that of the normal
force, so that what sticks creeps by less than 1e-5 m/s under its weight.

Every pair is stated, with numbers of its own: MuJoCo's choice of pairs is off.

Source: Hunt, Crossley 1975; MuJoCo documentation, Computation, "Contact" and
"Parameters", and Modeling, "Solver parameters"; MuJoCo 4.0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import mujoco
import numpy as np

from skyarm.plant.mujoco_model import add_geom, body_name, quaternion_of
from skyarm.plant.mujoco_welds import IMPEDANCE, Welds, closed_contacts
from skyarm.plant.surroundings import Together
from skyarm.records.arrays import float_array
from skyarm.vehicle import BASE, Vehicle
from skyarm.vehicle.vehicle_records import Collision
from skyarm.world.contact.closed_contact import OF_A_POINT, OF_BODIES
from skyarm.world.contact.surface import Surface, heights_of
from skyarm.world.scene.shapes import in_place, solid_shape

SPEED = 0.3
"""Speed (m/s) of the impact that loses as much as on the other plant; chosen. There the
share that is lost goes with the speed, here it is one: an impact at half of it loses
twice the share of the other plant, one at twice it half."""

STICK = 500.0
"""Decay rate (1/s) of the slip of what sticks; a step of 2.5 ms is stable with it."""

IMPRATIO = 1e8
"""Ratio of the regularisation of the normal force to that of friction."""

POINT = 1e-5
"""Radius (m) of the ball that stands for a contact point without one: MuJoCo has no
geom of size 0. A surface seems higher by it, so it is below what anyone measures."""

TOLERANCE = 1e-10
"""Tolerance of MuJoCo's solver, which stops at less than the rounding of forces."""


class Geoms(Welds):
    """Shapes and contacts of a contact model without grasps in a MuJoCo model, with its
    objects.

    Args:
        spec: specification with the vehicles' trees, to which geoms, objects and pairs
            are added.
        vehicles: vehicles of the trees. prefixes: of the names in each tree.
        around: surroundings with such a contact model.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        vehicles: Sequence[Vehicle],
        prefixes: Sequence[str],
        around: Together,
    ) -> None:
        super().__init__(spec, vehicles, prefixes, around)
        # contacts are off in a model without geoms (build_spec)
        spec.option.disableflags -= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio, spec.option.tolerance = IMPRATIO, TOLERANCE
        ((contact, _),) = closed_contacts(around)
        each_tree = [*zip(vehicles, prefixes, strict=True)]
        # an empty name is that of the only vehicle
        trees = dict(zip((*around.names, ""), (*each_tree, each_tree[0]), strict=True))

        def add(agent: str, link: int, shape: Surface | Collision) -> str:
            vehicle, prefix = trees[agent]
            return _add_geom(spec, prefix + body_name(vehicle, link), shape)

        points = []
        for point in contact.points:
            place, link = point.place(trees[point.agent][0])
            size = (max(point.radius, POINT),)
            ball = Surface(name=point.name, shape="sphere", size=size, position=place)
            points.append([add(point.agent, link, ball)])
        placed = [("world", each) for each in contact.surfaces]
        for each in contact.objects:
            skin = replace(each.surfaces[0], position=-each.com)
            placed.append((f"object {each.name}", skin))
        skins = [
            ([_add_geom(spec, body, skin)], skin.material) for body, skin in placed
        ]
        count = len(contact.surfaces)
        shapes = []
        for own in contact.vehicle_bodies:
            every = trees[own.agent][0].shapes
            geoms = [add(own.agent, own.body, every[i]) for i in own.shapes]
            shapes.append((geoms, contact.vehicle_material))
        rows = [(*skin, point, OF_A_POINT) for skin, point in product(skins, points)]
        for i, (geoms, _) in enumerate(skins[count:], count):
            # each two once: an object meets the surfaces and the objects before it; the
            # log has no numbers of them
            rows += [(*skin, geoms, 0) for skin in skins[:i]]
        others = {"surface": skins, "carrier": skins[count:], "body": shapes}
        for pair in contact.body_pairs:
            geoms, _ = shapes[pair.body]
            rows.append((*others[pair.other][pair.index], geoms, OF_BODIES))
        self._logged = dict[frozenset[str | int], slice]()
        first = 0
        for theirs, material, ours, width in rows:
            for both in product(theirs, ours):
                # 3: a force in all directions at each place, and no torque, which
                # several places make
                stated = spec.add_pair(geomname1=both[0], geomname2=both[1], condim=3)
                stated.friction[:2] = material.friction
                stated.solimp[:2] = IMPEDANCE
                # until bind() knows the inverse weights
                stated.solref = -material.stiffness, -material.dissipation
                # slip has no place to go back to
                stated.solreffriction[1] = -STICK * IMPEDANCE
                self._logged[frozenset(both)] = slice(first, first + width)
            first += width

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set the stiffness of the contacts in the compiled model, in whose data the
        other methods work.
        """
        super().bind(model, data)
        self._logged = {
            frozenset(model.geom(each).id for each in both): numbers
            for both, numbers in self._logged.items()
        }
        # A, K, zeta and D as at the head of this module
        bodies = model.geom_bodyid[[model.pair_geom1, model.pair_geom2]]
        A = model.body_invweight0[bodies, 0].sum(axis=0)
        K, c = -model.pair_solref.T
        zeta = np.minimum(2.0 / 3.0 * c * SPEED / math.pi, 1.0)
        K, D = K * A, 2.0 * zeta * np.sqrt(K * A)
        model.pair_solref[:] = -(1.0 - IMPEDANCE) * np.stack([K, D], axis=1)

    def wrenches(self) -> list[float]:
        """Logged numbers of the contacts that MuJoCo has found."""
        numbers = np.zeros(len(self.forces))
        force = np.zeros(6)
        for i, contact in enumerate(self._data.contact):
            mujoco.mj_contactForce(self._model, self._data, i, force)
            own = numbers[self._logged[frozenset(contact.geom.tolist())]]
            # a slice, which may be empty: of two objects nothing is logged
            own[:1] += force[0]
            if len(own) == OF_A_POINT:
                own[1:] += math.hypot(*force[1:3]), -contact.dist
            elif force[0] > 0.0 and len(own):
                # the mean place of the forces so far
                own[1:] += force[0] / own[0] * (contact.pos - own[1:])
        return numbers.tolist()


def _add_geom(spec: mujoco.MjSpec, body: str, shape: Surface | Collision) -> str:
    """Add a shape at its place in the axes of a body; name of the geom."""
    name = f"geom {len(spec.geoms)}"
    if heights := getattr(shape, "heights", ()):
        grid = heights_of(heights)
        x, y, height, base = map(float, shape.size)
        # MuJoCo stretches whatever heights it gets from 0 to 1
        low, rise = height * float(grid.min()), height * float(np.ptp(grid))
        field = spec.add_hfield(
            name=name,
            # a flat field has no rise, and MuJoCo refuses 0: its numbers become zeros,
            # for which any height will do
            size=[0.5 * x, 0.5 * y, rise or height, base + low],
            nrow=grid.shape[0],
            ncol=grid.shape[1],
            userdata=grid.ravel(),
        )
        spec.body(body).add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_HFIELD,
            hfieldname=field.name,
            pos=float_array(shape.position + shape.rotation.column(2) * low),
            quat=quaternion_of(shape.rotation),
            contype=0,
            conaffinity=0,
        )
        return name
    drawn = in_place(solid_shape(shape, "", "", BASE), shape)
    add_geom(spec, spec.body(body), drawn, name=name)
    return name
