"""MuJoCo as an oracle: the equations of a vehicle, and a plant with its contacts.

- Oracle of the contact model: a plant on which MuJoCo finds contacts and moves the
  world's bodies.
- Mass matrix and acceleration of a vehicle by MuJoCo, state by state.

Shapes meet in pairs that are named one by one, each with the numbers of its material;
nothing else touches. A free object is a body about its centre of mass, a mechanism one
with a single joint whose inertia is the joint's armature. MuJoCo takes prescribed
bodies for standing ones; so a surface that moves is a body too heavy to be pushed,
which is set to its place and speed at every step.

A material becomes numbers of MuJoCo's contact solver with which a contact is as stiff
and slides as in our own model.

MuJoCo's contact is a soft constraint. With the impedance d between 0 and 1, the
distance r (negative inside), its velocity v and the mean inverse mass A of both bodies,
the force along the normal is f = (a_ref - a_0) / (A + R), where R = A (1 - d) / d and
a_ref = -b v - k r. With both numbers of ``solref`` negative, k = stiffness d / dmax^2
and b = damping / dmax. Of an impedance near 1, a contact is nearly rigid and its
stiffness is in proportion to the mass that it meets. Of a small one R is all, and the
contact is a spring and a damper of

    K = stiffness / (A (1 - d)),    D = damping / (A (1 - d))

at every posture: so d is the least that MuJoCo takes. Friction would be as soft;
therefore ``impratio`` makes R smaller by as much along the surface, and
``solreffriction`` gives the rate at which a slip is stopped.

Source: MuJoCo documentation, Computation, "Constraint model", and Modeling, "Solver
parameters"; Todorov 2014.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Any

import mujoco
import numpy as np

from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.scalars import data, mul
from skyarm.compile.llvm.lane_stepper import Quick
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.interface import Flat, Truth, whole_steps
from skyarm.plant.largest_step import divisions, largest_step
from skyarm.plant.loads import (
    before_euler_step,
    follow_commands,
    with_equivalent_rotors,
)
from skyarm.plant.mujoco import QUIET
from skyarm.plant.mujoco_layout import Layout
from skyarm.plant.mujoco_loads import own_to_mujoco
from skyarm.plant.mujoco_model import LEAST, body_name, build_spec, joint_addresses
from skyarm.plant.surroundings import Surroundings, Together, coupled_places
from skyarm.records.leaves import field_names, leaves
from skyarm.vehicle.vehicle_records import Vehicle, require_plant
from skyarm.world.contact.carrier import Carrier
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.contact_memory import ContactMemory
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.material import Material
from skyarm.world.contact.mechanism import Mechanism
from skyarm.world.contact.meetings import Meeting
from skyarm.world.contact.surface import Surface, rotation_of


@dataclass(frozen=True, kw_only=True, slots=True)
class Felt:
    """Contact of a point of the vehicle at the last control instant, as a plant with an
    own solver found it.

    Attributes:
        force: N, on the point; torque: N m, about it; world axes. normal: N. friction:
            N. depth: m, at least 0.
    """

    force: Vec3
    torque: Vec3
    normal: Any
    friction: Any
    depth: Any

    @property
    def logged(self) -> tuple[Any, ...]:
        """Normal force (N), friction (N) and penetration (m)."""
        return self.normal, self.friction, self.depth


_ZERO = Vec3(0.0, 0.0, 0.0)

UNTOUCHED = Felt(force=_ZERO, torque=_ZERO, normal=0.0, friction=0.0, depth=0.0)
"""Of a point that touches nothing."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FeltMemory(ContactMemory):
    """Memory of a contact, with the contacts of the vehicle's points in the order of a
    log.
    """

    felt: tuple[Felt, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class PlantContact(Contact):
    """The same world, on a plant with contacts of its own."""

    def start(self, period: float, draws: Sequence[Any]) -> FeltMemory:
        """Initial memory of every body, without bristles and touches."""
        alone = replace(Contact.start(self, period, draws), finer=(), bristles=())
        return with_felt(alone, (UNTOUCHED,) * self.logged_pairs)

    def meetings(self, memory: Any, motion: PointMotion) -> list[Meeting]:
        """None of ours: the plant finds them."""
        return []

    def slope(
        self, memory: Any, t: Any, motion: PointMotion, rotor_speeds: Sequence[Any]
    ) -> FeltMemory:
        """Rates of the bodies under grasps and their own efforts alone."""
        rate = Contact.slope(self, memory, t, motion, rotor_speeds)
        return with_felt(rate, tuple(UNTOUCHED for _ in memory.felt))

    def on_points(self, memory: Any, motion: PointMotion) -> Sequence[Felt]:
        """Contacts as the plant found them."""
        found: Sequence[Felt] = memory.felt
        return found

    def without_touches(self, memory: ContactMemory) -> FeltMemory:
        """The memory as if nothing touched: everything but the plant's own contacts
        acts.
        """
        return replace(memory, felt=tuple(UNTOUCHED for _ in memory.felt))

    def efforts(
        self, memory: Any, slope: ContactMemory, motion: PointMotion
    ) -> list[Any]:
        """Generalized forces of grasps on the bodies of the world, one carrier after
        the other.
        """
        pulls = self.on_carriers(memory, motion, (), 0.0)
        rows = zip(self.carriers, memory.carried, slope.carried, pulls, strict=True)
        return [
            data(c)
            for carrier, held, rate, pull in rows
            for c in effort_of(carrier, held, rate, *pull)
        ]


def with_felt(memory: ContactMemory, felt: tuple[Felt, ...]) -> FeltMemory:
    """A memory with these contacts of the vehicle's points."""
    return FeltMemory(
        **{name: getattr(memory, name) for name in field_names(ContactMemory) or ()},
        felt=felt,
    )


def effort_of(
    carrier: Carrier, memory: Any, slope: Any, force_W: Vec3, torque_W: Vec3
) -> tuple[Any, ...]:
    """Generalized force of a grasp on a body that MuJoCo integrates, without weight and
    gyration.
    """
    if isinstance(carrier, Mechanism):
        return (mul(slope.rate, carrier.generalized_inertia),)
    R = memory.attitude.rotation()
    return (*force_W, *R.apply_T(torque_W - R.apply(carrier.com).cross(force_W)))


def plant_contact(contact: Contact) -> PlantContact:
    """The same world for a plant that finds contacts by itself."""
    return PlantContact(
        **{name: getattr(contact, name) for name in field_names(Contact) or ()}
    )


IMPEDANCE = 1e-4
"""The least that MuJoCo takes (``mjMINIMP``). What mass and gravity add to the force is
of this order."""

SLIP_STIFFER = 1e6
"""``impratio``: how much softer than along the surface a contact is along its normal. A
load at half of the cone creeps by 0.01 mm/s, measured."""

STOPPED = 0.5
"""Share of a slip that sticking friction stops in a step: one would overshoot."""

TOUCHING = 0.1
"""m/s, the speed of touching at which MuJoCo's damper takes as much energy as Hunt's
and Crossley's."""


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
    return Material(
        **{
            name: 0.5 * (float(getattr(first, name)) + float(getattr(second, name)))
            for name in names
        }
    )


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
        # a distance along the surface is always 0: the stiffness is of no effect, but
        # must be below 0
        solreffriction=[-1.0, -STOPPED / step * IMPEDANCE],
        solimp=_constant(IMPEDANCE),
    )


