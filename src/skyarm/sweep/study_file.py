"""Studies from TOML files.

A file has ``schema = 1`` and::

    name, title      of the study
    scenario         name of a shipped scenario, or the path of a file beside this one
    controllers      presets that fly the same draws; left out: the scenario's own controller
    duration         s, in place of the scenario's
    episodes         how many; in a grid design a multiple of its cells, or left out: one a cell
    seed             of draws and noise (0)
    chunk            episodes of one file of rows (4096)
    precision        "double", "single" or "exact" (double)
    design           "random", "grid" or "sobol" (random)
    metrics          names and groups (["standard"]); what is not asked for costs no time
    windows          steady, transient, gust, hover: [start, stop) in s ([10, 20], [0, 8], [5, 20], [4, 5.9]);
                     holds: a list of such ([[9, 12], [16, 19]]); last: s before the end (5)
    [vary]           "dotted.path" = { uniform = [low, high] } | { normal = [mean, std] } |
                     { log_uniform = [low, high] } | { list = [...] } | { grid = [start, stop, count] }
    [success]        metric = largest value; an episode that ended early is never a success

Every error is one line: file, field, value, what is allowed.
"""

from __future__ import annotations

import dataclasses
import os
import tomllib
from collections.abc import Mapping
from importlib import resources
from math import prod
from pathlib import Path
from typing import Any

from skyarm.files import Fields, number, shown
from skyarm.simulate.measures import Windows, metric_names
from skyarm.simulate.metrics import Window
from skyarm.simulate.paths import DERIVED, number_at, with_numbers
from skyarm.simulate.scenario import Scenario, check_name, noise_key
from skyarm.simulate.scenario_file import list_scenarios, load_scenario
from skyarm.sweep.distributions import Distribution, Values, distribution_from
from skyarm.sweep.sobol import DIMENSIONS
from skyarm.sweep.study import DESIGNS, PRECISIONS, Study, StudyError

LIBRARY = resources.files("skyarm.sweep") / "studies"

LARGEST_CHUNK = 2**20
"""Episodes of one file: a chunk is held in memory, about 300 bytes an episode and controller."""

MOST_EPISODES = 2**32
"""The noise generator numbers episodes with 32 bits."""


def list_studies() -> tuple[str, ...]:
    """Names of the shipped studies."""
    return tuple(sorted(Path(entry.name).stem for entry in LIBRARY.iterdir() if entry.name.endswith(".toml")))


def load_study(name_or_path: str | os.PathLike[str]) -> Study:
    """Study from the library by name or from a .toml file.

    Raises:
        StudyError: one line, ``file: field = value: what is allowed``.
    """
    text = os.fspath(name_or_path)
    known = f"shipped studies are {', '.join(list_studies())}"
    path = Path(text)
    if text in list_studies():
        content, folder = (LIBRARY / f"{text}.toml").read_bytes(), Path()
    elif path.suffix != ".toml":
        raise StudyError(f"study = {text!r}: must be the path of a .toml file or a name; {known}")
    else:
        try:
            content, folder = path.read_bytes(), path.parent
        except OSError as error:
            raise StudyError(f"study = {text!r}: must be a readable file ({error.strerror}); {known}") from None
    try:
        return study_from(tomllib.loads(content.decode("utf-8")), folder, source=text)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise StudyError(f"{text}: TOML = {str(error)!r}: must be valid TOML in UTF-8") from None
    except RecursionError:
        raise StudyError(f"{text}: TOML = tables in tables: must not be nested this deep") from None
    except ValueError as error:
        raise StudyError(f"{text}: {error}") from None


def study_from(document: Mapping[str, Any], folder: str | os.PathLike[str] = "", *, source: str = "study") -> Study:
    """Study that a TOML document describes.

    Args:
        document: plain tables, as read from TOML.
        folder: where its scenario's path starts.
        source: what messages call it.

    Raises:
        StudyError: one line with field, value and what is allowed.
    """
    try:
        return _study(Fields(dict(document), ""), Path(folder), source)
    except ValueError as error:
        raise StudyError(" ".join(str(error).split())) from None


def _study(top: Fields, folder: Path, source: str) -> Study:
    schema = top.take("schema")
    if schema != 1 or isinstance(schema, bool):
        raise ValueError(f"schema = {shown(schema)}: must be 1")
    name, title = top.take("name"), top.take("title", "")
    check_name(name)
    if not isinstance(title, str):
        raise ValueError(f"title = {shown(title)}: must be text")
    design = top.choice("design", DESIGNS, "random")
    vary = _vary(top.take("vary", {}), design)
    seed = top.take("seed", 0)
    noise_key("seed", seed)
    chosen: dict[str, Any] = {
        "design": design,
        "episodes": _episodes(top, design, vary),
        "seed": seed,
        "chunk": _whole("chunk", top.take("chunk", 4096), LARGEST_CHUNK),
        "precision": top.choice("precision", PRECISIONS, "double"),
        "windows": _windows(top),
    }
    scenarios = _scenarios(top, folder, list(vary))
    chosen["metrics"] = _metrics(top, next(iter(scenarios.values())).world.vehicle.n)
    success = _success(top, chosen["metrics"])
    top.done()
    told = {key: top.table.get(key) for key in ("scenario", "controllers", "duration", "vary")}
    document = {"schema": 1, "name": name, **told, **chosen, "windows": dataclasses.asdict(chosen["windows"])}
    return Study(
        name=name,
        title=title,
        source=source,
        scenarios=scenarios,
        vary=vary,
        success=success,
        document=document,
        **chosen,
    )


