"""The world of a contact in a MuJoCo model: its surfaces, bodies and mechanisms, and the vehicle's points, as shapes.

Shapes meet in pairs that are named one by one, each with the numbers of its material; nothing else touches. A free
object is a body about its centre of mass, a mechanism one with a single joint whose inertia is the joint's armature.
MuJoCo takes prescribed bodies for standing ones; so a surface that moves is a body too heavy to be pushed, which is set
to its place and speed at every step.

A material becomes numbers of MuJoCo's contact solver with which a contact is as stiff and slides as in our own model.

MuJoCo's contact is a soft constraint. With the impedance d between 0 and 1, the distance r (negative inside), its
velocity v and the mean inverse mass A of both bodies, the force along the normal is f = (a_ref - a_0) / (A + R), where
R = A (1 - d) / d and a_ref = -b v - k r. With both numbers of ``solref`` negative, k = stiffness d / dmax^2 and
b = damping / dmax. Of an impedance near 1, a contact is nearly rigid and its stiffness is in proportion to the mass
that it meets. Of a small one R is all, and the contact is a spring and a damper of

    K = stiffness / (A (1 - d)),    D = damping / (A (1 - d))

at every posture: so d is the least that MuJoCo takes. Friction would be as soft; therefore ``impratio`` makes R smaller
by as much along the surface, and ``solreffriction`` gives the rate at which a slip is stopped.

Source: MuJoCo documentation, Computation, "Constraint model", and Modeling, "Solver parameters"; Todorov 2014.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from skyarm.algebra import Mat3, Vec3
from skyarm.plant.mujoco_model import LEAST, body_name
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world.contact.carrier import Carrier
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.material import Material
from skyarm.world.contact.mechanism import Mechanism
from skyarm.world.contact.plant_contact import PlantContact
from skyarm.world.contact.surface import Surface, rotation_of

IMPEDANCE = 1e-4
"""The least that MuJoCo takes (``mjMINIMP``). What mass and gravity add to the force is of this order."""

SLIP_STIFFER = 1e6
"""``impratio``: how much softer than along the surface a contact is along its normal. A load at half of the cone creeps
by 0.01 mm/s, measured."""

STOPPED = 0.5
"""Share of a slip that sticking friction stops in a step: one would overshoot."""

TOUCHING = 0.1
"""m/s, the speed of touching at which MuJoCo's damper takes as much energy as Hunt's and Crossley's."""


@dataclass(frozen=True, slots=True)
class ContactNumbers:
    """MuJoCo's numbers for a pair of shapes: lists as its own fields."""

    friction: list[float]
    solref: list[float]
    solreffriction: list[float]
    solimp: list[float]


def mean_material(first: Material, second: Material) -> Material:
    """The material between two bodies that touch each other with skins of their own."""
    names = "stiffness", "dissipation", "friction", "bristle_length"
    return Material(**{name: 0.5 * (float(getattr(first, name)) + float(getattr(second, name))) for name in names})


def contact_numbers(material: Material, mobility: float, step: float) -> ContactNumbers:
    """The numbers of a pair.

    Args:
        material: of the contact.
        mobility: A, 1/kg: sum of ``body_invweight0`` of both bodies.
        step: s, of the integration.
    """
    stiffness, friction = float(material.stiffness), float(material.friction)
    scale = mobility * (1.0 - IMPEDANCE)
    damping = damping_of(material, 1.0 / mobility)
    return ContactNumbers(
        friction=[friction, friction, 0.0, 0.0, 0.0],
        solref=[-stiffness * scale, -damping * scale],
        # a distance along the surface is always 0: the stiffness is of no effect, but must be below 0
        solreffriction=[-1.0, -STOPPED / step * IMPEDANCE],
        solimp=_constant(IMPEDANCE),
    )


def damping_of(material: Material, mass: float) -> float:
    """N s/m of a linear damper parallel to the contact's spring with the material's restitution.

    A Hunt-Crossley contact with the dissipation c leaves 1 - 2/3 c v of the speed v, a spring and damper with the
    damping ratio z leave exp(-pi z).
    """
    left = max(1.0 - 2.0 / 3.0 * float(material.dissipation) * TOUCHING, 0.05)
    return -2.0 * math.log(left) / math.pi * math.sqrt(float(material.stiffness) * mass)


def _constant(impedance: float) -> list[float]:
    """``solimp`` of an impedance that does not change with the depth."""
    width, middle, power = 0.001, 0.5, 2.0
    return [impedance, impedance, width, middle, power]


def mobility_of(inverse_weights: Sequence[Sequence[float]], bodies: Sequence[int]) -> float:
    """Mean inverse mass (1/kg) of a contact between bodies, as MuJoCo takes it from the first configuration."""
    return float(sum(inverse_weights[body][0] for body in bodies))


