"""Messages of a recorded flight as rosbags reads them, and frames composed of its
transforms.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

rosbags = pytest.importorskip("rosbags.highlevel", reason="needs the extra 'logs'")
Rotation = pytest.importorskip("scipy.spatial.transform").Rotation


def by_rosbags(path: Path):
    """Topic -> (type, times in ns, messages), and how many were the same bytes once
    written again.
    """
    found, same = {}, 0
    with rosbags.AnyReader([path]) as reader:
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            store = reader.typestore
            same += bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(
                raw
            )
            _, times, messages = found.setdefault(
                connection.topic, (connection.msgtype, [], [])
            )
            times.append(time)
            messages.append(message)
    return found, same


def composed(tree, name):
    """Rotation and position of a frame in the world."""
    R, p = np.eye(3), np.zeros(3)
    while name != "world":
        moved = tree[name]
        q, t = moved.transform.rotation, moved.transform.translation
        turn = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
        R, p, name = turn @ R, turn @ p + [t.x, t.y, t.z], moved.header.frame_id
    return R, p
