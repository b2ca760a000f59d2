"""``skyarm film``: flights as a film, or as a recording that is looked at from any side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from skyarm.cli.app import app, console, require_left_out, tell
from skyarm.cli.lines import say_if_many
from skyarm.cli.machine_output import give
from skyarm.cli.progress import bar

OF_FILMS = ("--size", "--title", "--plot", "--fine")
"""Options without which a recording does: it has neither pixels nor a text above them."""


@app.command()
def film(
    context: typer.Context,
    flights: Annotated[
        list[str], typer.Argument(metavar="FLIGHT...", help="logs, or scenarios (names or .toml) that are flown first")
    ],
    file: Annotated[
        str, typer.Argument(metavar="FILE", help=".mp4, .webp, .gif; .viser or .html, or a folder: a recording")
    ],
    controller: Annotated[
        list[str] | None, typer.Option(metavar="LAW", help="fly each scenario with it; names or FILE.py:make; repeat")
    ] = None,
    label: Annotated[list[str] | None, typer.Option(metavar="TEXT", help="name of each flight in turn; repeat")] = None,
    title: Annotated[str | None, typer.Option(help="above the pictures, in place of the scenario's")] = None,
    layout: Annotated[str, typer.Option(help="side (a picture for each flight) or over (all in one)")] = "side",
    camera: Annotated[str, typer.Option(help="follow, fixed, orbit or tip")] = "follow",
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="pixels [1280x720; of .webp and .gif 800x450]")
    ] = None,
    fps: Annotated[int | None, typer.Option(help="frames a second [30; of .webp and .gif 15]")] = None,
    speed: Annotated[float, typer.Option(help="seconds of flight a second of film")] = 1.0,
    start: Annotated[float, typer.Option(help="s of flight at which it begins")] = 0.0,
    stop: Annotated[float | None, typer.Option(help="s of flight at which it ends")] = None,
    ghost: Annotated[bool, typer.Option("--ghost/--no-ghost", help="the desired pose, see-through")] = True,
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="the tip's error below")] = True,
    fine: Annotated[bool, typer.Option("--fine", help="shadows and smooth edges: four times as long")] = False,
) -> None:
    """Film flights; MP4, WebP, GIF, or a 3-D recording.

    Each flight is a log of 'skyarm run', or a scenario that is flown now, with every --controller. A recording is a
    scene in three dimensions that plays in a browser: NAME.viser alone, NAME.html with its player, or a folder of both
    to be served.
    """
    from skyarm.film.film_settings import FilmSettings, size_of
    from skyarm.film.recording import SUFFIXES
    from skyarm.film.video_files import usual_size_and_rate

    if Path(file).suffix.removeprefix(".") in ("", *SUFFIXES):
        require_left_out(context, OF_FILMS, " of a recording, which is drawn where it is looked at")
    usual = usual_size_and_rate(Path(file))
    width, height = usual[:2] if size is None else size_of(size)
    settings = FilmSettings(
        layout=layout,
        camera=camera,
        width=width,
        height=height,
        fps=usual[2] if fps is None else fps,
        speed=speed,
        start=start,
        stop=stop,
        ghost=ghost,
        plot=plot,
        fine=fine,
        title=title,
    )
    written, more = perform(flights, file, settings, controller, label)
    give(files=written)
    for path in written:
        tell(f"{'film' if more is None else 'recording'}: {path} ({path.stat().st_size / 1e6:.2f} MB)")
    if more:
        tell(more)


def perform(
    flights: Sequence[str], file: str, settings: Any, controllers: Sequence[str] | None, labels: Sequence[str] | None
) -> tuple[list[Path], str | None]:
    """Fly what is no log, film all.

    Returns:
        What was written, and of a recording what to do with it: None for a film.

    Raises:
        ValueError, OSError: one line.
    """
    from skyarm.files import output_file, require_writable, taken_back
    from skyarm.film.recording import SUFFIXES, import_viser, record, save_recording
    from skyarm.film.video_files import require_film_format
    from skyarm.scenario.scenario_file import list_scenarios

    path = Path(file)
    if file in list_scenarios():
        raise ValueError(f"FILE = {file!r}: must be the film's file or folder, the last word; this is a scenario")
    folder = bool(file) and (not path.suffix or path.is_dir() or file.endswith("/"))
    with taken_back(path if folder else path.parent):
        if not folder:
            films = require_film_format(path, SUFFIXES) is not None if file else False
            output_file(file, "FILE")
        else:
            films = False
            require_writable(file)
        if films:
            return [_filmed(flights, path, settings, controllers, labels)], None
        import_viser()
        logs = _logs(flights, controllers, settings)
        with bar("recording", console) as advance:
            recording = record(
                logs, settings, labels=labels, progress=lambda done, total: advance(done, total, "frames")
            )
        written = save_recording(recording, path)
    return written, f"to see it: python -m http.server --bind 127.0.0.1 --directory {file} 8000" if folder else ""


def _filmed(
    flights: Sequence[str], path: Path, settings: Any, controllers: Sequence[str] | None, labels: Sequence[str] | None
) -> Path:
    """Film into one file; that nothing can be drawn here is said before anything is flown."""
    from skyarm.film.make_film import make_film
    from skyarm.film.offscreen import offscreen

    with offscreen():
        pass
    logs = _logs(flights, controllers, settings)
    with bar("filming", console) as advance:
        return make_film(
            logs, path, settings, labels=labels, progress=lambda done, total: advance(done, total, "frames")
        )


def _logs(flights: Sequence[str], controllers: Sequence[str] | None, settings: Any) -> list[Any]:
    """The logs that are named, and those of the scenarios that are flown."""
    from skyarm.log.formats import load_log

    laws: Sequence[str | None] = [word for each in controllers or () for word in each.split(",") if word] or [None]
    found = []
    for name in flights:
        if _is_flown(name):
            found += [_fly(name, law, settings.stop) for law in laws]
        elif controllers:
            raise ValueError(f"--controller = {controllers[0]!r}: must be left out, {name!r} is the log of a flight")
        else:
            found.append(load_log(name))
    return found


def _is_flown(name: str) -> bool:
    """Whether a word names a scenario, which is flown, and no log."""
    from skyarm.scenario.scenario_file import list_scenarios

    return Path(name).suffix in ("", ".toml") or name in list_scenarios()


def _fly(name: str, law: str | None, stop: float | None) -> Any:
    """Fly a scenario, no longer than it is filmed."""
    from skyarm.scenario.scenario_file import load_scenario
    from skyarm.simulate import run

    planned = load_scenario(name, controller=law)
    if stop is not None and stop < planned.duration:
        planned = load_scenario(name, controller=law, duration=stop)
    say_if_many(planned.name, planned.world.vehicle.n)
    with bar(f"{planned.name} {law or ''}".strip(), console) as advance:
        return run(planned, lambda done, total: advance(done, total, ""))