def _whole(at: str, value: Any, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
        raise ValueError(f"{at} = {shown(value)}: must be a whole number from 1 to {most}")
    return value


def _vary(table: Any, design: str) -> dict[str, Distribution]:
    fields = Fields(table, "vary")
    vary = {path: distribution_from(value, f'vary."{path}"') for path, value in fields.table.items()}
    if design == "sobol" and not 1 <= len(vary) <= DIMENSIONS:
        raise ValueError(f"vary = {len(vary)} numbers: must be 1 to {DIMENSIONS} in a sobol design")
    if design == "grid" and not any(isinstance(each, Values) for each in vary.values()):
        raise ValueError(f"design = {design!r}: must come with a grid or a list under vary")
    return vary


def _episodes(top: Fields, design: str, vary: Mapping[str, Distribution]) -> int:
    if design != "grid":
        return _whole("episodes", top.take("episodes"), MOST_EPISODES)
    cells = prod(len(each.values) for each in vary.values() if isinstance(each, Values))
    episodes = _whole("episodes", top.take("episodes", cells), MOST_EPISODES)
    if episodes % cells:
        raise ValueError(f"episodes = {episodes}: must be a multiple of the grid's {cells} cells")
    return episodes


def _windows(top: Fields) -> Windows:
    fields, known = Fields(top.take("windows", {}), "windows"), Windows()
    found: dict[str, Any] = {}
    for name in ("steady", "transient", "gust", "hover"):
        default = getattr(known, name)
        found[name] = _window(fields.take(name, [default.start, default.stop]), fields.at(name))
    holds = fields.take("holds", [[each.start, each.stop] for each in known.holds])
    if not isinstance(holds, list):
        raise ValueError(f"windows.holds = {shown(holds)}: must be a list of [start, stop] in s")
    found["holds"] = tuple(_window(each, f"windows.holds[{i}]") for i, each in enumerate(holds))
    found["last"] = fields.number("last", known.last, low=0.0, strict=True)
    fields.done()
    return Windows(**found)


def _window(value: Any, at: str) -> Window:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{at} = {shown(value)}: must be [start, stop] in s")
    start, stop = (number(item, f"{at}[{i}]", low=0.0) for i, item in enumerate(value))
    if not start < stop:
        raise ValueError(f"{at} = {shown(value)}: must start before it stops")
    return Window(start, stop)


def _metrics(top: Fields, joints: int) -> tuple[str, ...]:
    """Names of the metrics of the rows."""
    wanted = top.take("metrics", ["standard"])
    if not isinstance(wanted, list) or not wanted:
        raise ValueError(f"metrics = {shown(wanted)}: must be a list of names")
    return metric_names(wanted, joints)


def _scenarios(top: Fields, folder: Path, paths: list[str]) -> dict[str, Scenario]:
    """The scenario as each controller flies it, its varied numbers made data."""
    named = top.take("scenario")
    if not isinstance(named, str):
        raise ValueError(f"scenario = {shown(named)}: must be the name of a shipped scenario or a path")
    controllers = top.take("controllers", None)
    if controllers is not None and (
        not isinstance(controllers, list)
        or not controllers
        or any(not isinstance(each, str) for each in controllers)
        or len(set(controllers)) != len(controllers)
    ):
        raise ValueError(f"controllers = {shown(controllers)}: must be a list of different presets or laws")
    duration = top.take("duration", None)
    if duration is not None:
        duration = number(duration, "duration", low=0.0, strict=True)
    file: str | os.PathLike[str] = named if named in list_scenarios() else folder / named
    found = {}
    for controller in controllers or [None]:
        scenario = load_scenario(file, controller=controller, duration=duration)
        found[controller or scenario.controller.name] = _ready(scenario, paths)
    return found


def _ready(scenario: Scenario, paths: list[str]) -> Scenario:
    """The scenario with every varied number made data, so that it may also be varied from zero."""
    if scenario.plant != "rigid_body":
        raise ValueError(
            f"scenario: plant.kind = {scenario.plant!r}: must be rigid_body, whose episodes fly in batches"
        )
    for path in paths:
        at = f'vary."{path}"'
        try:
            value = number_at(scenario, path)
            if not path.startswith(DERIVED):
                scenario = with_numbers(scenario, {path: value})
        except ValueError as error:
            raise ValueError(f"{at}: {error}") from None
    return scenario


def _success(top: Fields, known: tuple[str, ...]) -> dict[str, float]:
    fields = Fields(top.take("success", {}), "success")
    for name in fields.table:
        if name not in known:
            raise ValueError(f"success.{name}: is no metric of this study; there are {', '.join(known)}")
    return {name: fields.number(name) for name in fields.table}
