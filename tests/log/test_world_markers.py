"""Markers of the world's solids: the types and scales of visualization_msgs/Marker."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from skyarm.log.ros.scene import THIN, _marker
from skyarm.world.scene.shapes import Solid

CUBE, SPHERE, CYLINDER = 1, 2, 3
"""Of visualization_msgs/Marker's definition."""

SOLIDS = {
    "box": ((0.1, 0.2, 0.3), CUBE, (0.2, 0.4, 0.6)),
    "patch": ((0.1, 0.2), CUBE, (0.2, 0.4, THIN)),
    "sphere": ((0.1,), SPHERE, (0.2, 0.2, 0.2)),
    "cylinder": ((0.1, 0.5), CYLINDER, (0.2, 0.2, 0.5)),
}


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_solid_is_a_marker_of_its_type_and_extents(kind):
    size, number, extents = SOLIDS[kind]
    shape = SimpleNamespace(kind=kind, size=size, name="world/it", role="surface")
    found = _marker(4, Solid(shape, np.zeros(3), np.eye(3)[None]), "world", 0, fixed=False)  # type: ignore[arg-type]
    assert (found["type"], found["id"], found["ns"]) == (number, 4, "world/it")
    assert tuple(found["scale"][axis] for axis in "xyz") == pytest.approx(extents)