def damping_of(material: Material, mass: float) -> float:
    """N s/m of a linear damper parallel to the contact's spring with the material's
    restitution.

    A Hunt-Crossley contact with the dissipation c leaves 1 - 2/3 c v of the speed v, a
    spring and damper with the damping ratio z leave exp(-pi z).
    """
    left = max(1.0 - 2.0 / 3.0 * float(material.dissipation) * TOUCHING, 0.05)
    return -2.0 * math.log(left) / math.pi * math.sqrt(float(material.stiffness) * mass)


def _constant(impedance: float) -> list[float]:
    """``solimp`` of an impedance that does not change with the depth."""
    width, middle, power = 0.001, 0.5, 2.0
    return [impedance, impedance, width, middle, power]


def mobility_of(
    inverse_weights: Sequence[Sequence[float]], bodies: Sequence[int]
) -> float:
    """Mean inverse mass (1/kg) of a contact between bodies, as MuJoCo takes it from the
    first configuration.
    """
    return float(sum(inverse_weights[body][0] for body in bodies))


POINT = 1e-6
"""m, radius of a point's sphere: MuJoCo has no shape without a size."""

UNMOVED = 1e6
"""kg of a surface that moves by its signals: what presses on it with 10 N changes its
speed by 1e-8 m/s in a step."""

