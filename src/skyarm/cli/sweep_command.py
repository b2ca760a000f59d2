"""Command ``skyarm sweep``: episodes of a study and their statistics."""

from __future__ import annotations

import shlex
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from skyarm.cli.arguments import (
    Flying,
    Laws,
    On,
    OptionalOut,
    law_names,
    name_completion,
    require_left_out,
    require_not_another,
    shipped_names,
    workers,
)
from skyarm.cli.lines import say, say_unlikely
from skyarm.cli.output import bar, give, json_text, tell
from skyarm.records.files import (
    errors_as,
    file_names,
    must_be_one_of,
    require_no_link,
    require_writable,
    shown,
    taken_back,
    write_inside,
)
from skyarm.records.files.earlier_files import edits_kept

if TYPE_CHECKING:
    from skyarm.studies.sweep.maps import RobustnessMap
    from skyarm.studies.sweep.stats import Pictures
    from skyarm.studies.sweep.study import Study

DPI = 160


def sweep(
    study: Annotated[str, name_completion("study")],
    laws: Laws = None,
    out: OptionalOut = None,
    flying: Flying = 0,
    on: On = None,
    part: str | None = None,
    save: list[str] | None = None,
    success: list[str] | None = None,
    paths: Annotated[tuple[str, str] | None, typer.Option("--map")] = None,
) -> None:
    """Fly a study's episodes, or sum up the folder of a sweep.

    Rows are Parquet; the same command continues what was interrupted. Of a folder:
    success rates, quantiles, paired differences and maps, as report.html and
    stats.json. With --save nothing is flown: an episode's number, or of the rows the
    first without success or with the largest value of a metric, becomes a file for
    'skyarm run'.

    Options:
        study STUDY|FOLDER: a study (.toml or a shipped name), or the folder of a sweep
        out FOLDER: folder of results; if left out: out/NAME, with a folder FOLDER/stats
        part K/N: fly the K-th of N parts, each on a machine with the same folder
        save EPISODE: with a study: save as a scenario: a number, failed or a metric;
            repeat
        success METRIC=LARGEST: with a folder: largest value of a metric in a success;
            repeat
        paths X Y: with a folder: two varied numbers, the horizontal and vertical axis
    """
    if study not in shipped_names("study") and Path(study).is_dir() and study:
        # a shipped study goes before a folder of its name
        require_left_out(
            ["--laws", "--workers", "--on", "--part", "--save"],
            " with the folder of a sweep",
        )
        _sum_up(study, out, success, paths)
        return
    require_left_out(["--success", "--map"], "; only the folder of a sweep has it")
    if save:
        require_left_out(
            ["--workers", "--on", "--part"], " with --save: nothing is flown"
        )
        _save_episodes(study, law_names(laws) or None, out, save)
    else:
        _fly(study, law_names(laws) or None, out, workers(flying), on, part)


def _load(study: str, controllers: list[str] | None) -> Study:
    """Load a study without warnings about parameters of its file that each episode
    replaces.
    """
    from skyarm.scenario.without_effect import WithoutEffectWarning
    from skyarm.studies.sweep import load_study

    require_not_another(study, "study")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", WithoutEffectWarning)
        return load_study(study, controllers)


LONGEST_NUMBER = 20
"""Largest number of digits of an episode's index."""


def _save_episodes(
    study: str, controllers: list[str] | None, out: str | None, episodes: list[str]
) -> None:
    """Write episodes of a study as scenario files, chosen by number, first failure or
    largest metric value.
    """
    from skyarm.studies.sweep.plan import prepare, save_episode
    from skyarm.studies.sweep.stats import FAILED, Rows
    from skyarm.studies.sweep.study import StudyError

    loaded = _load(study, controllers)
    folder = Path("out") / loaded.name if out is None else Path(out)
    named = (
        FAILED,
        *loaded.metrics,
    )
    for which in episodes:
        if not which.isdecimal() and which not in named:
            raise StudyError(
                f"--save = {shown(which)}: {must_be_one_of(named, which)}, or a number"
            )
        if which.isdecimal() and (
            len(which) > LONGEST_NUMBER or int(which) >= loaded.episodes
        ):
            raise StudyError(
                f"--save = {shown(which)}: must be less than {loaded.episodes}, the"
                f" episodes of {study}"
            )
    rows = (
        None
        if all(each.isdecimal() for each in episodes)
        else Rows(folder, loaded.success)
    )
    # an episode's number means nothing in rows of another study
    if rows is not None and not rows.manifest.is_of(prepare(loaded).manifest):
        raise StudyError(
            f"{folder}: holds rows of another study than {study}; choose its --out"
        )
    names = file_names(loaded.scenarios, "", ".toml")
    meant = list[tuple[str, int]]()
    with errors_as(StudyError, "--save = ", of=StudyError):
        for which in episodes:
            absent = list[StudyError]()
            before = len(meant)
            for label in loaded.scenarios:
                try:
                    episode = (
                        int(which)
                        if rows is None or which.isdecimal()
                        else rows.episode(label, which)
                    )
                    meant.append((label, episode))
                except StudyError as error:
                    # of one controller, whose others may have such an episode
                    absent.append(error)
            # none of the controllers has such an episode
            if len(meant) == before:
                raise absent[0]
            for each in absent:
                say(f"note: --save = {each}")
    files = []
    for label, episode in meant:
        file = folder / f"episode_{episode}_{names[label]}"
        with edits_kept(file):
            files.append(save_episode(file, loaded, label, episode))
    tell(*(f"skyarm run {shlex.quote(str(file))}" for file in files))
    give(study=loaded.name, folder=folder, files=files)


