"""The search for the paper's unstated settings, carried out anew."""

from __future__ import annotations

import os
from typing import Any

from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.files import require_replaceable, require_writable
from skyarm.identify.identification import Progress, identify
from skyarm.paper.inferred_settings import FOUND, unstated_study


def infer(
    out: str | os.PathLike[str] = "out/paper", *, threads: int = 1, progress: Progress | None = None
) -> dict[str, Any]:
    """Search for the settings that the paper leaves open, with ladder, choices, profiles, rivals and predictions.

    Writes ``unstated_settings.json`` after every stage; called again it goes on where it was stopped, and flies nothing
    if all of it is there. Results do not depend on the number of threads.

    Args:
        out: folder, made if missing.
        threads: that fly.
        progress: called before every stage and at the end.

    Returns:
        The evidence, for :func:`skyarm.paper.reproduce.reproduce`.

    Raises:
        OSError: the folder or the file in it cannot be written; raised before any flight.
        NoMachineCodeError: before any flight; candidates fly in batches.
    """
    require_machine_code()
    file = require_writable(out) / FOUND
    require_replaceable(file)
    return identify(unstated_study(), file, threads=threads, progress=progress)