PATCH, THICK = 200.0, 10.0
"""m: width and thickness of a plane that moves, which MuJoCo only has at rest; it is a
box."""

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
        shapes: number of MuJoCo's shape of each point of the vehicle; surfaces
            likewise, those of the world first.
        positions, velocities: addresses of the bodies' numbers in qpos and qvel, body
            by body in the contact's order.
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
        spec: of :func:`skyarm.plant.mujoco_model.build_spec`. vehicle: its. contact:
            the world.
    """

    def __init__(self, spec: Any, vehicle: Vehicle, contact: PlantContact) -> None:
        self._spec, self._contact = spec, contact
        self._enable()
        bodies = {body.name: body for body in spec.bodies}
        self._points = [
            self._add_point(bodies, vehicle, i) for i in range(len(contact.points))
        ]
        self._moving: list[Any] = []
        self._surfaces = [self._add_surface(surface) for surface in contact.surfaces]
        self._joints: list[Any] = []
        self._skins = [self._add_carrier(carrier) for carrier in contact.carriers]
        self._pairs = [
            (
                spec.add_pair(geomname1=a.name, geomname2=b.name, condim=3),
                a,
                b,
                material,
            )
            for a, b, material in self._meetings()
        ]

    def _enable(self) -> None:
        """Contacts with elliptic cones; damping by MuJoCo's joints and its reset of a
        diverged state stay off.
        """
        off, option = mujoco.mjtDisableBit, self._spec.option
        option.disableflags = int(off.mjDSBL_EULERDAMP | off.mjDSBL_AUTORESET)
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, SLIP_STIFFER

    def compile(self, step: float) -> tuple[Any, WorldPlaces]:
        """The model for a step (s) of the integration, and the addresses of the world's
        numbers in it.
        """
        model = self._spec.compile()
        for pair, a, b, material in self._pairs:
            owners = [int(model.geom_bodyid[each.id]) for each in (a, b)]
            numbers = contact_numbers(
                material, mobility_of(model.body_invweight0, owners), step
            )
            i = pair.id
            model.pair_friction[i], model.pair_solref[i] = (
                numbers.friction,
                numbers.solref,
            )
            model.pair_solreffriction[i], model.pair_solimp[i] = (
                numbers.solreffriction,
                numbers.solimp,
            )
        joints = [_addresses(model, joint) for joint in self._joints]
        moving = [_addresses(model, joint) for joint in self._moving]
        skins = [
            geom.id
            for geom in (
                *self._surfaces,
                *(each for skin in self._skins for each in skin),
            )
        ]
        return model, WorldPlaces(
            points=tuple(geom.id for geom in self._points),
            surfaces=tuple(skins),
            positions=tuple(at for at, _ in joints),
            velocities=tuple(at for _, at in joints),
            moving_positions=tuple(i for at, _ in moving for i in at),
            moving_velocities=tuple(i for _, at in moving for i in at),
        )

    def _meetings(self) -> Iterator[tuple[Any, Any, Material]]:
        """Shapes that may touch, and what is between them: the material of the skin
        that is touched.

        Points meet every skin, free objects the world's surfaces, mechanisms, and each
        other.
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
                        yield (
                            shapes[0],
                            geom,
                            mean_material(surface.material, other.surfaces[0].material),
                        )

    def _add_point(self, bodies: dict[str, Any], vehicle: Vehicle, index: int) -> Any:
        point = self._contact.points[index]
        place, body = point.place(vehicle)
        return bodies[body_name(vehicle, body)].add_geom(
            name=f"point {index}",
            type=SHAPES["sphere"],
            size=[max(float(point.radius), POINT), 0.0, 0.0],
            pos=_array(place),
            contype=0,
            conaffinity=0,
            group=3,
        )

    def _add_surface(self, surface: Surface) -> Any:
        """A surface of the world: a shape of its own, or of a body with three
        slides.
        """
        name, host = f"surface {surface.name}", self._spec.worldbody
        if not surface.moves:
            return _add_shape(host, name, surface, surface.position)
        body = _add_body(host, surface.position)
        body.mass, body.inertia, body.gravcomp = UNMOVED, np.full(3, UNMOVED), 1.0
        slide = mujoco.mjtJoint.mjJNT_SLIDE
        self._moving += [body.add_joint(type=slide, axis=axis) for axis in np.eye(3)]
        if surface.shape != "plane":
            return _add_shape(body, name, surface, Vec3(0, 0, 0))
        patch = Surface(
            name=name, shape="box", size=(PATCH, PATCH, THICK), angles=surface.angles
        )
        return _add_shape(
            body, name, patch, surface.rotation.column(2) * (-0.5 * THICK)
        )

    def _add_carrier(self, carrier: Carrier) -> list[Any]:
        """A body that moves in the world; its shapes."""
        host = self._spec.worldbody
        if isinstance(carrier, FreeObject):
            body, (skin,) = _add_body(host, carrier.position), carrier.surfaces
            body.mass, body.inertia = float(carrier.mass), _array(carrier.moments)
            self._joints.append(
                body.add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)
            )
            return [_add_shape(body, f"object {carrier.name}", skin, -carrier.com)]
        assert isinstance(carrier, Mechanism)
        mechanism = carrier
        body = _add_body(host, mechanism.position)
        body.quat = _quaternion(rotation_of(mechanism.angles))
        body.mass, body.inertia = LEAST, np.full(3, LEAST)
        body.ipos = _array(_lever(mechanism))
        kind = (
            mujoco.mjtJoint.mjJNT_HINGE
            if mechanism.turns
            else mujoco.mjtJoint.mjJNT_SLIDE
        )
        axis = _array(mechanism.along)
        self._joints.append(
            body.add_joint(
                type=kind, axis=axis, armature=float(mechanism.generalized_inertia)
            )
        )
        found = enumerate(mechanism.surfaces)
        return [
            _add_shape(body, f"mechanism {mechanism.name} {i}", each, each.position)
            for i, each in found
        ]


