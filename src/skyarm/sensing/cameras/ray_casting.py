"""Rays of a camera or lidar against many shapes in many worlds, by machine code.

A group of neighbouring rays lies within a cone, and a shape within a ball: only groups
whose cone meets the ball are computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import chain

import numpy as np

from skyarm.algebra import Mat3, Vec3
from skyarm.compile.llvm.kernel import JOB, Kernel, host_width, run_jobs
from skyarm.compile.tracing.program import trace_loop
from skyarm.records.arrays import Array, IntArray, Mask, doubles, float_array, lengths
from skyarm.sensing.cameras.rays import SIZES, ShapeRow, meet_face, meet_shape
from skyarm.world.contact.vehicle_bodies import Part
from skyarm.world.scene.vehicle_shapes import matrices

GROUP = 16
"""Number of neighbouring rays that are computed together: with fewer, choosing takes
longer than the rays that it saves."""

MARGIN = 1e-9
"""Angle (rad) by which the cone of a group is made wider."""

_ZERO = Vec3(0.0, 0.0, 0.0)
_ROW = ShapeRow(Mat3(_ZERO, _ZERO, _ZERO), _ZERO, (0.0,) * SIZES, 0.0)


@cache
def _kernel(shape: str) -> Kernel:
    """Machine code that meets rays with shapes of one kind."""
    hit = 0.0, 0.0
    if shape == "hull":
        return Kernel(trace_loop(meet_face, (hit, hit), _ZERO, _ROW))
    return Kernel(trace_loop(meet_shape(shape), hit, _ZERO, _ROW, loops=True))


def _rows(part: Part, number: int) -> Iterator[Array]:
    """Rows of a shape, of a hull one for each face: rotation from its body's axes,
    place in these (m), and sizes and number.
    """
    R, place = matrices(part.rotation, 1)[0], float_array(part.position)
    numbers = np.zeros(SIZES + 1)
    if part.shape.shape != "hull":
        numbers[: len(part.shape.size)] = float_array(part.shape.size)
        numbers[-1] = number
        yield np.concatenate([R.T.ravel(), place, numbers])
        return
    corners = place + [R @ float_array(each) for each in part.shape.vertices]
    last = len(part.shape.faces) - 1
    for i, face in enumerate(part.shape.faces):
        a, b, c = corners[[*face]]
        across = np.cross(b - a, c - a)
        T = np.zeros((3, 3))
        T[2] = across / np.linalg.norm(across)
        numbers = np.zeros(SIZES + 1)
        numbers[0], numbers[-1] = i == 0, number * (i == last)
        yield np.concatenate([T.ravel(), a, numbers])


class RayCaster:
    """Rays of one sensor, and the shapes that they may meet.

    Args:
        directions: (rays, 3), optical axes.
        owners: number of the body of each shape.
        parts: shapes in their bodies' axes, with concrete numbers.
    """

    def __init__(
        self, directions: Array, owners: IntArray, parts: Sequence[Part]
    ) -> None:
        self._count = len(directions)
        size = max(GROUP, host_width())
        self._blocks = size // host_width()
        padded = np.pad(directions, ((0, -self._count % size), (0, 0)), mode="edge")
        self._rays = np.ascontiguousarray(padded.T)
        units = padded / lengths(padded)[:, None]
        groups = units.reshape(-1, size, 3)
        axes = groups.sum(axis=1)
        self._axes = axes / np.maximum(lengths(axes), 1e-9)[:, None]
        cosines = (groups @ self._axes[:, :, None])[..., 0].min(axis=1)
        half = np.arccos(np.clip(cosines, -1.0, 1.0)) + MARGIN
        # a group that looks all around is near whatever there is
        wide = half > 0.5 * np.pi
        self._cosines = np.where(wide, -3.0, np.cos(half))
        self._sines = np.where(wide, 3.0, np.sin(half))
        self._owners = owners
        places = [float_array(each.position) for each in parts]
        self._centres = np.array(places).reshape(-1, 3)
        shapes = [each.shape for each in parts]
        self._reach = np.array(
            [1e99 if each.shape == "plane" else float(each.farthest) for each in shapes]
        )[:, None]
        self._kernels = [_kernel(each.shape) for each in shapes]
        each = [[*_rows(part, i)] for i, part in enumerate(parts, 1)]
        counts = [*map(len, each)]
        self._ends = np.cumsum([0, *counts])
        self._row_owners = np.repeat(owners, counts)
        # rotation, place, sizes and number of each row
        self._rows = doubles([*chain(*each)]).reshape(-1, 12 + SIZES + 1)

    def cast(self, rotations: Array, eyes: Array) -> tuple[Array, IntArray]:
        """Meet all rays with all shapes.

        Args:
            rotations: (worlds, bodies, 3, 3) from optical axes to those of each body.
            eyes: (worlds, bodies, 3) m, the sensor's place in these.

        Returns:
            Depth (worlds, rays) of the nearest hit, infinite without one, and number of
            its shape from 1 on, 0 without one.
        """
        rows = np.tile(self._rows, (len(eyes), 1, 1))
        turns = self._rows[:, :9].reshape(-1, 3, 3)
        turned = turns @ rotations[:, self._row_owners]
        rows[..., :9] = turned.reshape(*rows.shape[:2], 9)
        off = eyes[:, self._row_owners] - self._rows[:, 9:12]
        rows[..., 9:12] = (turns @ off[..., None])[..., 0]
        hits = np.zeros((len(eyes), 4, self._rays.shape[1]))
        hits[:, 0] = np.inf
        world, shape, first, last = self._runs(self._near(rotations, eyes))
        jobs = np.zeros((len(world), JOB), np.int64)
        jobs[:, 0] = np.array([each.address for each in self._kernels])[shape]
        jobs[:, 1] = hits.ctypes.data + world * hits.strides[0]
        jobs[:, 2] = self._rays.ctypes.data
        jobs[:, 3] = rows.ctypes.data + world * rows.strides[0]
        # neither log nor random numbers
        jobs[:, 4:6] = jobs[:, 1:2]
        jobs[:, 6] = first * self._blocks
        jobs[:, 7] = last * self._blocks
        jobs[:, 8] = self._ends[shape]
        jobs[:, 9] = self._ends[shape + 1]
        jobs[:, 11] = hits.shape[2]
        jobs[:, 12] = 1
        run_jobs(jobs)
        return hits[:, 0, : self._count], hits[:, 1, : self._count].astype(int)

    def _near(self, rotations: Array, eyes: Array) -> Mask:
        """True for each world, shape and group of rays whose cone meets the shape's
        ball.
        """
        way = (self._centres - eyes[:, self._owners])[..., None]
        middle = (rotations[:, self._owners].swapaxes(2, 3) @ way)[..., 0]
        left = (middle * middle).sum(axis=-1)[..., None] - self._reach**2
        # cosine of both angles together, times the distance
        least = np.sqrt(np.maximum(left, 0.0)) * self._cosines
        least -= self._reach * self._sines
        near: Mask = (middle @ self._axes.T >= least) | (left <= 0.0)
        return near

    @staticmethod
    def _runs(near: Mask) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """World, shape, first group and end of each run of groups that are near."""
        steps = np.zeros((*near.shape[:2], near.shape[2] + 1), np.int8)
        steps[..., :-1] = near
        steps[..., 1:] -= near
        # each run has a begin and an end, which take turns
        marks = np.flatnonzero(steps)
        row, first = np.divmod(marks[::2], steps.shape[2])
        world, shape = np.divmod(row, near.shape[1])
        return world, shape, first, marks[1::2] - row * steps.shape[2]
