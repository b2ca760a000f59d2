"""Log formats of your own: a table with tabs, and one that can be read back.

A function that writes a log is registered under the suffix of its files. It is called
once, after the flight, and not compiled, so it may use any package. npz, CSV and MCAP
ship with skyarm. To read measured flights of a real vehicle, register a flight_format.
"""

import json
import tempfile
from pathlib import Path

import numpy as np

import skyarm
from skyarm.log.flight_log import log_of_arrays


# Arrays of the log are fields, log.arrays() has all of them, log.units their units, and
# log.info facts of the flight. The result is the path of the file that was written,
# which may be another one; skyarm checks that it is there.
def write(log: skyarm.Log, path: Path) -> Path:
    """Time, position and joints, a tab between them."""
    names = ["time", "x", "y", "z", *(f"joint{i}" for i in range(log.joints.shape[1]))]
    table = np.column_stack([log.time, log.position, log.joints])
    # 17 digits keep every number; the head begins with "# ", which NumPy skips
    np.savetxt(path, table, fmt="%.17g", delimiter="\t", header="\t".join(names))
    return path


title = "time, position and joints in a tab-separated table"
skyarm.register.log_format("tsv", title=title)(skyarm.LogFormat(write))


# A format that can be read back holds every array in double precision, and log.info. A
# file without ``read`` is refused by skyarm show, plot, diff and film.
def write_whole(log: skyarm.Log, path: Path) -> Path:
    """Every array and the facts of the flight."""
    with path.open("wb") as file:
        np.savez(file, info=json.dumps(log.info), **log.arrays())
    return path


def read_whole(path: Path) -> skyarm.Log:
    """The log that was written."""
    arrays = dict(np.load(path))
    return log_of_arrays(arrays, json.loads(str(arrays.pop("info"))))


whole = skyarm.LogFormat(write_whole, read_whole)
skyarm.register.log_format("whole", title="the whole log")(whole)

# skyarm run case3 --plugin own_log_format.py --log flight.tsv writes the table, and
# skyarm export flight.npz --to tsv --plugin own_log_format.py converts an earlier log.
# Equal flights have equal files only if your function writes the same bytes again.
if __name__ == "__main__":
    log = skyarm.run(skyarm.load_scenario("case3", duration=10.0))
    with tempfile.TemporaryDirectory() as folder:
        table, copy = Path(folder, "flight.tsv"), Path(folder, "flight.whole")
        skyarm.save_log(log, table)
        print(*table.read_text().splitlines()[1].split())  # 0 0 0 1 0 0
        back = np.loadtxt(table)
        print(*back.shape, np.array_equal(back[:, 1:4], log.position))  # 2000 6 True
        skyarm.save_log(log, copy)
        again = skyarm.load_log(copy).arrays()
        same = [np.array_equal(x, again[name]) for name, x in log.arrays().items()]
        print("every array came back:", all(same))  # every array came back: True
