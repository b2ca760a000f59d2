"""Measure size and time of exported controllers: the table of
docs/data/export_c.md.

    python tests/control/onboard/measure_export.py [--small]

By the C compiler ``cc`` with ``-O2``, in double; needs ``size`` of the binary
utilities.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

from exported_sizes import built, nanoseconds_of, stack_of

from skyarm.control.onboard.export_c import export_c
from support.engines import object_file
from support.measured_tables import print_table

LAWS = (("hummingbird_arm2", "paper_ct"), ("hexarotor_arm6", "hybrid_computed_torque"))


def rows(laws: Sequence[tuple[str, str]], calls: int) -> Iterator[list[object]]:
    """A law on a vehicle a row."""
    for vehicle, name in laws:
        controller = built(vehicle, name)
        exported = export_c(controller, name="law", period=0.005)
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made)
            target = object_file(exported.text, folder, ("-O2",))
            told = subprocess.run(
                ["size", str(target)], capture_output=True, text=True, check=True
            ).stdout
            code = sum(map(int, told.splitlines()[1].split()[:2]))
            stack = stack_of(exported.text, folder / "usage")
            step = nanoseconds_of(controller, vehicle, folder, calls)
        sizes = [
            exported.operations,
            len(exported.parameters),
            stack or "",
            code,
            f"{step:.0f}",
        ]
        yield [f"`{name}` on `{vehicle}`", *sizes]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--small", action="store_true", help="one law, few calls")
    small = parser.parse_args().small
    heads = (
        "law",
        ">operations",
        ">parameters",
        ">stack, bytes",
        ">code and constants, bytes",
        ">ns a step",
    )
    print_table(heads, rows(LAWS[:1], 1000) if small else rows(LAWS, 500_000))


if __name__ == "__main__":
    main()
