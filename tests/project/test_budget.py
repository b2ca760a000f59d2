"""The table of nightly cases names what is there."""

import json
import re
from pathlib import Path

from budget import ALWAYS, BUDGET, chosen, written

ROOT = Path(__file__).resolve().parents[2]
TABLE = json.loads(BUDGET.read_text("utf-8"))


def test_every_nightly_case_is_one_of_its_file():
    wrong = []
    for file, row in TABLE.items():
        path = ROOT / file
        functions = (
            set(re.findall(r"^ *def (test_\w+)", path.read_text("utf-8"), re.M))
            if path.is_file()
            else set()
        )
        wrong += [
            f"{file}: {name}"
            for name in row.get("nightly", ())
            if name.split("[")[0] not in functions
        ]
    assert wrong == [], "python tests/budget.py chooses anew"


def test_files_that_are_always_run_have_no_nightly_cases():
    assert all("nightly" not in TABLE.get(name, {}) for name in ALWAYS)


def test_the_slowest_cases_go_and_each_function_keeps_its_fastest():
    times = {
        "a.py": {"test_x[1]": 2.0, "test_x[2]": 0.4, "test_y": 0.01},
        "b.py": {"test_z": 1.0},
    }
    assert chosen(times, 10.0) == {"a.py": [], "b.py": []}
    nightly = chosen(times, 1.5)
    assert nightly == {"a.py": ["test_x[1]"], "b.py": []}
    table = written(times, nightly)
    assert table == {
        "a.py": {"seconds": 0.4, "nightly": ["test_x[1]"]},
        "b.py": {"seconds": 1.0},
    }
    assert written(times, {"a.py": ["test_x[1]", "test_x[2]"], "b.py": []})["a.py"][
        "nightly"
    ] == ["test_x"]