def _lever(mechanism: Mechanism) -> Vec3:
    """A place (m, its own axes) as far from a hinge's axis as its farthest: MuJoCo
    takes a body's mobility there.
    """
    if not mechanism.turns:
        return Vec3(0, 0, 0)
    along = mechanism.along
    first = Vec3(
        *(
            1.0 if i == min(range(3), key=lambda k: abs(float(along[k]))) else 0.0
            for i in range(3)
        )
    )
    across = along.cross(first)
    length = math.sqrt(
        float(mechanism.mobility * mechanism.generalized_inertia)
        / float(across.dot(across))
    )
    place: Vec3 = across * length
    return place


def _addresses(model: Any, joint: Any) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Places of a joint's numbers in qpos and qvel."""
    q, v = int(model.jnt_qposadr[joint.id]), int(model.jnt_dofadr[joint.id])
    free = joint.type == mujoco.mjtJoint.mjJNT_FREE
    return tuple(range(q, q + (7 if free else 1))), tuple(
        range(v, v + (6 if free else 1))
    )


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
        name=name,
        type=SHAPES[surface.shape],
        size=[*size, 0.0, 0.0][:3],
        pos=_array(position),
        quat=_quaternion(surface.rotation),
        contype=0,
        conaffinity=0,
        group=3,
    )


def _array(v: Iterable[Any]) -> Any:
    return np.array([float(c) for c in v])


def _quaternion(R: Mat3) -> Any:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(
        quaternion, np.ascontiguousarray([_array(row) for row in R.rows]).ravel()
    )
    return quaternion


FELT = 9
"""Numbers of a pair: force and torque on the point, normal force, friction, depth."""


