"""Command ``skyarm film``: flights as a film, or as a recording for a 3-D viewer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, cast, get_args

from skyarm.cli.arguments import (
    Laws,
    OptionalOut,
    chosen_names,
    distinct_labels,
    label_of,
    law_names,
    require_distinct,
    require_left_out,
    word_completion,
)
from skyarm.cli.output import bar, give, tell
from skyarm.control.catalogue import require_different
from skyarm.log.flight_log import Log
from skyarm.log.formats import load_log
from skyarm.records.files import output_file, require_file, shown, taken_back
from skyarm.records.files.own_inputs import require_no_input
from skyarm.records.immutable import positional
from skyarm.scenario.scenario_file import list_scenarios, load_scenario
from skyarm.simulate import run
from skyarm.view.figures.flight_facts import flight_labels
from skyarm.view.film.film_flights import write_film
from skyarm.view.film.filmed_flight import require_as_many
from skyarm.view.film.make_film import Camera, FilmSettings, Layout, size_of
from skyarm.view.film.recording import SUFFIXES, import_viser
from skyarm.view.film.video_files import require_film_format, usual_size_and_rate

OF_FILMS = ("--size", "--fine", "--inset")
"""Options of films without effect on a recording, which has no pixels."""

PARTS = ("ghost", "plot")
"""Parts of the picture that may be left out: transparent desired pose, and tip error
below."""


def film(
    flights: list[str],
    out: OptionalOut = None,
    laws: Laws = None,
    label: list[str] | None = None,
    layout: str = "side",
    camera: Annotated[str, word_completion(*get_args(Camera))] = "follow",
    inset: str | None = None,
    size: str | None = None,
    fps: int | None = None,
    speed: float = 1.0,
    window: tuple[float, float] | None = None,
    without: str | None = None,
    fine: bool = False,
) -> None:
    """Film flights; MP4, WebP, or a 3-D recording.

    Options:
        flights FLIGHT...: logs or scenarios, NAME=FLIGHT labels one; then the file,
            unless -o
        out FILE: the film's file: .mp4 or .webp; .viser or .html for a 3-D recording
        label TEXT: label of a flight; repeat for each flight, in order
        layout: side: each flight in its own panel; over: all in one panel
        camera: follow, fixed, tip, or the name of a depth camera
        inset NAME: a depth camera or lidar, in a corner
        size WxH: pixels; 1280x720 if left out, 800x450 for .webp
        fps: frames per second; 30 if left out, 15 for .webp
        speed: seconds of flight per second of film
        window START STOP: the times that are filmed, s; the whole flight if left out
        without PARTS: leave out ghost (the desired pose), plot (the tip error), or
            ghost,plot
        fine: shadows and smooth edges; takes four times as long
    """
    # the last word is the film's file unless --out names it
    *flights, file = [*flights, *([] if out is None else [out])]
    if not flights:
        raise ValueError(
            "FILE: is missing: must be the film's file, by --out or as the last word"
        )
    path = Path(file)
    if path.suffix.removeprefix(".") in SUFFIXES:
        require_left_out(
            OF_FILMS, " of a recording, which is drawn where it is looked at"
        )
    start, stop = (0.0, None) if window is None else window
    left_out = () if without is None else chosen_names("--without", without, PARTS)
    usual = usual_size_and_rate(path)
    width, height = usual[:2] if size is None else size_of(size)
    settings = FilmSettings(
        layout=cast("Layout", layout),
        camera=camera,
        inset=inset,
        width=width,
        height=height,
        fps=usual[2] if fps is None else fps,
        speed=speed,
        start=start,
        stop=stop,
        ghost="ghost" not in left_out,
        plot="plot" not in left_out,
        fine=fine,
    )
    if file in list_scenarios():
        raise ValueError(
            f"FILE = {file!r}: must be the film's file, the last word; this is a"
            " scenario"
        )
    output_file(file, "FILE")
    recorded = require_film_format(path, SUFFIXES) in SUFFIXES
    with taken_back(path.parent):
        # before the flights: a missing renderer must not cost a flight
        _require_renderer(recorded=recorded)
        names = law_names(laws)
        require_different(names, "--laws")
        asked = _flights_of(flights, names)
        labelled = [each for each in asked if each.label]
        if labelled:
            require_left_out(["--label"], " beside NAME=FLIGHT")
            require_distinct(
                [each.word for each in labelled], [each.label for each in labelled]
            )
        elif label is not None:
            require_as_many(label, len(asked))
        logs = [_log_of(each, settings.stop) for each in asked]
        if labelled:
            label = distinct_labels(
                [each.word for each in asked],
                [each.label for each in asked],
                flight_labels(logs),
            )
        # a log may have been read under this name meanwhile
        require_no_input(path, "FILE")
        with bar("recording" if recorded else "filming") as advance:
            written = write_film(
                logs,
                path,
                settings,
                labels=label,
                progress=lambda done, total: advance(done, total, "frames"),
            )
    give(files=[written])
    tell(
        f"{'recording' if recorded else 'film'}: {written}"
        f" ({written.stat().st_size / 1e6:.2f} MB)"
    )


def _require_renderer(*, recorded: bool) -> None:
    """Raise an error if films or recordings cannot be made on this machine."""
    if recorded:
        import_viser()
    else:
        from skyarm.view.picture.offscreen import offscreen

        # only opening one tells whether this machine can
        with offscreen():
            pass


@positional
class _Flight:
    """Flight of a film: its word of the command line, label, log or scenario, and law.

    The label is empty if the word has none.
    """

    word: str
    label: str
    name: str
    law: str | None


def _flights_of(flights: Sequence[str], names: Sequence[str]) -> list[_Flight]:
    """Flights that the words of a command line denote: the named logs, and the named
    scenarios under each law.

    Raises:
        ValueError: one line: laws of a log, or no such file.
    """
    asked = list[_Flight]()
    for word in flights:
        label, name = label_of(word)
        if _is_flown(name):
            several = label and len(names) > 1
            # without names the scenario flies its own controller
            laws: Sequence[str | None] = names or [None]
            asked += [
                _Flight(word, f"{label}, {law}" if several else label, name, law)
                for law in laws
            ]
        elif names:
            raise ValueError(
                f"--laws = {names[0]!r}: must be left out, {name!r} is the log of a"
                " flight"
            )
        else:
            require_file(name, f"flight = {shown(name)}")
            asked.append(_Flight(word, label, name, None))
    return asked


def _is_flown(name: str) -> bool:
    """True if a name denotes a scenario that must be simulated first, not a log."""
    return Path(name).suffix in ("", ".toml") or name in list_scenarios()


def _log_of(flight: _Flight, stop: float | None) -> Log:
    """Load the log of a flight, or simulate it up to the end of the filmed interval."""
    if not _is_flown(flight.name):
        return load_log(flight.name)
    planned = load_scenario(flight.name, controller=flight.law)
    if stop is not None and stop < planned.duration:
        # its own duration was known only once it was read
        planned = load_scenario(flight.name, controller=flight.law, duration=stop)
    with bar(f"{planned.name} {flight.law or ''}".strip()) as advance:
        return run(planned, advance)
