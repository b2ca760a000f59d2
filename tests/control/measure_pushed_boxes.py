"""Measure how a box is pushed by a stated force and by place: a table of
docs/data/results_contact.md.

    python tests/control/measure_pushed_boxes.py [--seeds 32] [--seed 4801] [--small]

Succeeded: completed, and the box moved by more than 0.2 m. Each flight has its own
friction and wind.
"""

import sys
from pathlib import Path

# the tests' own modules, when run as a program
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from pushed_boxes import worlds

from skyarm.scenario.scenario_file import scenario_from
from support.measured_tables import print_part
from support.worlds import beside_a_box, by_force, by_place

PUSHES = {"by force, until `distance`": by_force, "by place, with `go_to`": by_place}


def pushes(seeds, seed):
    """A batch a row."""
    for title, pushed in PUSHES.items():
        completed, way, _ = worlds(scenario_from(beside_a_box(pushed())), seeds, seed)
        yield (
            title,
            f"{(completed & (way > 0.2)).sum()} of {seeds}",
            f"{way.min():.2f}",
            f"{way.max():.2f}",
        )


HEADS = ("push", "succeeded", "shortest way, m", "longest way, m")

if __name__ == "__main__":
    print_part(__doc__, {"pushes": (HEADS, pushes)}, seeds=32, seed=4801)