class FeltReader:
    """Reads the contacts of MuJoCo's last forward step.

    Args:
        model, data: MuJoCo's. contact: the world. places: where its shapes stand in the
            model.
    """

    def __init__(
        self, model: Any, data: Any, contact: PlantContact, places: WorldPlaces
    ) -> None:
        self._model, self._data = model, data
        self._points = {geom: i for i, geom in enumerate(places.points)}
        self._surfaces = {geom: i for i, geom in enumerate(places.surfaces)}
        # a point is a tiny sphere whose skin touches before it
        self._early = [
            POINT if float(point.radius) < POINT else 0.0 for point in contact.points
        ]
        self._rows = np.zeros((len(places.surfaces) * len(places.points), FELT))

    def read(self) -> Any:
        """Numbers of all pairs of a surface and a point, surface by surface; zeros of
        those that do not touch.
        """
        rows, data = self._rows, self._data
        rows[:] = 0.0
        push = np.zeros(6)
        for i in range(data.ncon):
            contact = data.contact[i]
            first, second = int(contact.geom1), int(contact.geom2)
            geom, other, sense = (
                (first, second, -1.0) if first in self._points else (second, first, 1.0)
            )
            if geom not in self._points or other not in self._surfaces:
                continue  # of two bodies of the world
            mujoco.mj_contactForce(self._model, data, i, push)
            point = self._points[geom]
            force = sense * contact.frame.reshape(3, 3).T @ push[:3]
            torque = np.cross(contact.pos - data.geom_xpos[geom], force)
            depth = max(-float(contact.dist) - self._early[point], 0.0)
            row = rows[self._surfaces[other] * len(self._points) + point]
            row[:] = (*force, *torque, push[0], np.hypot(push[1], push[2]), depth)
        return rows.ravel()


INTEGRATOR = "euler"
"""The only one of this plant."""


