"""Command ``skyarm reproduce``: repeat the flights of the paper."""

from __future__ import annotations

from typing import Annotated

import typer

from skyarm.cli.arguments import Out, workers
from skyarm.cli.output import bar, give, tell
from skyarm.records.files import must_be_one_of


def reproduce(
    out: Out = "out/paper",
    plant: Annotated[str, typer.Option(help="rigid_body, mujoco or both")] = "both",
    flying: Annotated[int, typer.Option("--workers", help="processes that fly; 0 takes every core")] = 0,
) -> None:
    """Repeat the flights of the paper by Barakou (2026).

    Five experiments with two controllers on two plants, and the variations behind the reasons: results.json, table2.md,
    Figures 3-18 and report.html.
    """
    from skyarm.paper.counted_cells import sentence
    from skyarm.paper.reproduce import prepare_folder
    from skyarm.paper.reproduce import reproduce as perform
    from skyarm.scenario.scenario_record import PLANTS

    if plant not in (*PLANTS, "both"):
        raise ValueError(f"--plant = {plant!r}: {must_be_one_of((*PLANTS, 'both'), plant)}")
    processes = workers(flying)
    plants = PLANTS if plant == "both" else (plant,)
    prepare_folder(out, plants)
    with bar("flying") as advance:
        table = perform(
            out,
            plants=plants,
            workers=processes,
            progress=advance,
            note=tell,
        )
    give(table, folder=out)
    tell(sentence(table))
    tell(f"results in {out}: report.html, table2.md, inference.md, results.json, figures/")