POINT = 1e-6
"""m, radius of a point's sphere: MuJoCo has no shape without a size."""

UNMOVED = 1e6
"""kg of a surface that moves by its signals: what presses on it with 10 N changes its speed by 1e-8 m/s in a step."""

PATCH, THICK = 200.0, 10.0
"""m: width and thickness of a plane that moves, which MuJoCo only has at rest; it is a box."""

SHAPES = {
    "plane": mujoco.mjtGeom.mjGEOM_PLANE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
}
"""MuJoCo's own of each shape of a surface."""


@dataclass(frozen=True, slots=True)
class WorldPlaces:
    """Addresses of the world's numbers in a compiled model.

    Attributes:
        shapes: number of MuJoCo's shape of each point of the vehicle; surfaces likewise, those of the world first.
        positions, velocities: addresses of the bodies' numbers in qpos and qvel, body by body in the contact's order.
        moving_positions, moving_velocities: the same of surfaces that move.
    """

    points: tuple[int, ...]
    surfaces: tuple[int, ...]
    positions: tuple[tuple[int, ...], ...]
    velocities: tuple[tuple[int, ...], ...]
    moving_positions: tuple[int, ...]
    moving_velocities: tuple[int, ...]


class WorldBuilder:
    """Adds the world of a contact to a vehicle's specification.

    Args:
        spec: of :func:`skyarm.plant.mujoco_model.build_spec`. vehicle: its. contact: the world.
    """

    def __init__(self, spec: Any, vehicle: Vehicle, contact: PlantContact) -> None:
        self._spec, self._contact = spec, contact
        self._enable()
        bodies = {body.name: body for body in spec.bodies}
        self._points = [self._add_point(bodies, vehicle, i) for i in range(len(contact.points))]
        self._moving: list[Any] = []
        self._surfaces = [self._add_surface(surface) for surface in contact.surfaces]
        self._joints: list[Any] = []
        self._skins = [self._add_carrier(carrier) for carrier in contact.carriers]
        self._pairs = [
            (spec.add_pair(geomname1=a.name, geomname2=b.name, condim=3), a, b, material)
            for a, b, material in self._meetings()
        ]

    def _enable(self) -> None:
        """Contacts with elliptic cones; damping by MuJoCo's joints and its reset of a diverged state stay off."""
        off, option = mujoco.mjtDisableBit, self._spec.option
        option.disableflags = int(off.mjDSBL_EULERDAMP | off.mjDSBL_AUTORESET)
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, SLIP_STIFFER

    def compile(self, step: float) -> tuple[Any, WorldPlaces]:
        """The model for a step (s) of the integration, and the addresses of the world's numbers in it."""
        model = self._spec.compile()
        for pair, a, b, material in self._pairs:
            owners = [int(model.geom_bodyid[each.id]) for each in (a, b)]
            numbers = contact_numbers(material, mobility_of(model.body_invweight0, owners), step)
            i = pair.id
            model.pair_friction[i], model.pair_solref[i] = numbers.friction, numbers.solref
            model.pair_solreffriction[i], model.pair_solimp[i] = numbers.solreffriction, numbers.solimp
        joints = [_addresses(model, joint) for joint in self._joints]
        moving = [_addresses(model, joint) for joint in self._moving]
        skins = [geom.id for geom in (*self._surfaces, *(each for skin in self._skins for each in skin))]
        return model, WorldPlaces(
            points=tuple(geom.id for geom in self._points),
            surfaces=tuple(skins),
            positions=tuple(at for at, _ in joints),
            velocities=tuple(at for _, at in joints),
            moving_positions=tuple(i for at, _ in moving for i in at),
            moving_velocities=tuple(i for _, at in moving for i in at),
        )

    def _meetings(self) -> Iterator[tuple[Any, Any, Material]]:
        """Shapes that may touch, and what is between them: the material of the skin that is touched.

        Points meet every skin, free objects the world's surfaces, mechanisms, and each other.
        """
        contact, count = self._contact, len(self._contact.objects)
        carried = list(zip(contact.carriers, self._skins, strict=True))
        for surface, geom in zip(contact.surfaces, self._surfaces, strict=True):
            for other in (*self._points, *(skin[0] for skin in self._skins[:count])):
                yield other, geom, surface.material
        for i, (carrier, skin) in enumerate(carried):
            for surface, geom in zip(carrier.surfaces, skin, strict=True):
                for point in self._points:
                    yield point, geom, surface.material
                for j, (other, shapes) in enumerate(carried[:count]):
                    if i >= count:
                        yield shapes[0], geom, surface.material
                    elif j < i:
                        yield shapes[0], geom, mean_material(surface.material, other.surfaces[0].material)

    def _add_point(self, bodies: dict[str, Any], vehicle: Vehicle, index: int) -> Any:
        point = self._contact.points[index]
        place, body = point.place(vehicle)
        return bodies[body_name(vehicle, body)].add_geom(
            name=f"point {index}", type=SHAPES["sphere"], size=[max(float(point.radius), POINT), 0.0, 0.0],
            pos=_array(place), contype=0, conaffinity=0, group=3,
        )  # fmt: skip

    def _add_surface(self, surface: Surface) -> Any:
        """A surface of the world: a shape of its own, or of a body with three slides."""
        name, host = f"surface {surface.name}", self._spec.worldbody
        if not surface.moves:
            return _add_shape(host, name, surface, surface.position)
        body = _add_body(host, surface.position)
        body.mass, body.inertia, body.gravcomp = UNMOVED, np.full(3, UNMOVED), 1.0
        slide = mujoco.mjtJoint.mjJNT_SLIDE
        self._moving += [body.add_joint(type=slide, axis=axis) for axis in np.eye(3)]
        if surface.shape != "plane":
            return _add_shape(body, name, surface, Vec3(0, 0, 0))
        patch = Surface(name=name, shape="box", size=(PATCH, PATCH, THICK), angles=surface.angles)
        return _add_shape(body, name, patch, surface.rotation.column(2) * (-0.5 * THICK))

    def _add_carrier(self, carrier: Carrier) -> list[Any]:
        """A body that moves in the world; its shapes."""
        host = self._spec.worldbody
        if isinstance(carrier, FreeObject):
            body, (skin,) = _add_body(host, carrier.position), carrier.surfaces
            body.mass, body.inertia = float(carrier.mass), _array(carrier.moments)
            self._joints.append(body.add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE))
            return [_add_shape(body, f"object {carrier.name}", skin, -carrier.com)]
        assert isinstance(carrier, Mechanism)
        mechanism = carrier
        body = _add_body(host, mechanism.position)
        body.quat = _quaternion(rotation_of(mechanism.angles))
        body.mass, body.inertia = LEAST, np.full(3, LEAST)
        body.ipos = _array(_lever(mechanism))
        kind = mujoco.mjtJoint.mjJNT_HINGE if mechanism.turns else mujoco.mjtJoint.mjJNT_SLIDE
        axis = _array(mechanism.along)
        self._joints.append(body.add_joint(type=kind, axis=axis, armature=float(mechanism.generalized_inertia)))
        found = enumerate(mechanism.surfaces)
        return [_add_shape(body, f"mechanism {mechanism.name} {i}", each, each.position) for i, each in found]