class MujocoContactPlant:
    """MuJoCo moves the vehicle and the bodies of the world, and computes their
    contacts.

    Not for two threads at once: each call works in the same MuJoCo data, though nothing
    in it outlives the call.

    Args:
        world: true vehicle and gravity.
        around: surroundings of one period as an example, with one
        :class:`PlantContact`. integrator: "euler".
        physics_step: s; steps are shorter where the surroundings state a largest step.
    """

    def __init__(
        self,
        world: Truth,
        around: Surroundings,
        integrator: str = INTEGRATOR,
        physics_step: float = 0.001,
    ) -> None:
        require_plant(world.vehicle)
        self.vehicle, self._worlds = world.vehicle, (world,)
        together = Together((around,))
        self._place, self._contact = contact_in(together)
        if integrator != INTEGRATOR:
            raise ValueError(f"integrator = {integrator!r}: must be {INTEGRATOR!r}")
        self._step = physics_step / divisions(
            physics_step, largest_step(together, euler=True)
        )
        alone = build_spec(
            world.vehicle,
            float(world.gravity),
            timestep=self._step,
            integrator=INTEGRATOR,
        )
        self._layout = layout = Layout(self._worlds, alone.compile())
        spec = build_spec(
            world.vehicle,
            float(world.gravity),
            timestep=self._step,
            integrator=INTEGRATOR,
        )
        self.model, self._places = WorldBuilder(
            spec, world.vehicle, self._contact
        ).compile(self._step)
        self._data = mujoco.MjData(self.model)
        self._to_base = self._data.xmat[1].reshape(3, 3).T
        self._gravity = self.model.opt.gravity
        self._felt = FeltReader(self.model, self._data, self._contact, self._places)
        self._prepare_program(together, layout)
        self._prepare_memory(together)

    def _prepare_program(self, around: Together, layout: Layout) -> None:
        """The loads as one program, and views of its numbers."""
        n, rotors, tilts = self.vehicle.sizes
        inputs = (0.0,) * layout.end, (0.0,) * rotors, (0.0,) * n, (0.0,) * tilts
        self._program = Quick(self._forces_and_speeds, *inputs, around)
        self._commanded = self._program.inputs[layout.end :][: layout.driven + n]
        self._around = self._program.inputs[layout.end + layout.driven + n :]
        ends = (0, layout.nq, layout.nq + layout.nv, layout.end)
        self._qpos, self._qvel, self._driven = (
            self._program.inputs[a:b] for a, b in pairwise(ends)
        )
        moving, bodies = (
            len(self._places.moving_positions),
            sum(map(len, self._places.velocities)),
        )
        counts = layout.nv, bodies, moving, moving, moving, layout.driven
        cuts = (*accumulate(counts, initial=0), len(self._program.outputs))
        parts = [self._program.outputs[a:b] for a, b in pairwise(cuts)]
        self._pushed, self._on_bodies = parts[:2]
        self._surfaces, self._driven_to, self._remembered = parts[2:5], *parts[5:]

    def _prepare_memory(self, around: Together) -> None:
        """Indices of the bodies' and the contact forces' numbers in the surroundings
        and in MuJoCo's.
        """
        self._coupled = np.array(coupled_places(around), dtype=int)
        memories = around.coupled_memories()
        before = sum(len(leaves(each)) for each in memories[: self._place])
        memory = memories[self._place]
        first = before + len(leaves((memory.finer, memory.clock, memory.bristles)))
        places, velocities = self._places.positions, self._places.velocities
        qpos, qvel = list[int](), list[int]()
        for held, q, v in zip(memory.carried, places, velocities, strict=True):
            qpos += range(first, first + len(q))
            qvel += range(first + len(q), first + len(q) + len(v))
            first += len(leaves(held))
        self._of_qpos, self._of_qvel = self._coupled[qpos], self._coupled[qvel]
        self._at_qpos = np.array([i for at in places for i in at], dtype=int)
        self._at_qvel = np.array([i for at in velocities for i in at], dtype=int)
        self._of_surfaces = np.array(self._places.moving_positions, dtype=int)
        self._at_surfaces = np.array(self._places.moving_velocities, dtype=int)
        start = before + len(leaves(memory)) - FELT * len(memory.felt)
        self._of_felt = self._coupled[start : start + FELT * len(memory.felt)]

    def _forces_and_speeds(
        self, x: Any, commanded: Any, setpoints: Any, angles: Any, around: Any
    ) -> Any:
        """Forces without contacts, the places of moving surfaces, and the results of
        one step without motions.
        """
        states = self._layout.states(x)
        commands = (Command(rotor_speeds=commanded, efforts=setpoints, tilts=angles),)
        around = self._without_touches(around)
        around = before_euler_step(self._worlds, states, around, self._step)
        worlds, (felt,) = with_equivalent_rotors(
            self._worlds, (states,), commands, around, self._step, held=True
        )
        forces = self._layout.generalized_forces(worlds, felt, commands, around)
        motions = around.motions(self._worlds, states)
        slopes = around.slopes(motions)
        memory = around.coupled_memories()[self._place]
        on_bodies = self._contact.efforts(memory, slopes[self._place], motions[0])
        moving = [surface.motion for surface in self._contact.surfaces if surface.moves]
        signals = [
            signal.derivatives(memory.clock[0])
            for at in moving
            for signal in (at.x, at.y, at.z)
        ]
        places, velocities, accelerations = (
            [each[order] for each in signals] for order in range(3)
        )
        (after,) = follow_commands(self._worlds, states, commands, around, self._step)
        turned, leaning = after.rotor_speeds, after.tilts
        memories = leaves(around.after_euler_step(slopes, self._step))
        surfaces = *places, *velocities, *accelerations
        return tuple(
            data(each)
            for each in (*forces, *on_bodies, *surfaces, *turned, *leaning, *memories)
        )

    def _without_touches(self, around: Together) -> Together:
        """The surroundings without what the last period's contacts did."""
        memories = list(around.coupled_memories())
        memories[self._place] = self._contact.without_touches(memories[self._place])
        return around.with_coupled(memories)

    def advance(
        self, state: Flat, command: Flat, around: Flat, seconds: float
    ) -> tuple[float, ...]:
        """State after ``seconds`` (whole physics steps), inputs held, then the coupled
        memories.
        """
        self._set(state, command, around)
        with QUIET:
            for _ in range(whole_steps(seconds, self._step)):
                self._forward()
                mujoco.mj_Euler(self.model, self._data)
                self._read_back()
            self._forward()
            self._around[self._of_felt] = self._felt.read()
        ours: tuple[float, ...] = self._layout.to_ours(
            self._program.inputs[: self._layout.end].tolist()
        )
        return (*ours, *self._around[self._coupled].tolist())

    def _set(self, state: Flat, command: Flat, around: Flat) -> None:
        """Numbers of an instant to where the loads read them, and to MuJoCo's; its
        solver starts afresh.
        """
        x = self._layout.to_mujoco(state)
        self._program.inputs[:] = (*x, *command, *around)
        qpos, qvel = self._data.qpos, self._data.qvel
        qpos[: self._layout.nq], qvel[: self._layout.nv] = self._qpos, self._qvel
        qpos[self._at_qpos], qvel[self._at_qvel] = (
            self._around[self._of_qpos],
            self._around[self._of_qvel],
        )
        self._data.qacc_warmstart[:] = 0.0

    def _forward(self) -> None:
        """MuJoCo's accelerations under the loads of the present numbers."""
        self._program.step()
        data = self._data
        data.qfrc_applied[: self._layout.nv] = self._pushed
        data.qfrc_applied[self._at_qvel] = self._on_bodies
        if len(self._of_surfaces):
            at = self._at_surfaces
            place, velocity, acceleration = self._surfaces
            data.qpos[self._of_surfaces], data.qvel[at] = place, velocity
            data.qfrc_applied[at] = UNMOVED * acceleration
        mujoco.mj_forward(self.model, data)

    def _read_back(self) -> None:
        """Copy the result of a step to the arrays of the loads."""
        layout, qpos, qvel = self._layout, self._data.qpos, self._data.qvel
        self._qpos[:], self._qvel[:], self._driven[:] = (
            qpos[: layout.nq],
            qvel[: layout.nv],
            self._driven_to,
        )
        self._around[self._coupled] = self._remembered
        self._around[self._of_qpos], self._around[self._of_qvel] = (
            qpos[self._at_qpos],
            qvel[self._at_qvel],
        )

    def specific_force(
        self, state: Flat, command: Flat, around: Flat
    ) -> tuple[float, float, float]:
        """Proper acceleration of the base origin, base axes, m/s^2: the free joint's
        acceleration plus g.
        """
        self._set(state, command, around)
        with QUIET:
            self._forward()
        fx, fy, fz = (self._to_base @ (self._data.qacc[:3] - self._gravity)).tolist()
        return fx, fy, fz


