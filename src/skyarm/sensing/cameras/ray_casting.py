"""Rays of a camera or lidar against many shapes in many worlds, by machine code.

A block of neighbouring rays, one for each lane of the processor, lies within a cone,
and a shape within a ball: only blocks whose cone meets the ball are computed. Without
machine code NumPy computes the same numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property

import numpy as np

from skyarm.algebra import Mat3, Vec3
from skyarm.compile.llvm.kernel import JOB, Kernel, host_width, run_jobs
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.compile.tracing.program import trace_loop
from skyarm.records.arrays import Array, IntArray, Mask
from skyarm.sensing.cameras.rays import (
    SIZES,
    Face,
    Placed,
    meet_face,
    meet_shape,
)
from skyarm.world.contact.surface import Surface

_ZERO = Vec3(0.0, 0.0, 0.0)
_ROW = Placed(Mat3(_ZERO, _ZERO, _ZERO), _ZERO, (0.0,) * SIZES, 0.0)
_FACE = Face(_ZERO, 0.0, 0.0, 0.0)

HULL = "hull"

GROUP = 16
"""Number of neighbouring rays that are computed together: with fewer, choosing takes
longer than the rays that it saves."""

CLOSE = 1e-9
"""Margin (rad) by which a ball counts as within a cone."""


@cache
def _kernel(shape: str) -> Kernel:
    """Machine code that meets rays with shapes of one kind."""
    if shape == HULL:
        carry = ((0.0, 0.0), (0.0, 0.0))
        return Kernel(trace_loop(meet_face, carry, _ZERO, _FACE))
    return Kernel(trace_loop(meet_shape(shape), (0.0, 0.0), _ZERO, _ROW))


class RayCaster:
    """Rays of one sensor, and the shapes that they may hit.

    Args:
        directions: (rays, 3), optical axes.
        shapes: shapes in their own axes, with concrete numbers.
    """

    def __init__(self, directions: Array, shapes: Sequence[Surface]) -> None:
        self._count = len(directions)
        width = host_width()
        self._group = max(1, GROUP // width)
        groups = -(-self._count // (self._group * width))
        padded = np.empty((groups * self._group * width, 3))
        padded[: self._count] = directions
        padded[self._count :] = directions[-1]
        self._rays = np.ascontiguousarray(padded.T)
        units = padded / np.linalg.norm(padded, axis=1)[:, None]
        units = units.reshape(groups, -1, 3)
        axes = units.sum(axis=1)
        self._axes = axes / np.maximum(np.linalg.norm(axes, axis=1), 1e-12)[:, None]
        cosines = (units @ self._axes[:, :, None])[..., 0].min(axis=1)
        half = np.arccos(np.clip(cosines, -1.0, 1.0)) + CLOSE
        # a group about the whole sensor is near whatever there is
        wide = half > 0.5 * np.pi
        self._cosine = np.where(wide, -3.0, np.cos(half))
        self._sine = np.where(wide, 3.0, np.sin(half))
        self._kinds = [each.shape for each in shapes]
        self._reach = np.array(
            [
                np.inf if each.shape == "plane" else float(each.farthest)
                for each in shapes
            ]
        )
        self._sizes = np.zeros((len(shapes), SIZES))
        for row, each in zip(self._sizes, shapes, strict=True):
            row[: len(each.size)] = [*map(float, each.size)]
        self._set_faces(shapes)

    def _set_faces(self, shapes: Sequence[Surface]) -> None:
        """Normals and distances of all hulls' faces, and each hull's rows of them."""
        tables = [np.zeros((0, 4))]
        self._faces = np.zeros((len(shapes), 2), np.int64)
        end = 0
        for i, each in enumerate(shapes):
            if each.shape == HULL:
                corners = np.array([[*map(float, v)] for v in each.vertices])
                a, b, c = corners[np.array(each.faces)].transpose(1, 0, 2)
                across = np.cross(b - a, c - a)
                across /= np.linalg.norm(across, axis=1)[:, None]
                away = (across * a).sum(axis=1)[:, None]
                tables.append(np.hstack([across, away]))
                self._faces[i] = end, end + len(a)
                end += len(a)
        self._normals, self._heights = np.split(np.concatenate(tables), [3], axis=1)
        hulls = np.flatnonzero(self._faces[:, 1])
        counts = np.diff(self._faces[hulls], axis=1)[:, 0]
        self._owner = np.repeat(hulls, counts)
        self._marks = np.zeros((end, 2))
        self._marks[self._faces[hulls, 0], 0] = 1.0
        self._marks[self._faces[hulls, 1] - 1, 1] = hulls + 1.0

    def cast(self, rotations: Array, eyes: Array) -> tuple[Array, IntArray]:
        """Meet all rays with all shapes.

        Args:
            rotations: (worlds, shapes, 3, 3) from optical axes to those of each shape.
            eyes: (worlds, shapes, 3) m, the sensor's place in these.

        Returns:
            Depth (worlds, rays) of the nearest hit, infinite without one, and number of
            its shape from 1 on, 0 without one.
        """
        worlds, lanes = len(eyes), self._rays.shape[1]
        shapes = np.empty((worlds, len(self._kinds), 13 + SIZES))
        shapes[..., :9] = rotations.reshape(worlds, -1, 9)
        shapes[..., 9:12] = eyes
        shapes[..., 12:-1] = self._sizes
        shapes[..., -1] = np.arange(1.0, len(self._kinds) + 1.0)
        faces = np.empty((worlds, len(self._owner), 6))
        if len(self._owner):
            turned = rotations[:, self._owner].swapaxes(2, 3) @ self._normals[..., None]
            faces[..., :3] = turned[..., 0]
            seen = eyes[:, self._owner]
            faces[..., 3] = (seen * self._normals).sum(axis=-1) - self._heights[:, 0]
            faces[..., 4:] = self._marks
        hits = np.zeros((worlds, 4, lanes))
        hits[:, 0] = np.inf
        try:
            self._run(rotations, eyes, shapes, faces, hits)
        except NoMachineCodeError:
            self._run_in_python(shapes, faces, hits)
        return hits[:, 0, : self._count], hits[:, 1, : self._count].astype(int)

    def _run(
        self, rotations: Array, eyes: Array, shapes: Array, faces: Array, hits: Array
    ) -> None:
        """Meet rays and shapes in machine code."""
        addresses = self._addresses
        world, shape, first, last = self._runs(self._near(rotations, eyes))
        hull = self._faces[shape, 1] > 0
        jobs = np.zeros((len(world), JOB), np.int64)
        jobs[:, 0] = addresses[shape]
        jobs[:, 1] = hits.ctypes.data + world * hits.strides[0]
        jobs[:, 2] = self._rays.ctypes.data
        jobs[:, 3] = np.where(
            hull,
            faces.ctypes.data + world * faces.strides[0],
            shapes.ctypes.data + world * shapes.strides[0],
        )
        jobs[:, 4:6] = jobs[:, 1:2]
        jobs[:, 6], jobs[:, 7] = first * self._group, last * self._group
        jobs[:, 8] = np.where(hull, self._faces[shape, 0], shape)
        jobs[:, 9] = np.where(hull, self._faces[shape, 1], shape + 1)
        jobs[:, 11] = hits.shape[2]
        jobs[:, 12] = 1
        run_jobs(jobs)

    @cached_property
    def _addresses(self) -> IntArray:
        """Addresses of the machine code of each shape."""
        return np.array([_kernel(each).address for each in self._kinds], np.int64)

    def _near(self, rotations: Array, eyes: Array) -> Mask:
        """True for each world, shape and block of rays whose cone meets the shape's
        ball.
        """
        away = np.sqrt((eyes * eyes).sum(axis=-1))[..., None]
        centres = -(rotations.swapaxes(2, 3) @ eyes[..., None])[..., 0]
        reach = self._reach[:, None]
        inside = away <= reach
        # cosine of the cone's angle and the ball's, both times the distance
        level = np.sqrt(np.where(inside, 0.0, away * away - reach * reach))
        least = level * self._cosine - np.where(inside, 0.0, reach) * self._sine
        near: Mask = (centres @ self._axes.T >= least) | inside
        return near

    @staticmethod
    def _runs(near: Mask) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """World, shape, first block and end of each run of blocks that are near."""
        steps = np.zeros((*near.shape[:2], near.shape[2] + 1), np.int8)
        steps[..., :-1] = near
        steps[..., 1:] -= near
        # each run has a begin and an end, which take turns
        marks = np.flatnonzero(steps)
        row, first = np.divmod(marks[::2], steps.shape[2])
        world, shape = np.divmod(row, near.shape[1])
        return world, shape, first, marks[1::2] - row * steps.shape[2]

    def _run_in_python(self, shapes: Array, faces: Array, hits: Array) -> None:
        """Meet rays and shapes by NumPy."""
        ray = Vec3(*self._rays)
        for world, hit in enumerate(hits):
            for i, kind in enumerate(self._kinds):
                if kind == HULL:
                    carry = ((hit[0], hit[1]), (hit[2], hit[3]))
                    for row in faces[world, slice(*self._faces[i])]:
                        face = Face(Vec3(*row[:3]), *row[3:])
                        carry, _ = meet_face(carry, ray, face, ())
                    hit[0], hit[1] = carry[0]
                else:
                    row = shapes[world, i]
                    R = Mat3(Vec3(*row[:3]), Vec3(*row[3:6]), Vec3(*row[6:9]))
                    placed = Placed(R, Vec3(*row[9:12]), tuple(row[12:-1]), row[-1])
                    step = meet_shape(kind)
                    hit[0], hit[1] = step((hit[0], hit[1]), ray, placed, ())[0]
