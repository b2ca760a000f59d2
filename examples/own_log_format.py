"""A log format of one's own: skyarm run case3 --plugin own_log_format.py --log flight.tsv"""

from pathlib import Path

import numpy as np

import skyarm


def write(log: skyarm.Log, path: Path) -> Path:
    """Time, position and joints, a tab between them."""
    names = ["time", "x", "y", "z", *(f"joint{i}" for i in range(log.joints.shape[1]))]
    np.savetxt(path, np.column_stack([log.time, log.position, log.joints]), delimiter="\t", header="\t".join(names))
    return path


skyarm.register.log_format("tsv", title="time, position and joints in a tab-separated table")(skyarm.LogFormat(write))