def _lever(mechanism: Mechanism) -> Vec3:
    """A place (m, its own axes) as far from a hinge's axis as its farthest: MuJoCo takes a body's mobility there."""
    if not mechanism.turns:
        return Vec3(0, 0, 0)
    along = mechanism.along
    first = Vec3(*(1.0 if i == min(range(3), key=lambda k: abs(float(along[k]))) else 0.0 for i in range(3)))
    across = along.cross(first)
    length = math.sqrt(float(mechanism.mobility * mechanism.generalized_inertia) / float(across.dot(across)))
    place: Vec3 = across * length
    return place


def _addresses(model: Any, joint: Any) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Places of a joint's numbers in qpos and qvel."""
    q, v = int(model.jnt_qposadr[joint.id]), int(model.jnt_dofadr[joint.id])
    free = joint.type == mujoco.mjtJoint.mjJNT_FREE
    return tuple(range(q, q + (7 if free else 1))), tuple(range(v, v + (6 if free else 1)))


def _add_body(host: Any, position: Vec3) -> Any:
    body = host.add_body(pos=_array(position))
    body.explicitinertial = True
    body.ipos, body.iquat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    return body


def _add_shape(body: Any, name: str, surface: Surface, position: Vec3) -> Any:
    """A surface's shape; MuJoCo measures lengths by their halves."""
    size = [float(each) for each in surface.size]
    if surface.shape == "box":
        size = [0.5 * each for each in size]
    elif surface.shape == "cylinder":
        size = [size[0], 0.5 * size[1]]
    elif surface.shape == "plane":
        size = [0.0, 0.0, 1.0]
    return body.add_geom(
        name=name, type=SHAPES[surface.shape], size=[*size, 0.0, 0.0][:3], pos=_array(position),
        quat=_quaternion(surface.rotation), contype=0, conaffinity=0, group=3,
    )  # fmt: skip


def _array(v: Iterable[Any]) -> Any:
    return np.array([float(c) for c in v])


def _quaternion(R: Mat3) -> Any:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray([_array(row) for row in R.rows]).ravel())
    return quaternion