def _fly(
    study: str,
    controllers: list[str] | None,
    out: str | None,
    count: int,
    on: str | None,
    part: str | None,
) -> None:
    """Run the missing episodes of a study, and write them to its folder."""
    from skyarm.scenario.unlikely_numbers import unlikely_numbers
    from skyarm.studies.flights.executor import LOCAL, require_place
    from skyarm.studies.sweep import run_sweep
    from skyarm.studies.sweep.plan import largest_episode

    place = require_place(LOCAL if on is None else on, "--on")
    loaded = _load(study, controllers)
    folder = Path("out") / loaded.name if out is None else Path(out)
    say_unlikely(loaded.name, unlikely_numbers(largest_episode(loaded)))
    begin = time.perf_counter()
    # episodes that were there at the first call took no time, and are no rate
    before = list[int]()
    laws = len(loaded.scenarios)
    with taken_back(folder), bar(loaded.name) as advance:
        require_writable(folder if out is None else out)

        def progress(done: int, total: int) -> None:
            if not before:
                before.append(done)
            # 1e-9 s keeps the first rate finite
            rate = (done - before[0]) * laws / max(time.perf_counter() - begin, 1e-9)
            advance(done * laws, total * laws, f"flights, {rate:.0f} a second")

        summary = run_sweep(
            loaded, folder, workers=count, on=place, part=part, progress=progress
        )
    flights = summary.flown * laws
    stored = f", {summary.found * laws} were there" if summary.found else ""
    tell(
        f"{summary.rows} flights in {folder}: {loaded.episodes} episodes under"
        f" {', '.join(loaded.scenarios)}; {flights} flown in {summary.seconds:.1f}"
        f" s{stored}",
        f"next: skyarm sweep {_argument(folder)}",
    )
    give(
        study=loaded.name,
        folder=folder,
        rows=summary.rows,
        episodes=loaded.episodes,
        controllers=list(loaded.scenarios),
        flights=flights,
        seconds=summary.seconds,
        episodes_there_before=summary.found,
    )


def _argument(folder: Path) -> str:
    """Folder as an argument of the command, whose shipped studies go before folders of
    their names.
    """
    return shlex.quote(
        f"./{folder}" if str(folder) in shipped_names("study") else str(folder)
    )


def _sum_up(
    folder: str,
    out: str | None,
    success: list[str] | None,
    paths: tuple[str, str] | None,
) -> None:
    """Compute statistics of a sweep's episodes, and write them as JSON and HTML."""
    from skyarm.studies.sweep.maps import robustness_maps
    from skyarm.studies.sweep.stats import Rows, page, parse_limits, statistics, summary

    rows = Rows(Path(folder))
    if success:
        rows = Rows(Path(folder), rows.limits | parse_limits(success))
    with bar(f"statistics of {folder}"):
        maps = robustness_maps(rows, paths)
        # a link could lead out of the folder, so only the default place is guarded
        target = require_writable(
            require_no_link(Path(folder) / "stats") if out is None else out
        )
        results, pictures = statistics(rows), _draw_maps(maps)
    write_inside(target / "stats.json", json_text(results).encode())
    write_inside(
        target / "report.html", page(results, rows.manifest, pictures).encode()
    )
    files = ["report.html", "stats.json", *pictures.write(target, rows.controllers)]
    give(results, folder=target, files=files)
    tell(*summary(results), f"statistics in {target}: {', '.join(files)}")


def _draw_maps(maps: Sequence[RobustnessMap]) -> Pictures:
    """Draw the robustness map of each controller; a constant map becomes a number."""
    from skyarm.studies.sweep.stats import Pictures
    from skyarm.studies.sweep.sweep_figures import robustness_figure
    from skyarm.view.figures.style import image_bytes

    return Pictures(
        maps={
            each.controller: image_bytes(robustness_figure(each), dpi=DPI)
            for each in maps
            if each.constant is None
        },
        constant={
            each.controller: each.constant for each in maps if each.constant is not None
        },
    )