def contact_in(around: Together) -> tuple[int, PlantContact]:
    """The contact of the surroundings, and its number among the coupled components.

    Raises:
        ValueError: there is none.
    """
    for place, (_, component, _) in enumerate(around.coupled):
        if isinstance(component, PlantContact):
            return place, component
    raise ValueError(
        "plant.kind = 'mujoco_contacts': must be another without a [world]"
    )


Array = Any


class Equations:
    """Mass matrix and acceleration by MuJoCo; joints that follow others are eliminated
    by their constant ratios.

    Args:
        vehicle: with concrete numbers. gravity: m/s^2.

    Raises:
        ValueError: MuJoCo refuses the vehicle.
    """

    def __init__(self, vehicle: Vehicle, gravity: float) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of masses beyond measure
            self._model = build_spec(vehicle, gravity).compile()
        self._data, self._vehicle = mujoco.MjData(self._model), vehicle
        self._q, self._v = joint_addresses(vehicle, self._model)
        self._G = own_to_mujoco(
            Layout((Truth(vehicle=vehicle, gravity=gravity),), self._model)
        )

    def at(
        self,
        position: Array,
        quaternion: Array,
        joints: Array,
        velocity: Array,
        force: Array,
    ) -> tuple[Array, Array]:
        """Mass matrix (6+n, 6+n) and acceleration (6+n,) at a state, under a
        generalised force (6+n,).

        Conventions are those of :mod:`skyarm.dynamics.array_front`.
        """
        data, model = self._data, self._model
        every: list[Any] = [float(q) for q in joints]
        every += [
            float(f.ratio) * every[f.leader] + float(f.offset)
            for f in self._vehicle.followers
        ]
        data.qpos[:7] = (*position, *quaternion)
        data.qpos[self._q] = every
        data.qvel[:] = self._G @ velocity
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        columns = np.ascontiguousarray(self._G.T)
        moved = np.zeros_like(columns)
        for column, row in zip(columns, moved, strict=True):
            mujoco.mj_mulM(model, data, row, column)
        M = np.asarray(moved @ self._G, dtype=float)
        return M, np.asarray(
            np.linalg.solve(M, force - columns @ data.qfrc_bias), dtype=float
        )
