"""Edge-edge contact of two boxes that touch at no corner, such as crossed planks or
boxes of equal size.

Two boxes are apart along one of 15 directions, or overlap: the normals of their faces,
where corners meet faces, and the 9 cross products of their edges, where two edges meet.
For each of these nine the edge of one box that reaches farthest towards the other meets
its counterpart; where a face lies on a face, the parallel edge across either face
reaches as far, and counts, too: 36 pairs of edges in all. How deep a pair overlaps is
the least of

* the overlap d along the common normal of both edges,
* the way from where they cross to the end of either, across the other edge, and ``END``
  more: where edges of one length end above each other, they carry,
* of a parallel edge, what is left of ``TILT`` between its face and the normal,
* 3 o - d with o the least overlap along all 15: what lies deeper than the boxes overlap
  is behind.

So every depth is continuous as boxes move, and edges that become parallel, whose normal
turns at random, carry nothing.

Source: Gottschalk, Lin, Manocha 1996, OBBTree, section 5; Ericson 2005, Real-time
collision detection, 4.4.1 and 5.1.9.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from itertools import product

from skyarm.algebra import Mat3, Scalar, Vec3
from skyarm.algebra.scalars import absolute, clip, divide, maximum, minimum, sqrt, where
from skyarm.records.immutable import positional

EDGE_PAIRS = 36
"""Number of edge pairs of two boxes that may touch."""

END = 1e-3
"""Distance (m) beyond the end of an edge at which the edge still touches.

Chosen. Half and twice of it change the depth of 1 of 1500 drawn poses of two boxes of
6 to 10 cm, by 0.2 and 0.4 mm (measured)."""

TILT = 0.2
"""Sine of the largest angle between the normal and a face at which the face's far edge
may touch.

Chosen. Half and twice of it change the depth of 1 in 20 drawn poses, by up to 5 and
10 mm, as half and twice of ``ROOM`` do; whether the boxes touch changes in 1 of 1500
(measured)."""

SLANT = 0.05
"""Sine of the smallest angle between two edges whose common normal may separate the
boxes: edges that are nearly parallel have none to speak of.

Chosen. Half of it changes no drawn pose, twice 1 of 1500, by 0.03 mm (measured)."""

ROOM = 0.05
"""Length (m) that multiplies a sine in the depth of tilted edges."""

_PARALLEL = 1e-12
"""Square of a sine added in a quotient: parallel edges have a zero normal instead of
NaN."""


@positional
class PlacedBox:
    """Oriented box in the world: centre (m), rotation matrix from box to world axes,
    and half lengths (m).
    """

    middle: Vec3
    rotation: Mat3
    halves: tuple[Scalar, Scalar, Scalar]


def face_overlap(a: PlacedBox, b: PlacedBox) -> Scalar:
    """Smallest overlap (m) of two boxes along all their face normals; negative if a
    face plane separates them.
    """
    return reduce(minimum, _face_overlaps(a, b))


def _face_overlaps(a: PlacedBox, b: PlacedBox) -> Iterator[Scalar]:
    """Overlap (m) of two boxes along each of their six face normals."""
    between = a.middle - b.middle
    for one, other in ((a, b), (b, a)):
        for i in range(3):
            axis = one.rotation.column(i)
            reach = one.halves[i] - absolute(between.dot(axis))
            for j in range(3):
                reach = (
                    reach
                    + absolute(axis.dot(other.rotation.column(j))) * other.halves[j]
                )
            yield reach


def edge_touches(a: PlacedBox, b: PlacedBox) -> Iterator[tuple[Vec3, Scalar, Vec3]]:
    """Contact point (m), penetration (m) and normal (from b to a) of each pair of edges
    of the boxes ``a`` and ``b``.

    All in world axes; the penetration is negative where the edges are apart.
    """
    between = a.middle - b.middle
    overlap = face_overlap(a, b)
    crossings = list[_Crossing]()
    for i, j in product(range(3), repeat=2):
        u, v = a.rotation.column(i), b.rotation.column(j)
        across, cosine = u.cross(v), u.dot(v)
        square = across.dot(across) + _PARALLEL
        sine = sqrt(square)
        # from b to a, whichever way the cross product points
        n = across * divide(where(across.dot(between) < 0.0, -1.0, 1.0), sine)
        ours, theirs = _facing(a, i, -n), _facing(b, j, n)
        for k, ((off, room_a), (to, room_b)) in enumerate(product(ours, theirs)):
            r = between + off - to
            depth = -r.dot(n)
            ru = r.dot(u)
            rv = r.dot(v)
            # the farthest of both: what is between here and there, parts nothing
            if k == 0:
                overlap = minimum(overlap, where(sine > SLANT, depth, overlap))
            s, t = divide(rv * cosine - ru, square), divide(rv - ru * cosine, square)
            end = maximum(depth, END)
            inside = (
                minimum(
                    a.halves[i] + end - absolute(s), b.halves[j] + end - absolute(t)
                )
                * sine
            )
            for room in (room_a, room_b):
                # only the far edge of a face is bounded by the tilt of the face
                inside = inside if room is None else minimum(inside, room)
            # of edges nearly parallel it is far away, where a turning body is swift
            on_a, on_b = (
                clip(x, -half, half) for x, half in ((s, a.halves[i]), (t, b.halves[j]))
            )
            place = (a.middle + off + u * on_a + b.middle + to + v * on_b) * 0.5
            crossings.append(_Crossing(place, depth, minimum(depth, inside), n))
    for each in crossings:
        behind = 3.0 * overlap - each.depth
        # apart, a quarter of it: as boxes near each other, both go
        behind = where(overlap > 0.0, behind, 0.25 * behind)
        yield each.place, minimum(each.inside, behind), each.normal


@positional
class _Crossing:
    """Possible contact of two box edges: point (m), penetration (m) without and with
    limits at the ends, and normal.
    """

    place: Vec3
    depth: Scalar
    inside: Scalar
    normal: Vec3


def _facing(
    box: PlacedBox, along: int, way: Vec3
) -> tuple[tuple[Vec3, Scalar | None], tuple[Vec3, Scalar | None]]:
    """Midpoints (m) of a box's two outermost edges in a direction, and the largest
    penetration (m) of the second.

    Midpoints are offsets from the box's centre, world axes.
    """
    first, second = (box.rotation.column((along + k) % 3) for k in (1, 2))
    one, other = first.dot(way), second.dot(way)
    first = first * (box.halves[(along + 1) % 3] * where(one < 0.0, -1.0, 1.0))
    second = second * (box.halves[(along + 2) % 3] * where(other < 0.0, -1.0, 1.0))
    one, other = absolute(one), absolute(other)
    # the face that is nearer to square to the way, and its far edge
    far = Vec3(
        *(where(one > other, x - y, y - x) for x, y in zip(first, second, strict=True))
    )
    return (first + second, None), (far, (TILT - minimum(one, other)) * ROOM)
