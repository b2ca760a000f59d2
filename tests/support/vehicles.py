"""Vehicles and their states: random, written by hand, and those of published flights.

- Random vehicles and states, and the same vehicles as Pinocchio and MuJoCo models:
  oracles that share no code with us.
- Vehicles and states of the plant tests, written by hand.
- Start vehicles of the published flights in tests/data/flights, by data sheets and
  drawings.

Both twins take and give our conventions: generalized velocity [v_W, w_B, joint rates],
force its dual.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import skyarm
from skyarm.algebra import Mat3, Quaternion, Sym3, Vec3
from skyarm.dynamics import State
from skyarm.flight_data.flight_data import load_flight
from skyarm.plant.surroundings import Surroundings
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.vehicle_records import BodyDrag, Frame, Rotor, Vehicle
from skyarm.world import Effectiveness, WindSample

GRAVITY = 9.81


@dataclass(frozen=True)
class RandomState:
    """A state as arrays; ``quaternion`` is wxyz and of unit length."""

    position: np.ndarray
    quaternion: np.ndarray
    joints: np.ndarray
    velocity: np.ndarray

    @property
    def configuration(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.position, self.quaternion, self.joints

    @property
    def all(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        return self.position, self.quaternion, self.joints, self.velocity


def rotation_matrix(quaternion_wxyz: np.ndarray) -> np.ndarray:
    """R_WB by the sandwich product written out by SciPy, not by us."""
    from scipy.spatial.transform import Rotation

    w, x, y, z = quaternion_wxyz
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def random_quaternion(rng: np.random.Generator) -> np.ndarray:
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def random_state(rng: np.random.Generator, joints: int) -> RandomState:
    """Any attitude, joints up to about a turn, rates of a few rad/s."""
    return RandomState(
        position=rng.normal(size=3),
        quaternion=random_quaternion(rng),
        joints=rng.uniform(-np.pi, np.pi, size=joints),
        velocity=2.0 * rng.normal(size=6 + joints),
    )


def random_body(rng: np.random.Generator, *, size: float = 0.2) -> Body:
    """A cloud of six point masses: its inertia is one that a real body can have, with
    products of inertia.
    """
    points, masses = size * rng.normal(size=(6, 3)), rng.uniform(0.05, 0.4, size=6)
    mass = float(masses.sum())
    com = masses @ points / mass
    arms = points - com
    inertia = sum(
        m * (r @ r * np.eye(3) - np.outer(r, r))
        for m, r in zip(masses, arms, strict=True)
    )
    return Body(mass=mass, com=Vec3(*com.tolist()), inertia=_sym3(inertia))


def _sym3(matrix: np.ndarray) -> Sym3:
    m = matrix.tolist()
    return Sym3(m[0][0], m[1][1], m[2][2], m[0][1], m[0][2], m[1][2])


def _random_joint(rng: np.random.Generator, index: int, *, prismatic: bool) -> Joint:
    """An arbitrary joint; one in three has an elementary axis, one in four sits square
    at its parent's origin.
    """
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    if rng.random() < 1 / 3:
        axis = rng.choice([-1.0, 1.0]) * np.eye(3)[rng.integers(3)]
    rotation, position = (
        rotation_matrix(random_quaternion(rng)),
        0.3 * rng.normal(size=3),
    )
    if rng.random() < 1 / 4:
        rotation, position = np.eye(3), np.zeros(3)
    return Joint(
        name=f"joint{index}",
        kind="prismatic" if prismatic and rng.random() < 1 / 3 else "revolute",
        axis=Vec3.from_numbers(axis.tolist()),
        position=Vec3.from_numbers(position.tolist()),
        rotation=Mat3.from_numbers(rotation.tolist()),
    )


def random_vehicle(
    rng: np.random.Generator,
    joints: int,
    *,
    prismatic: bool = True,
    branching: bool = True,
) -> Vehicle:
    """A vehicle with that many joints, and a tilted, offset frame on its base ("eye")
    and on every link ("tip<i>").
    """
    links = []
    for i in range(joints):
        parent = int(rng.integers(BASE, i)) if branching else i - 1
        joint = _random_joint(rng, i, prismatic=prismatic)
        links.append(
            Link(name=f"link{i}", parent=parent, joint=joint, body=random_body(rng))
        )
    frames = [
        _random_frame(rng, "eye", BASE),
        *(_random_frame(rng, f"tip{i}", i) for i in range(joints)),
    ]
    return Vehicle(
        name=f"random{joints}",
        base=random_body(rng, size=0.4),
        links=tuple(links),
        frames=tuple(frames),
        end_effector=frames[-1].name,
    )


def with_armature(vehicle: Vehicle, rng: np.random.Generator) -> Vehicle:
    """The same vehicle with drives whose own inertia is felt at every second joint."""
    links = list(vehicle.links)
    for i in range(0, vehicle.n, 2):
        joint = dataclasses.replace(
            links[i].joint, armature=float(rng.uniform(0.01, 0.3))
        )
        links[i] = dataclasses.replace(links[i], joint=joint)
    return dataclasses.replace(vehicle, links=tuple(links))


def _random_frame(rng: np.random.Generator, name: str, link: int) -> Frame:
    rotation = rotation_matrix(random_quaternion(rng))
    position = 0.3 * rng.normal(size=3)
    return Frame(
        name=name,
        link=link,
        position=Vec3(*position.tolist()),
        rotation=Mat3.from_numbers(rotation.tolist()),
    )


def _depth_first(vehicle: Vehicle, root: int = BASE) -> list[int]:
    children = [i for i, link in enumerate(vehicle.links) if link.parent == root]
    return [
        index for child in children for index in (child, *_depth_first(vehicle, child))
    ]


def array3(v: Vec3) -> np.ndarray:
    return np.array(tuple(v), dtype=float)


def array33(m: Mat3) -> np.ndarray:
    return np.array([tuple(row) for row in m.rows], dtype=float)


def inertia33(body: Body) -> np.ndarray:
    """Inertia about the centre of mass, entry by entry."""
    xx, yy, zz, xy, xz, yz = (float(value) for value in body.inertia.entries)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class PinocchioTwin:
    """The vehicle as a ``pinocchio.Model`` built by hand. Its base velocity is linear
    and angular in *body* axes.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        import pinocchio as pin

        self.pin, self.n = pin, vehicle.n
        model = pin.Model()
        ids = {
            BASE: model.addJoint(
                0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base"
            )
        }
        self._add_body(model, ids[BASE], vehicle.base)
        # Pinocchio's CRBA takes a subtree to be a range of indices
        order = _depth_first(vehicle)
        for i in order:
            link = vehicle.links[i]
            joint, axis = link.joint, array3(link.joint.axis)
            revolute = joint.kind == "revolute"
            kind = (
                pin.JointModelRevoluteUnaligned
                if revolute
                else pin.JointModelPrismaticUnaligned
            )
            placement = pin.SE3(array33(joint.rotation), array3(joint.position))
            ids[i] = model.addJoint(ids[link.parent], kind(axis), placement, joint.name)
            self._add_body(model, ids[i], link.body)
            model.armature[model.idx_vs[ids[i]]] = float(joint.armature)
        for frame in vehicle.frames:
            placement = pin.SE3(array33(frame.rotation), array3(frame.position))
            model.addFrame(
                pin.Frame(
                    frame.name, ids[frame.link], 0, placement, pin.FrameType.OP_FRAME
                )
            )
        self.model, self.data = model, model.createData()
        self.order = np.array([*range(6), *(6 + i for i in order)], dtype=int)

    def _add_body(self, model: Any, joint: int, body: Body) -> None:
        inertia = self.pin.Inertia(float(body.mass), array3(body.com), inertia33(body))
        model.appendBodyToJoint(joint, inertia, self.pin.SE3.Identity())

    def _prepare(
        self, state: RandomState, gravity: float = GRAVITY
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q and v in Pinocchio's conventions, and T with v_pinocchio = T v_ours."""
        self.model.gravity.linear = np.array([0.0, 0.0, -gravity])
        w, x, y, z = state.quaternion
        q = np.concatenate(
            [state.position, [x, y, z, w], state.joints[self.order[6:] - 6]]
        )
        T = np.eye(6 + self.n)
        T[:3, :3] = rotation_matrix(state.quaternion).T
        T = T[self.order]
        return q, T @ state.velocity, T

    def _turning(self, v: np.ndarray) -> np.ndarray:
        """w x v of the base: what separates the derivative of v_B from R^T times the
        derivative of v_W.
        """
        return np.concatenate([np.cross(v[3:6], v[:3]), np.zeros(3 + self.n)])

    def inverse_dynamics(
        self, state: RandomState, acceleration: np.ndarray, gravity: float = GRAVITY
    ) -> np.ndarray:
        q, v, T = self._prepare(state, gravity)
        return T.T @ self.pin.rnea(
            self.model, self.data, q, v, T @ acceleration - self._turning(v)
        )

    def forward_dynamics(
        self, state: RandomState, force: np.ndarray, gravity: float = GRAVITY
    ) -> np.ndarray:
        q, v, T = self._prepare(state, gravity)
        return T.T @ (
            self.pin.aba(self.model, self.data, q, v, T @ force) + self._turning(v)
        )

    def mass_matrix(self, state: RandomState) -> np.ndarray:
        q, _, T = self._prepare(state)
        upper = np.triu(self.pin.crba(self.model, self.data, q))
        return T.T @ (upper + np.triu(upper, 1).T) @ T

    def energy(self, state: RandomState, gravity: float = GRAVITY) -> float:
        q, v, _ = self._prepare(state, gravity)
        # its computeKineticEnergy is of the bodies alone, without the armature that its
        # mass matrix holds
        upper = np.triu(self.pin.crba(self.model, self.data, q))
        kinetic = 0.5 * v @ (upper + np.triu(upper, 1).T) @ v
        return float(
            kinetic + self.pin.computePotentialEnergy(self.model, self.data, q)
        )

    def center_of_mass(self, state: RandomState) -> np.ndarray:
        q, _, _ = self._prepare(state)
        return np.array(self.pin.centerOfMass(self.model, self.data, q))

    def momentum(self, state: RandomState) -> np.ndarray:
        q, v, _ = self._prepare(state)
        found = self.pin.computeCentroidalMomentum(self.model, self.data, q, v)
        return np.concatenate([found.linear, found.angular])

    def frame(
        self, state: RandomState, name: str
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """World position, rotation and Jacobian (linear rows first) of a frame."""
        q, _, T = self._prepare(state)
        index = self.model.getFrameId(name)
        self.pin.computeJointJacobians(self.model, self.data, q)
        self.pin.framesForwardKinematics(self.model, self.data, q)
        aligned = self.pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = self.pin.getFrameJacobian(self.model, self.data, index, aligned)
        pose = self.data.oMf[index]
        return np.array(pose.translation), np.array(pose.rotation), jacobian @ T


class MujocoTwin:
    """The vehicle as a MuJoCo model through ``MjSpec``; a free joint already has our
    generalized velocity.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        import mujoco

        self.mujoco, self.n = mujoco, vehicle.n
        spec = mujoco.MjSpec()
        spec.option.disableflags = (
            mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        )
        spec.option.enableflags = mujoco.mjtEnableBit.mjENBL_ENERGY
        bodies = {BASE: spec.worldbody.add_body(name="base")}
        bodies[BASE].add_freejoint()
        self._fill(bodies[BASE], vehicle.base)
        for i, link in enumerate(vehicle.links):
            joint = link.joint
            quaternion = self._quaternion(array33(joint.rotation))
            body = bodies[link.parent].add_body(
                name=link.name, pos=array3(joint.position), quat=quaternion
            )
            kind = (
                mujoco.mjtJoint.mjJNT_HINGE
                if joint.kind == "revolute"
                else mujoco.mjtJoint.mjJNT_SLIDE
            )
            body.add_joint(
                name=joint.name,
                type=kind,
                axis=array3(joint.axis),
                armature=float(joint.armature),
            )
            self._fill(body, link.body)
            bodies[i] = body
        for frame in vehicle.frames:
            quaternion = self._quaternion(array33(frame.rotation))
            bodies[frame.link].add_site(
                name=frame.name, pos=array3(frame.position), quat=quaternion
            )
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        # MuJoCo numbers joints depth first; ours stand in the order of the links
        joints = [self.model.joint(link.joint.name) for link in vehicle.links]
        self.q_order = np.array([int(j.qposadr[0]) for j in joints], dtype=int)
        self.v_order = np.array(
            [*range(6), *(int(j.dofadr[0]) for j in joints)], dtype=int
        )

    @staticmethod
    def _quaternion(R: np.ndarray) -> np.ndarray:
        from scipy.spatial.transform import Rotation

        x, y, z, w = Rotation.from_matrix(R).as_quat()
        return np.array([w, x, y, z])

    def _fill(self, body: Any, source: Body) -> None:
        moments, axes = np.linalg.eigh(inertia33(source))
        axes[:, 2] *= np.linalg.det(axes)
        body.mass, body.ipos, body.explicitinertial = (
            float(source.mass),
            array3(source.com),
            True,
        )
        body.inertia, body.iquat = moments, self._quaternion(axes)

    def _prepare(self, state: RandomState, gravity: float = GRAVITY) -> Any:
        self.model.opt.gravity[:] = [0.0, 0.0, -gravity]
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:7] = [*state.position, *state.quaternion]
        self.data.qpos[self.q_order] = state.joints
        self.data.qvel[self.v_order] = state.velocity
        return self.data

    def inverse_dynamics(
        self, state: RandomState, acceleration: np.ndarray, gravity: float = GRAVITY
    ) -> np.ndarray:
        data = self._prepare(state, gravity)
        data.qacc[self.v_order] = acceleration
        self.mujoco.mj_inverse(self.model, data)
        return data.qfrc_inverse[self.v_order].copy()

    def forward_dynamics(
        self, state: RandomState, force: np.ndarray, gravity: float = GRAVITY
    ) -> np.ndarray:
        data = self._prepare(state, gravity)
        data.qfrc_applied[self.v_order] = force
        self.mujoco.mj_forward(self.model, data)
        return data.qacc[self.v_order].copy()

    def mass_matrix(self, state: RandomState) -> np.ndarray:
        """Column by column as the inertia force of a unit acceleration: no format of a
        sparse matrix to know.
        """
        data = self._prepare(state)
        self.mujoco.mj_forward(self.model, data)
        columns = np.zeros((6 + self.n, 6 + self.n))
        for i, row in enumerate(np.eye(6 + self.n)):
            self.mujoco.mj_mulM(self.model, data, columns[i], row)
        return columns[np.ix_(self.v_order, self.v_order)]

    def energy(self, state: RandomState, gravity: float = GRAVITY) -> float:
        data = self._prepare(state, gravity)
        self.mujoco.mj_forward(self.model, data)
        return float(data.energy.sum())

    def center_of_mass(self, state: RandomState) -> np.ndarray:
        data = self._prepare(state)
        self.mujoco.mj_forward(self.model, data)
        return data.subtree_com[1].copy()

    def momentum(self, state: RandomState) -> np.ndarray:
        data = self._prepare(state)
        self.mujoco.mj_forward(self.model, data)
        self.mujoco.mj_subtreeVel(self.model, data)
        return np.concatenate(
            [
                data.subtree_linvel[1] * self.model.body_subtreemass[1],
                data.subtree_angmom[1],
            ]
        )

    def frame(
        self, state: RandomState, name: str
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """World position, rotation and Jacobian (linear rows first) of a frame."""
        data = self._prepare(state)
        self.mujoco.mj_forward(self.model, data)
        site = data.site(name)
        linear, angular = np.zeros((3, 6 + self.n)), np.zeros((3, 6 + self.n))
        self.mujoco.mj_jacSite(self.model, data, linear, angular, site.id)
        jacobian = np.vstack([linear, angular])[:, self.v_order]
        return site.xpos.copy(), site.xmat.reshape(3, 3).copy(), jacobian


TWINS: dict[str, Any] = {"pinocchio": PinocchioTwin, "mujoco": MujocoTwin}


HOVER = 485.08
"""rad/s: 0.82103 kg at 9.8 m/s^2."""


def steady_wind(
    *wind: Vec3, effectiveness: Effectiveness | None = None, **named: Vec3
) -> Surroundings:
    """Surroundings that never change: the force and the air of one sample."""
    return Surroundings(
        components=(WindSample(*wind, **named),),
        memories=((),),
        time=0,
        effectiveness=effectiveness,
    )


WIND = steady_wind(Vec3(1.3, -0.7, 0.4), Vec3(0.02, -0.03, 0.05), Vec3(2.0, 1.0, -0.5))


def rotor(name: str, x: float, y: float, direction: int) -> Rotor:
    return Rotor(
        name=name,
        position=Vec3(x, y, 0.01),
        direction=direction,
        thrust_coefficient=8.54858e-6,
        moment_coefficient=0.016,
        drag_coefficient=8.06428e-5,
        rolling_moment_coefficient=1e-6,
        max_speed=838.0,
    )


ROTORS = (
    rotor("front", 0.17, 0.0, -1),
    rotor("left", 0.0, 0.17, 1),
    rotor("back", -0.17, 0.0, -1),
    rotor("right", 0.0, -0.17, 1),
)


def hummingbird_arm(**joint_fields: float) -> Vehicle:
    """0.73103 kg airframe and two links of 0.045 kg; link inertias are those of a rod
    0.02 m thick.
    """
    fields = {"damping": 0.001} | joint_fields
    com = 4 * 0.009 * 0.01 / 0.73103
    steiner = 0.73103 * com * com
    base = Body(
        mass=0.73103,
        com=Vec3(0, 0, com),
        inertia=Sym3(0.0077174 - steiner, 0.0077174 - steiner, 0.0130804),
    )
    limb = Body(mass=0.045, com=Vec3(0, 0, -0.075), inertia=Sym3(8.6e-5, 8.6e-5, 3e-6))
    shoulder = Joint(name="shoulder", position=Vec3(0, 0, -0.05), **fields)
    elbow = Joint(name="elbow", position=Vec3(0, 0, -0.15), **fields)
    return Vehicle(
        name="hummingbird_arm",
        base=base,
        links=(
            Link(name="upper", parent=BASE, joint=shoulder, body=limb),
            Link(name="lower", parent=0, joint=elbow, body=limb),
        ),
        rotors=ROTORS,
        frames=(Frame(name="tip", link=1, position=Vec3(0, 0, -0.15)),),
        end_effector="tip",
    )


def random_flyer(seed: int, joints: int) -> Vehicle:
    """Any tree of joints with friction and limits under four tilted rotors, with body
    drag.
    """
    rng = np.random.default_rng([7, seed, joints])
    vehicle = random_vehicle(rng, joints)
    links = tuple(
        dataclasses.replace(
            link,
            joint=dataclasses.replace(
                link.joint,
                damping=0.02,
                coulomb=0.01,
                coulomb_rate=0.5,
                effort_limit=float(rng.uniform(0.05, 0.5)),
            ),
        )
        for link in vehicle.links
    )
    tilts = rng.normal(size=(4, 3)) * 0.2 + np.array([0.0, 0.0, 1.0])
    rotors = tuple(
        dataclasses.replace(each, axis=Vec3(*(tilt / np.linalg.norm(tilt)).tolist()))
        for each, tilt in zip(ROTORS, tilts, strict=True)
    )
    drag = BodyDrag(area=Vec3(0.01, 0.02, 0.03))
    return dataclasses.replace(vehicle, links=links, rotors=rotors, drag=drag)


def hovering(vehicle: Vehicle) -> State:
    """Level, arm bent and moving."""
    return State(
        position=Vec3(0.1, -0.2, 1.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=tuple(0.4 - 0.3 * i for i in range(vehicle.n)),
        joint_rates=tuple(0.5 + 0.2 * i for i in range(vehicle.n)),
        rotor_speeds=(HOVER,) * len(vehicle.rotors),
    )


def tumbling(vehicle: Vehicle, seed: int = 1) -> State:
    """Any attitude, several rad/s about every axis, joints whirling."""
    rng = np.random.default_rng([11, seed])
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    rate = rng.normal(size=3)
    rate *= 4.0 / np.linalg.norm(rate)
    return State(
        position=Vec3(*rng.normal(size=3).tolist()),
        quaternion=Quaternion(*q.tolist()),
        velocity=Vec3(*rng.normal(size=3).tolist()),
        rate=Vec3(*rate.tolist()),
        joints=tuple(rng.uniform(-3.0, 3.0, size=vehicle.n).tolist()),
        joint_rates=tuple(
            (6.0 if link.joint.kind == "revolute" else 0.3) * float(sign)
            for link, sign in zip(
                vehicle.links, rng.choice([-1.0, 1.0], size=vehicle.n), strict=True
            )
        ),
        rotor_speeds=tuple(
            rng.uniform(100.0, 700.0, size=len(vehicle.rotors)).tolist()
        ),
    )


FLIGHTS = Path(__file__).parents[1] / "data" / "flights"
CRAZYFLIE_LOG = FLIGHTS / "crazyflie" / "log15_from_20_to_23_s"
TREFOIL_LOG = FLIGHTS / "nanobench" / "B9_trefoil_medium_rep4_from_20_to_23_s.csv"
IRIS_LOG = FLIGHTS / "gazebo_iris" / "quadrotor_model_from_20_to_23_s.csv"

CCW, CW = 1, -1


def quadrotor(name, mass, inertia, places, **numbers):
    """Rigid quadrotor with rotors at (x, y, direction)."""
    base = skyarm.load_vehicle("hummingbird")
    one = dataclasses.replace(
        base.rotors[0], drag_coefficient=0.0, rolling_moment_coefficient=0.0, **numbers
    )
    rotors = tuple(
        dataclasses.replace(
            one, name=f"m{i + 1}", position=Vec3(x, y, 0.0), direction=way
        )
        for i, (x, y, way) in enumerate(places)
    )
    xx, yy, zz = inertia
    body = dataclasses.replace(
        base.base, mass=mass, inertia=Sym3(xx, yy, zz, 0.0, 0.0, 0.0)
    )
    return dataclasses.replace(base, name=name, base=body, rotors=rotors)


def crazyflie():
    """Crazyflie 2.1 with markers; motors in the firmware's order, front right first."""
    arm = 0.0325
    return quadrotor(
        "crazyflie",
        0.032,
        (1.6e-5, 1.6e-5, 2.9e-5),
        ((arm, -arm, CCW), (-arm, -arm, CW), (-arm, arm, CCW), (arm, arm, CW)),
        thrust_coefficient=2.9e-8,
        moment_coefficient=0.006,
        time_constant_up=0.03,
        time_constant_down=0.04,
        max_speed=2500.0,
    )


def iris():
    """3DR Iris as PX4's Gazebo has it."""
    return quadrotor(
        "iris",
        1.535,
        (0.029125, 0.029125, 0.055225),
        ((0.13, -0.22, CCW), (-0.13, 0.20, CCW), (0.13, 0.22, CW), (-0.13, -0.20, CW)),
        thrust_coefficient=5.84e-6,
        moment_coefficient=0.06,
        time_constant_up=0.0125,
        time_constant_down=0.025,
        max_speed=1100.0,
    )


def logged(path):
    """A published flight whose file is named flight.csv."""
    return dataclasses.replace(load_flight(path), file="flight.csv")
