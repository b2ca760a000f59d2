"""Random vehicles and states, and the same vehicles as Pinocchio and MuJoCo models: oracles that share no code with us.

Both twins take and give our conventions: generalized velocity [v_W, w_B, joint rates], force its dual.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.vehicle_records import Frame, Vehicle

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
    """A cloud of six point masses: its inertia is one that a real body can have, with products of inertia."""
    points, masses = size * rng.normal(size=(6, 3)), rng.uniform(0.05, 0.4, size=6)
    mass = float(masses.sum())
    com = masses @ points / mass
    arms = points - com
    inertia = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True))
    return Body(mass=mass, com=Vec3(*com.tolist()), inertia=_sym3(inertia))


def _sym3(matrix: np.ndarray) -> Sym3:
    m = matrix.tolist()
    return Sym3(m[0][0], m[1][1], m[2][2], m[0][1], m[0][2], m[1][2])


def _random_joint(rng: np.random.Generator, index: int, *, prismatic: bool) -> Joint:
    """An arbitrary joint; one in three has an elementary axis, one in four sits square at its parent's origin."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    if rng.random() < 1 / 3:
        axis = rng.choice([-1.0, 1.0]) * np.eye(3)[rng.integers(3)]
    rotation, position = rotation_matrix(random_quaternion(rng)), 0.3 * rng.normal(size=3)
    if rng.random() < 1 / 4:
        rotation, position = np.eye(3), np.zeros(3)
    return Joint(
        name=f"joint{index}",
        kind="prismatic" if prismatic and rng.random() < 1 / 3 else "revolute",
        axis=Vec3.from_numbers(axis.tolist()),
        position=Vec3.from_numbers(position.tolist()),
        rotation=Mat3.from_numbers(rotation.tolist()),
    )


def random_vehicle(rng: np.random.Generator, joints: int, *, prismatic: bool = True, branching: bool = True) -> Vehicle:
    """A vehicle with that many joints, and a tilted, offset frame on its base ("eye") and on every link ("tip<i>")."""
    links = []
    for i in range(joints):
        parent = int(rng.integers(BASE, i)) if branching else i - 1
        joint = _random_joint(rng, i, prismatic=prismatic)
        links.append(Link(name=f"link{i}", parent=parent, joint=joint, body=random_body(rng)))
    frames = [_random_frame(rng, "eye", BASE), *(_random_frame(rng, f"tip{i}", i) for i in range(joints))]
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
        joint = dataclasses.replace(links[i].joint, armature=float(rng.uniform(0.01, 0.3)))
        links[i] = dataclasses.replace(links[i], joint=joint)
    return dataclasses.replace(vehicle, links=tuple(links))


def _random_frame(rng: np.random.Generator, name: str, link: int) -> Frame:
    rotation = rotation_matrix(random_quaternion(rng))
    position = 0.3 * rng.normal(size=3)
    return Frame(name=name, link=link, position=Vec3(*position.tolist()), rotation=Mat3.from_numbers(rotation.tolist()))


def _depth_first(vehicle: Vehicle, root: int = BASE) -> list[int]:
    children = [i for i, link in enumerate(vehicle.links) if link.parent == root]
    return [index for child in children for index in (child, *_depth_first(vehicle, child))]


def array3(v: Vec3) -> np.ndarray:
    return np.array(tuple(v), dtype=float)


def array33(m: Mat3) -> np.ndarray:
    return np.array([tuple(row) for row in m.rows], dtype=float)


