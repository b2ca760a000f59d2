"""Members of a team as virtual masses at the places of their grasps, by which they
share a force on the body.

h_i is the force that member i exerts on the body at its grasp, r_i the place of the
grasp from the centre of mass. With virtual masses m_i, whose middle is c and whose
second moment about it is J, a force F and a moment N take

    h_i = m_i (F / sum m + J^-1 (N - c x F) x (r_i - c)),

which are free of internal forces: what is left of any forces without those of their own
sum is internal. Sources: Walker, Freeman, Marcus 1991; Erhart, Hirche 2015 (load
distribution by virtual masses).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Annotated

from skyarm.algebra import ZERO3, Mat3, Scalar, Vec3, ldl_solve
from skyarm.algebra.matrix import orientation_error
from skyarm.algebra.scalars import divide, maximum, minimum, sqrt, where
from skyarm.records import coerce
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.units import Unit, nonnegative
from skyarm.reference.object_motion import PoseTrajectory
from skyarm.reference.signals import Constant, Ramp, Signal, Sum
from skyarm.reference.trajectory import Trajectory
from skyarm.world.contact.grasp import KINDS

SMALL = 1e-9
"""Share of a trace that is added to a matrix, of which points on a line leave one
direction without an inverse."""

FLOOR = 1e-12
"""Least sum of virtual masses, and least of their second moments, where one member or
none is left."""


@immutable
class Member:
    """Member of a team: a vehicle whose tip holds the body.

    Attributes:
        agent: name of the vehicle.
    """

    agent: str
    place: Annotated[
        Vec3, Unit("m", "supposed place of the grasp, axes of the body from its middle")
    ]
    length: Annotated[
        float,
        nonnegative(
            "m", "supposed length of its cable; left out: as in its grasp", fixed=True
        ),
    ] = field_if_any(default=0)
    taken: Annotated[
        Vec3 | None,
        Unit(
            "m",
            "true place of the grasp, if it differs from the supposed one; left out:"
            " place",
        ),
    ] = None
    mass: Annotated[
        Scalar,
        nonnegative(
            "",
            "virtual mass, to which its share of the force is proportional; 0: 1 on"
            " cables, otherwise the load that the member can bear",
        ),
    ] = 0.0
    kind: Annotated[
        str | None,
        Unit(
            "",
            "supposed kind of its grasp; left out: the true kind",
            rule=coerce.word_of(KINDS),
        ),
    ] = None

    def path(self, motion: PoseTrajectory, take: Scalar) -> Trajectory:
        """Path of the tip, and change of the heading, that carry the body; within 1 s
        of taking hold at its place.
        """
        signals: list[Signal] = [Constant(c) for c in self.place]
        if self.taken is not None:
            rows = zip(self.taken, self.place, strict=True)
            signals = [
                Sum(
                    (
                        Constant(a),
                        # nonic: laws take four continuous derivatives of a tip's path
                        Ramp(start=take, duration=1.0, height=b - a, shape="nonic"),
                    )
                )
                for a, b in rows
            ]
        x, y, z = motion.path_of(signals)
        return Trajectory(x=x, y=y, z=z, yaw=motion.yaw)


class VirtualMasses:
    """Base class of teams: geometry of the grasps, and forces of the members without
    internal ones and along lines.
    """

    __slots__ = ()

    members: tuple[Member, ...]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Numbers of each two members: 0 and 1, 0 and 2, 1 and 2 ..."""
        return list(combinations(range(len(self.members)), 2))

    def along(self, tensions: Sequence[Scalar], arms: Sequence[Vec3]) -> list[Vec3]:
        """Force (N) of each member for a pull (N) along the line of each pair of
        grasps, positive in tension.
        """
        forces = [ZERO3] * len(arms)
        for (i, j), tension, line in zip(
            self.pairs, tensions, self.lines(arms), strict=True
        ):
            forces[i] = forces[i] + line * tension
            forces[j] = forces[j] - line * tension
        return forces

    def lines(self, arms: Sequence[Vec3]) -> list[Vec3]:
        """Unit vector from the second to the first grasp of each pair; zero where a
        member has lost its grasp.
        """
        lines = []
        for i, j in self.pairs:
            line = arms[i] - arms[j]
            least = minimum(self.members[i].mass, self.members[j].mass)
            lines.append(
                # a lost member takes no part: it must not be pulled either
                line * where(least > 0.0, divide(1.0, line.norm()), 0.0)
            )
        return lines

    def tensions(self, forces: Sequence[Vec3], arms: Sequence[Vec3]) -> list[Scalar]:
        """Pull (N) along the line of each pair of grasps from internal forces (N), by
        least squares.
        """
        lines = self.lines(arms)
        pairs = self.pairs
        A: list[list[Scalar]] = [[0.0] * len(pairs) for _ in pairs]
        for a, (i, j) in enumerate(pairs):
            for b, (k, m) in enumerate(pairs):
                # a pull acts on both grasps of a pair, with opposite signs
                sign = float((i == k) + (j == m) - (i == m) - (j == k))
                # grasps on one line have no unique pulls: SMALL selects the least ones
                A[a][b] = lines[a].dot(lines[b]) * sign + (SMALL if a == b else 0.0)
        return ldl_solve(
            A,
            [
                line.dot(forces[i] - forces[j])
                for line, (i, j) in zip(lines, pairs, strict=True)
            ],
        )

    def turn_error(self, R: Mat3, desired: Mat3) -> Vec3:
        """Rotation (rad, world axes) from an attitude of the body to a near one, to
        second order of the angle.

        Members on one line do not turn the body about it: that turn is left out.
        """
        turn = orientation_error(R, desired)
        relative = self.from_middle(self.arms(desired))
        return self._turn(relative, [turn.cross(r) for r in relative])

    def arms(self, R: Mat3) -> list[Vec3]:
        """Places of the grasps from the middle of the body, world axes, at an attitude
        of the body.
        """
        return [R.apply(each.place) for each in self.members]

    def from_middle(self, arms: Sequence[Vec3]) -> list[Vec3]:
        """Places of the grasps from the middle of the virtual masses."""
        middle = self._mean(arms)
        return [arm - middle for arm in arms]

    def _mean(self, vectors: Sequence[Vec3]) -> Vec3:
        """Mean of one vector of each member, weighted by the virtual masses."""
        whole = self.per_mass
        return sum(
            (
                v * (each.mass * whole)
                for v, each in zip(vectors, self.members, strict=True)
            ),
            ZERO3,
        )

    @property
    def per_mass(self) -> Scalar:
        """Inverse of the sum of the virtual masses; finite where no member is left."""
        return divide(
            1.0, maximum(sum((each.mass for each in self.members), 0.0), FLOOR)
        )

    def _turn(self, relative: Sequence[Vec3], shifts: Sequence[Vec3]) -> Vec3:
        """Rotation (rad) that fits displacements of the grasps best, from their places
        about the common middle.
        """
        ways = ZERO3
        for each, r, shift in zip(self.members, relative, shifts, strict=True):
            ways = ways + r.cross(shift) * each.mass
        return Vec3(*ldl_solve(self.moments(relative), list(ways)))

    def outward(self, arms: Sequence[Vec3]) -> list[Vec3]:
        """Unit vectors from the middle of the virtual masses to the grasps."""
        return [
            arm * divide(1.0, sqrt(arm.dot(arm) + SMALL))
            for arm in self.from_middle(arms)
        ]

    def shares(self, force: Vec3, moment: Vec3, arms: Sequence[Vec3]) -> list[Vec3]:
        """Force of each member for a force (N) and a moment (N m, about the body's
        middle), without internal ones.
        """
        relative = self.from_middle(arms)
        whole = self.per_mass
        # arms[0] - relative[0] is the middle of the virtual masses from the body's
        turning = Vec3(
            *ldl_solve(
                self.moments(relative),
                list(moment - (arms[0] - relative[0]).cross(force)),
            )
        )
        rows = zip(self.members, relative, strict=True)
        return [
            force * (each.mass * whole) + turning.cross(r) * each.mass
            for each, r in rows
        ]

    def rigid_shift(
        self, shifts: Sequence[Vec3], arms: Sequence[Vec3]
    ) -> tuple[Vec3, Vec3]:
        """Displacement (m) of the body's middle and rotation (rad) that fit
        displacements of the grasps best.

        By least squares with the virtual masses, world axes; members on one line do not
        tell a turn about it.
        """
        relative = self.from_middle(arms)
        turn = self._turn(relative, shifts)
        # arms[0] - relative[0] is the middle of the virtual masses from the body's
        return self._mean(shifts) - turn.cross(arms[0] - relative[0]), turn

    def moments(self, relative: Sequence[Vec3]) -> list[list[Scalar]]:
        """Matrix of the second moments of the virtual masses about their middle, with
        an inverse also on one line.
        """
        J: list[list[Scalar]] = [[0.0] * 3 for _ in range(3)]
        for each, r in zip(self.members, relative, strict=True):
            square = r.dot(r)
            c = tuple(r)
            for i in range(3):
                for k in range(3):
                    J[i][k] = J[i][k] + each.mass * (
                        (square if i == k else 0.0) - c[i] * c[k]
                    )
        # of points on a line J has no inverse: the turn about it is left at 0
        eased = maximum((J[0][0] + J[1][1] + J[2][2]) * SMALL, FLOOR)
        for i in range(3):
            J[i][i] = J[i][i] + eased
        return J

    def internal(self, forces: Sequence[Vec3], arms: Sequence[Vec3]) -> list[Vec3]:
        """Internal part of the members' forces: without what accelerates the body."""
        force = sum(forces, ZERO3)
        moment = sum((arm.cross(f) for arm, f in zip(arms, forces, strict=True)), ZERO3)
        return [
            f - share
            for f, share in zip(forces, self.shares(force, moment, arms), strict=True)
        ]
