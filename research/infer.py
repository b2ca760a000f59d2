"""Search for the settings that the paper leaves open: ``python research/infer.py --out
out/paper``.

Takes minutes; the same command continues. The report of the paper is then written with
what was found.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from inference.checks import checked_study
from inference.identification import Progress, identify
from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.paper.inference_tables import evidence_tables
from skyarm.paper.inferred_settings import FOUND, LIBRARY, STUDY
from skyarm.paper.reproduce import prepare_folder, reproduce
from skyarm.records.files import require_replaceable, require_writable
from skyarm.scenario.scenario_record import PLANTS


def infer(
    out: str | os.PathLike[str] = "out/paper",
    *,
    threads: int = 1,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Search for the settings that the paper leaves open, with ladder, choices,
    profiles, rivals and predictions.

    Writes ``unstated_settings.json`` after every stage; called again it continues where
    it was stopped, and flies nothing if all of it is there. Results do not depend on
    the number of threads.

    Args:
        out: folder, made if missing.
        threads: that fly.
        progress: called before every stage and at the end.

    Returns:
        The evidence, for :func:`skyarm.paper.reproduce.reproduce`.

    Raises:
        OSError: the folder or the file in it cannot be written; raised before any
            flight.
        NoMachineCodeError: before any flight; candidates fly in batches.
    """
    require_machine_code()
    file = require_writable(out) / FOUND
    require_replaceable(file)
    return identify(
        checked_study((LIBRARY / STUDY).read_bytes(), Path(), STUDY),
        file,
        threads=threads,
        progress=progress,
    )


def main() -> None:
    """Search, print the evidence, and reproduce the paper with it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--out", default="out/paper", help="folder for the results, made if missing"
    )
    parser.add_argument(
        "--plant", choices=PLANTS, action="append", help="left out: all of them"
    )
    parser.add_argument(
        "--workers", type=int, default=os.cpu_count() or 1, help="threads and processes"
    )
    asked = parser.parse_args()
    plants = tuple(asked.plant or PLANTS)
    prepare_folder(asked.out, plants)
    evidence = infer(
        asked.out,
        threads=asked.workers,
        progress=lambda done, of, name: print(f"{done} of {of} {name}"),
    )
    for table in evidence_tables(evidence):
        print(f"\n{table.caption}\n{table.markdown(table.caption)}")
    reproduce(asked.out, plants=plants, workers=asked.workers, evidence=evidence)


if __name__ == "__main__":
    main()
