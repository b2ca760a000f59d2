"""Rays of a camera or lidar against many shapes in many worlds, by machine code."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np

from skyarm.algebra import ZERO3_DATA, Mat3
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.shared_steps import Arguments
from skyarm.compile.tracing.program import trace_loop
from skyarm.records.arrays import Array, IntArray, doubles, float_array
from skyarm.sensing.cameras.rays import SIZES, ShapeRow, meet
from skyarm.world.contact.vehicle_bodies import Part
from skyarm.world.scene.vehicle_shapes import matrices

WIDER = 1.0 + 1e-6
"""Factor by which balls about shapes are larger, so that rounding hides no ray."""

PLANE = 1e9
"""Radius (m) of the ball about a plane, which holds every sensor."""

WIDTH = 16 + SIZES + 3
"""Numbers of a row (:class:`skyarm.sensing.cameras.rays.ShapeRow`)."""


# without a bound: there are no more than sets of kinds of shapes
@cache
def _kernel(kinds: tuple[str, ...]) -> Kernel:
    """Machine code that meets rays with shapes of some kinds."""
    matrix, size = Mat3(ZERO3_DATA, ZERO3_DATA, ZERO3_DATA), (0.0,) * SIZES
    row = ShapeRow(matrix, ZERO3_DATA, ZERO3_DATA, 0.0, size, 0.0, 0.0, 0.0)
    step = meet(kinds)
    return Kernel(trace_loop(step, (0.0,) * 4, ZERO3_DATA, row, loops=True))


def _rows(part: Part, kind: int, number: int) -> Iterator[list[float]]:
    """Rows of a shape, of a hull one for each face, without the sensor's pose.

    They have rotation from the body's axes and place in these (m), then middle and
    squared radius (m^2) of a ball about the shape.
    """
    shape, R = part.shape, matrices(part.rotation, 1)[0]
    place = float_array(part.position)
    reach = PLANE if shape.shape == "plane" else WIDER * float(shape.farthest)
    ball = [*place, reach * reach]
    if shape.shape != "hull":
        size = [*map(float, shape.size), *(0.0,) * SIZES][:SIZES]
        yield [*R.T.ravel(), *place, *ball, *size, kind, 1.0, number]
        return
    corners = place + [R @ float_array(each) for each in shape.vertices]
    last = len(shape.faces) - 1
    for i, (a, b, c) in enumerate(corners[np.array(shape.faces)]):
        across = np.cross(b - a, c - a)
        # a face is met along its normal alone, the third row of the rotation
        turn = [*(0.0,) * 6, *across / np.linalg.norm(across)]
        # the last face has the number: a ray has met the hull once all faces have cut
        # its interval
        marks = [*(0.0,) * SIZES, kind, i == 0, number * (i == last)]
        yield [*turn, *a, *ball, *marks]


class RayCaster:
    """Rays of one sensor, and the shapes that they may meet.

    Attributes:
        directions: (rows, columns, 3), optical axes.
        owners: number of the body of each shape.
        parts: shapes in their bodies' axes, with concrete numbers.
    """

    def __init__(
        self, directions: Array, owners: Sequence[int], parts: Sequence[Part]
    ) -> None:
        self.directions = directions
        self.owners = owners
        self.parts = parts
        # sorted: a set has no order, and the kinds are the key of the code
        kinds = tuple(sorted({each.shape.shape for each in parts}))
        self._kernel = _kernel(kinds)
        flat = directions.reshape(-1, 3)
        self._count = len(flat)
        # lanes fly in whole blocks: those left over repeat the last ray, a direction as
        # good as any
        padding = ((0, -len(flat) % self._kernel.lanes.width), (0, 0))
        self._rays = np.ascontiguousarray(np.pad(flat, padding, mode="edge").T)
        rows = [
            [*row, owner]
            for i, (owner, part) in enumerate(zip(owners, parts, strict=True))
            for row in _rows(part, kinds.index(part.shape.shape), i + 1)
        ]
        table = doubles(rows).reshape(-1, WIDTH + 1)
        self._rows = table[:, :-1]
        self._owners = table[:, -1].astype(int)

    def cast(self, rotations: Array, eyes: Array) -> tuple[Array, IntArray]:
        """Meet all rays with all shapes.

        Args:
            rotations: (worlds, bodies, 3, 3) from optical axes to those of each body.
            eyes: (worlds, bodies, 3) m, the sensor's place in these.

        Returns:
            Depth (worlds, rows, columns) of the nearest hit, infinite without one, and
            number of its shape from 1 on, 0 without one.
        """
        rows = np.tile(self._rows, (len(eyes), 1, 1))
        R_BO, eye = rotations[:, self._owners], eyes[:, self._owners]
        turns = self._rows[:, :9].reshape(-1, 3, 3)
        rows[..., :9] = (turns @ R_BO).reshape(*rows.shape[:2], 9)
        rows[..., 9:12] = (turns @ (eye - rows[..., 9:12])[..., None])[..., 0]
        away = (rows[..., 12:15] - eye)[..., None]
        rows[..., 12:15] = (R_BO.swapaxes(2, 3) @ away)[..., 0]
        rows[..., 15] = (away[..., 0] ** 2).sum(axis=-1) - rows[..., 15]
        lanes = self._rays.shape[1]
        blocks = lanes // self._kernel.lanes.width
        sight = np.zeros((4, lanes))
        depths = np.empty((len(eyes), self._count))
        numbers = np.empty((len(eyes), self._count), int)
        for i, own in enumerate(rows):
            sight[:2] = [[np.inf], [0.0]]
            # there are neither a log nor random numbers
            arrays = sight, self._rays, own, sight, sight
            places = [each.ctypes.data for each in arrays]
            given = Arguments(*places, 0, blocks, 0, len(own), 0, lanes, 1)
            self._kernel.machine.call(given)
            depths[i], numbers[i] = sight[:2, : self._count]
        shape = (-1, *self.directions.shape[:-1])
        return depths.reshape(shape), numbers.reshape(shape)
