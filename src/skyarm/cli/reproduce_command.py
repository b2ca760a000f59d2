"""Command ``skyarm reproduce``: repeat the flights of the paper."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from skyarm.cli.arguments import Out, workers
from skyarm.cli.output import bar, give, table_of, tell
from skyarm.records.files import must_be_one_of

HEADLINE = (
    ("case1", "PD", "held_position_error"),
    ("case2", "CT", "position_error_mean"),
    ("case2", "PD", "position_error_mean"),
    ("case2", "PD", "pitch_rms"),
    ("case3", "CT", "ee_error_mean"),
    ("case3", "PD", "ee_error_mean"),
    ("case2_gust", "CT", "peak_x"),
    ("case2_gust", "PD", "peak_x"),
    ("case3_wind", "CT", "ee_error_mean"),
    ("case3_wind", "PD", "ee_error_mean"),
)
"""Cells of the short table that ``reproduce`` prints; all others are in table2.md."""


def reproduce(
    out: Out = "out/paper",
    plant: Annotated[str, typer.Option(help="rigid_body, mujoco or both")] = "both",
    flying: Annotated[int, typer.Option("--workers", help="processes that fly; 0 takes every core")] = 0,
) -> None:
    """Fly the paper; write tables, figures, report.

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
    tell(sentence(table), _headline(table))
    tell(f"results in {out}: report.html, table2.md, inference.md, results.json, figures/")


def _headline(results: dict[str, Any]) -> Any:
    """Table of the paper's main results next to the results computed here."""
    from skyarm.paper.flights import first_plant
    from skyarm.paper.published import digits, percent, published_number
    from skyarm.scenario.scenario_record import PLANTS

    columns = [f"{which}{each}" for which in ("", "inferred ") for each in PLANTS]
    plant, rows = first_plant(results), []
    for case, controller, metric in HEADLINE:
        cell = results["experiments"][case][controller][metric]
        ours = (digits(column.get(each)) for column in (cell, cell.get("inferred", {})) for each in PLANTS)
        stated = published_number(case, controller, metric) or "-"
        rows.append((case, controller, metric, stated, *ours, percent(cell.get(plant), cell["paper"])))
    heads = ("case", "", "metric", "paper", *columns, "difference")
    return table_of(heads, rows, left=3, title="paper and ours (m, rad)")