def inertia33(body: Body) -> np.ndarray:
    """Inertia about the centre of mass, entry by entry."""
    xx, yy, zz, xy, xz, yz = (float(value) for value in body.inertia.entries)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class PinocchioTwin:
    """The vehicle as a ``pinocchio.Model`` built by hand. Its base velocity is linear and angular in *body* axes."""

    def __init__(self, vehicle: Vehicle) -> None:
        import pinocchio as pin

        self.pin, self.n = pin, vehicle.n
        model = pin.Model()
        ids = {BASE: model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")}
        self._add_body(model, ids[BASE], vehicle.base)
        order = _depth_first(vehicle)  # Pinocchio's CRBA takes a subtree to be a range of indices
        for i in order:
            link = vehicle.links[i]
            joint, axis = link.joint, array3(link.joint.axis)
            revolute = joint.kind == "revolute"
            kind = pin.JointModelRevoluteUnaligned if revolute else pin.JointModelPrismaticUnaligned
            placement = pin.SE3(array33(joint.rotation), array3(joint.position))
            ids[i] = model.addJoint(ids[link.parent], kind(axis), placement, joint.name)
            self._add_body(model, ids[i], link.body)
            model.armature[model.idx_vs[ids[i]]] = float(joint.armature)
        for frame in vehicle.frames:
            placement = pin.SE3(array33(frame.rotation), array3(frame.position))
            model.addFrame(pin.Frame(frame.name, ids[frame.link], 0, placement, pin.FrameType.OP_FRAME))
        self.model, self.data = model, model.createData()
        self.order = np.array([*range(6), *(6 + i for i in order)], dtype=int)

    def _add_body(self, model: Any, joint: int, body: Body) -> None:
        inertia = self.pin.Inertia(float(body.mass), array3(body.com), inertia33(body))
        model.appendBodyToJoint(joint, inertia, self.pin.SE3.Identity())

    def _prepare(self, state: RandomState, gravity: float = GRAVITY) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q and v in Pinocchio's conventions, and T with v_pinocchio = T v_ours."""
        self.model.gravity.linear = np.array([0.0, 0.0, -gravity])
        w, x, y, z = state.quaternion
        q = np.concatenate([state.position, [x, y, z, w], state.joints[self.order[6:] - 6]])
        T = np.eye(6 + self.n)
        T[:3, :3] = rotation_matrix(state.quaternion).T
        T = T[self.order]
        return q, T @ state.velocity, T

    def _turning(self, v: np.ndarray) -> np.ndarray:
        """w x v of the base: what separates the derivative of v_B from R^T times the derivative of v_W."""
        return np.concatenate([np.cross(v[3:6], v[:3]), np.zeros(3 + self.n)])

    def inverse_dynamics(self, state: RandomState, acceleration: np.ndarray, gravity: float = GRAVITY) -> np.ndarray:
        q, v, T = self._prepare(state, gravity)
        return T.T @ self.pin.rnea(self.model, self.data, q, v, T @ acceleration - self._turning(v))

    def forward_dynamics(self, state: RandomState, force: np.ndarray, gravity: float = GRAVITY) -> np.ndarray:
        q, v, T = self._prepare(state, gravity)
        return T.T @ (self.pin.aba(self.model, self.data, q, v, T @ force) + self._turning(v))

    def mass_matrix(self, state: RandomState) -> np.ndarray:
        q, _, T = self._prepare(state)
        upper = np.triu(self.pin.crba(self.model, self.data, q))
        return T.T @ (upper + np.triu(upper, 1).T) @ T

    def energy(self, state: RandomState, gravity: float = GRAVITY) -> float:
        q, v, _ = self._prepare(state, gravity)
        # its computeKineticEnergy is of the bodies alone, without the armature that its mass matrix holds
        upper = np.triu(self.pin.crba(self.model, self.data, q))
        kinetic = 0.5 * v @ (upper + np.triu(upper, 1).T) @ v
        return float(kinetic + self.pin.computePotentialEnergy(self.model, self.data, q))

    def center_of_mass(self, state: RandomState) -> np.ndarray:
        q, _, _ = self._prepare(state)
        return np.array(self.pin.centerOfMass(self.model, self.data, q))

    def momentum(self, state: RandomState) -> np.ndarray:
        q, v, _ = self._prepare(state)
        found = self.pin.computeCentroidalMomentum(self.model, self.data, q, v)
        return np.concatenate([found.linear, found.angular])

    def frame(self, state: RandomState, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
    """The vehicle as a MuJoCo model through ``MjSpec``; a free joint already has our generalized velocity."""

    def __init__(self, vehicle: Vehicle) -> None:
        import mujoco

        self.mujoco, self.n = mujoco, vehicle.n
        spec = mujoco.MjSpec()
        spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        spec.option.enableflags = mujoco.mjtEnableBit.mjENBL_ENERGY
        bodies = {BASE: spec.worldbody.add_body(name="base")}
        bodies[BASE].add_freejoint()
        self._fill(bodies[BASE], vehicle.base)
        for i, link in enumerate(vehicle.links):
            joint = link.joint
            quaternion = self._quaternion(array33(joint.rotation))
            body = bodies[link.parent].add_body(name=link.name, pos=array3(joint.position), quat=quaternion)
            kind = mujoco.mjtJoint.mjJNT_HINGE if joint.kind == "revolute" else mujoco.mjtJoint.mjJNT_SLIDE
            body.add_joint(name=joint.name, type=kind, axis=array3(joint.axis), armature=float(joint.armature))
            self._fill(body, link.body)
            bodies[i] = body
        for frame in vehicle.frames:
            quaternion = self._quaternion(array33(frame.rotation))
            bodies[frame.link].add_site(name=frame.name, pos=array3(frame.position), quat=quaternion)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        # MuJoCo numbers joints depth first; ours stand in the order of the links
        joints = [self.model.joint(link.joint.name) for link in vehicle.links]
        self.q_order = np.array([int(j.qposadr[0]) for j in joints], dtype=int)
        self.v_order = np.array([*range(6), *(int(j.dofadr[0]) for j in joints)], dtype=int)

    @staticmethod
    def _quaternion(R: np.ndarray) -> np.ndarray:
        from scipy.spatial.transform import Rotation

        x, y, z, w = Rotation.from_matrix(R).as_quat()
        return np.array([w, x, y, z])

    def _fill(self, body: Any, source: Body) -> None:
        moments, axes = np.linalg.eigh(inertia33(source))
        axes[:, 2] *= np.linalg.det(axes)
        body.mass, body.ipos, body.explicitinertial = float(source.mass), array3(source.com), True
        body.inertia, body.iquat = moments, self._quaternion(axes)

    def _prepare(self, state: RandomState, gravity: float = GRAVITY) -> Any:
        self.model.opt.gravity[:] = [0.0, 0.0, -gravity]
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:7] = [*state.position, *state.quaternion]
        self.data.qpos[self.q_order] = state.joints
        self.data.qvel[self.v_order] = state.velocity
        return self.data

    def inverse_dynamics(self, state: RandomState, acceleration: np.ndarray, gravity: float = GRAVITY) -> np.ndarray:
        data = self._prepare(state, gravity)
        data.qacc[self.v_order] = acceleration
        self.mujoco.mj_inverse(self.model, data)
        return data.qfrc_inverse[self.v_order].copy()

    def forward_dynamics(self, state: RandomState, force: np.ndarray, gravity: float = GRAVITY) -> np.ndarray:
        data = self._prepare(state, gravity)
        data.qfrc_applied[self.v_order] = force
        self.mujoco.mj_forward(self.model, data)
        return data.qacc[self.v_order].copy()

    def mass_matrix(self, state: RandomState) -> np.ndarray:
        """Column by column as the inertia force of a unit acceleration: no format of a sparse matrix to know."""
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
        return np.concatenate([data.subtree_linvel[1] * self.model.body_subtreemass[1], data.subtree_angmom[1]])

    def frame(self, state: RandomState, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """World position, rotation and Jacobian (linear rows first) of a frame."""
        data = self._prepare(state)
        self.mujoco.mj_forward(self.model, data)
        site = data.site(name)
        linear, angular = np.zeros((3, 6 + self.n)), np.zeros((3, 6 + self.n))
        self.mujoco.mj_jacSite(self.model, data, linear, angular, site.id)
        jacobian = np.vstack([linear, angular])[:, self.v_order]
        return site.xpos.copy(), site.xmat.reshape(3, 3).copy(), jacobian


TWINS: dict[str, Any] = {"pinocchio": PinocchioTwin, "mujoco": MujocoTwin}
