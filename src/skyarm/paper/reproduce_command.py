"""Command ``skyarm reproduce``: repeat the flights of Barakou et al. 2026."""

from __future__ import annotations

from skyarm.cli.arguments import Flying, On, Out, workers
from skyarm.cli.output import bar, give, tell
from skyarm.records.files import must_be_one_of


def reproduce(
    out: Out = "out/paper",
    plant: str = "both",
    flying: Flying = 0,
    on: On = None,
) -> None:
    """Repeat the flights of the paper by Barakou (2026).

    Five experiments with two controllers on two plants, and the variations behind the
    reasons: results.json, table2.md, Figures 3-18 and report.html. The same command
    continues what was interrupted (extra: sweep).

    Options:
        plant: rigid_body, mujoco or both
    """
    # imported in the call, so that other commands start without them
    from skyarm.paper.reproduce import prepare_folder
    from skyarm.paper.reproduce import reproduce as perform
    from skyarm.paper.verdict_sentences import verdict
    from skyarm.scenario.scenario_record import PLANTS
    from skyarm.studies.flights.executor import require_place

    if plant not in (*PLANTS, "both"):
        raise ValueError(
            f"--plant = {plant!r}: {must_be_one_of((*PLANTS, 'both'), plant)}"
        )
    processes = workers(flying)
    if on is not None:
        require_place(on, "--on")
    plants = PLANTS if plant == "both" else (plant,)
    prepare_folder(out, plants)
    with bar("flying") as advance:
        table = perform(
            out,
            plants=plants,
            workers=processes,
            on=on,
            progress=advance,
            note=tell,
        )
    give(table, folder=out)
    for words in verdict(table):
        tell(words)
    tell(
        f"results in {out}: report.html, table2.md, inference.md, results.json,"
        " figures/"
    )
