"""Reader of sweep definitions (studies) from TOML files.

A file has ``schema = 1`` and::

    name, title      of the study
    scenario         name of a shipped scenario, or the path of a file beside this one
    controllers      presets or laws that fly the same draws; "own", or left out: the
                     scenario's own controller with its options
    duration         s, in place of the scenario's
    episodes         how many; in a grid design a multiple of its cells, or left out:
                     one a cell
    seed             of draws and noise (0)
    chunk            episodes of one file of rows (4096)
    precision        "double", "single" or "bit_exact" (double)
    design           "random", "grid" or "sobol" (random)
    metrics          names and groups (["standard", "rotor_jitter",
                     "rotor_saturation"]); others cost no time. Of several agents
                     "left/tilt_max" is that of one, "tilt_max" that of each
    windows          steady, transient, gust, hover: [start, stop) in s; holds: a list
                     of such; last: s before the end; what is left out is the
                     scenario's, or else the flight after its first third
    [vary]           "dotted.path" = { uniform = [low, high] } | { normal = [mean, std]
                     } | { log_uniform = [low, high] } | { list = [...] } | { grid =
                     [start, stop, count] }
    [derived]        "dotted.path" = expression of what varies and of what is derived
                     above it: + - * / ( ) sqrt; names of one's own, words without a
                     dot, vary or are derived beside the paths
    [success]        metric = largest value; an episode that ended early is never a
                     success

Every error is one line: file, field, value, what is allowed.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from importlib import resources
from math import prod
from pathlib import Path
from typing import Any

from skyarm.control.catalogue import OWN, require_different
from skyarm.log.metrics.metric_catalogue import row_names
from skyarm.log.metrics.windows import Windows
from skyarm.records.files import (
    Fields,
    PathLike,
    did_you_mean,
    errors_as,
    file_name,
    number,
    one_line,
    shown,
)
from skyarm.records.files.fields import whole_number
from skyarm.records.files.names import names_in, read_named
from skyarm.records.read_table import record_from
from skyarm.records.registry.plugins import is_law_of_file
from skyarm.scenario.numbers import is_computed, number_at, with_numbers
from skyarm.scenario.readers import require_plugins
from skyarm.scenario.scenario_file import list_scenarios, load_scenario
from skyarm.scenario.scenario_record import Scenario, check_name, noise_key
from skyarm.studies.sweep.distributions import Distribution, distribution_from, finite
from skyarm.studies.sweep.expressions import derived_from, is_own_name
from skyarm.studies.sweep.sobol import DIMENSIONS
from skyarm.studies.sweep.study import (
    DESIGNS,
    LARGEST_CHUNK,
    MOST_EPISODES,
    PRECISIONS,
    Study,
    StudyError,
)

LIBRARY = resources.files("skyarm.studies.sweep") / "studies"

MOST_CHUNKS = 10_000_000
"""Largest number of files of a study; their names have seven digits."""


def list_studies() -> tuple[str, ...]:
    """Names of the shipped studies."""
    return names_in(LIBRARY)


def load_study(
    name_or_path: PathLike, controllers: Sequence[str] | None = None
) -> Study:
    """Load a study from the library by name or from a .toml file.

    Args:
        name_or_path: a name of :func:`list_studies`, or the path of a .toml file.
        controllers: controllers in place of the file's.

    Raises:
        StudyError: one line, ``file: field = value: what is allowed``.
    """
    with errors_as(StudyError):
        text = file_name(name_or_path, "study")
        document, folder = read_named(text, "study", LIBRARY)
    with errors_as(StudyError, f"{text}: "):
        _require_no_file_law(document.get("controllers"))
        changed = (
            document
            if controllers is None
            else {**document, "controllers": list(controllers)}
        )
        return study_from(changed, folder, source=text)


def _require_no_file_law(controllers: object) -> None:
    """Refuse controllers from code files in a study file."""
    for name in controllers if isinstance(controllers, list) else ():
        if is_law_of_file(name):
            raise ValueError(
                f"controllers = {shown(name)}: must not be a file's; only --laws takes"
                " FILE.py:make"
            )


def study_from(
    document: Mapping[str, Any], folder: PathLike = "", *, source: str = "study"
) -> Study:
    """Create a study from a parsed TOML document.

    Args:
        document: plain tables, as read from TOML.
        folder: folder where its scenario's path starts.
        source: name of the study in messages.

    Raises:
        StudyError: one line with field, value and what is allowed.
    """
    try:
        return _study(Fields(dict(document), ""), Path(folder), source)
    except ValueError as error:
        raise StudyError(one_line(str(error))) from None


def _study(top: Fields, folder: Path, source: str) -> Study:
    schema = top.take("schema")
    # not a comparison alone: 1.0 and true equal 1
    if type(schema) is not int or schema != 1:
        raise ValueError(f"schema = {shown(schema)}: must be 1")
    require_plugins(top)
    name = top.take("name")
    title = top.text("title", "")
    check_name(name)
    design = top.choice("design", DESIGNS, "random")
    vary = _vary(top.inner("vary"), design, top.states("episodes"))
    derived = derived_from(top.take("derived", {}), tuple(vary))
    seed = top.take("seed", 0)
    noise_key("seed", seed)
    chosen = {
        "design": design,
        "episodes": _episodes(top, design, vary),
        "seed": seed,
        # 4096 keep about 330 processors busy (docs/clusters.md)
        "chunk": whole_number(top.take("chunk", 4096), "chunk", 1, LARGEST_CHUNK),
        "precision": top.choice("precision", PRECISIONS, "double"),
        "windows": record_from(Windows, top.inner("windows")),
    }
    if chosen["episodes"] > MOST_CHUNKS * chosen["chunk"]:
        least = -(-chosen["episodes"] // MOST_CHUNKS)
        raise ValueError(
            f"chunk = {chosen['chunk']}: must be at least {least} for"
            f" {chosen['episodes']} episodes"
        )
    paths = [name for name in (*vary, *derived) if not (derived and is_own_name(name))]
    scenarios = _scenarios(top, folder, paths, derived)
    first = next(iter(scenarios.values()))
    chosen["metrics"] = _metrics(top, first)
    windows = chosen["windows"].of_flight(first.duration, first.windows)
    success = _success(top, chosen["metrics"])
    top.done()
    stated = {
        key: top.table.get(key)
        for key in ("scenario", "controllers", "duration", "vary")
    }
    if stated["controllers"] is not None:
        stated["controllers"] = list(scenarios)
    document = {
        "schema": 1,
        "name": name,
        **stated,
        **chosen,
        "windows": windows.plain(),
    }
    if derived:
        document["derived"] = {path: each.text for path, each in derived.items()}
    return Study(
        name=name,
        title=title,
        source=source,
        scenarios=scenarios,
        vary=vary,
        derived=derived,
        success=success,
        document=document,
        **chosen,
    )


def _vary(fields: Fields, design: str, counted: bool) -> dict[str, Distribution]:
    """Distributions of the varied numbers by path; ``counted`` if the file states a
    number of episodes.
    """
    vary = {
        path: distribution_from(value, f'vary."{path}"')
        for path, value in fields.table.items()
    }
    if design == "sobol" and not 1 <= len(vary) <= DIMENSIONS:
        raise ValueError(
            f"vary = {len(vary)} numbers: must be 1 to {DIMENSIONS} in a sobol design"
        )
    if design == "grid" and not finite(vary):
        raise ValueError(
            f"design = {design!r}: must come with a grid or a list under vary"
        )
    for path, value in fields.table.items():
        if "grid" in value and design != "grid" and not counted:
            raise ValueError(
                f'vary."{path}" = {shown(value)}: must come with design = "grid", or'
                " with a number of episodes"
            )
    return vary


def _episodes(top: Fields, design: str, vary: Mapping[str, Distribution]) -> int:
    if design != "grid":
        return whole_number(top.take("episodes"), "episodes", 1, MOST_EPISODES)
    cells = prod(len(each.values) for each in finite(vary).values())
    stated = top.take("episodes", cells)
    episodes = whole_number(stated, "episodes", 1, MOST_EPISODES)
    if episodes % cells:
        raise ValueError(
            f"episodes = {episodes}: must be a multiple of the grid's {cells} cells"
        )
    return episodes


def _metrics(top: Fields, scenario: Scenario) -> tuple[str, ...]:
    """Names of the metrics that a study computes of every flight."""
    names = top.take("metrics", ["standard", "rotor_jitter", "rotor_saturation"])
    if not isinstance(names, list) or not names:
        raise ValueError(f"metrics = {shown(names)}: must be a list of names")
    return row_names(names, scenario.setpoints)


def _scenarios(
    top: Fields, folder: Path, paths: list[str], derived: Collection[str]
) -> dict[str, Scenario]:
    """Scenarios of a study by controller name, whose varied parameters are inputs of a
    batch of flights.
    """
    named = top.take("scenario")
    if not isinstance(named, str):
        raise ValueError(
            f"scenario = {shown(named)}: must be the name of a shipped scenario or a"
            " path"
        )
    controllers = _controllers(top)
    duration = top.take("duration", None)
    if duration is not None:
        duration = number(duration, "duration", low=0.0, strict=True)
    # a shipped name comes before a file of that name
    file: PathLike = named if named in list_scenarios() else folder / named
    scenarios = {}
    for controller in controllers:
        scenario = load_scenario(file, controller=controller, duration=duration)
        # a law may leave changes out, and so number the others anew
        if any(path.startswith("changes.") for path in paths) and controller not in (
            None,
            OWN,
        ):
            own = load_scenario(file, duration=duration)
            if scenario.changes != own.changes:
                raise ValueError(
                    "controllers: must be left out with vary.changes, since the"
                    " scenario changes numbers of its own controller in flight"
                )
        scenarios[controller or scenario.law_names] = _ready(scenario, paths, derived)
    return scenarios


def _controllers(top: Fields) -> list[str | None]:
    """Names of a study's controllers; None for the scenario's own."""
    given = top.take("controllers", None)
    if given is None:
        return [None]
    wrong = (
        not isinstance(given, list)
        or not given
        or any(not isinstance(each, str) for each in given)
    )
    if wrong:
        raise ValueError(
            f"controllers = {shown(given)}: must be a list of different presets or laws"
        )
    require_different(given, "controllers")
    return list(given)


def _ready(scenario: Scenario, paths: list[str], derived: Collection[str]) -> Scenario:
    """Scenario in which every varied parameter is an input of the compiled batch, even
    if it is zero.
    """
    if scenario.kind != "rigid_body":
        raise ValueError(
            f"scenario: plant.kind = {scenario.kind!r}: must be rigid_body, whose"
            " episodes fly in batches"
        )
    for path in paths:
        at = f'{"derived" if path in derived else "vary"}."{path}"'
        with errors_as(ValueError, f"{at}: "):
            value = number_at(scenario, path)
            if not is_computed(scenario, path):
                scenario = with_numbers(scenario, {path: value})
    return scenario


def _success(top: Fields, metrics: tuple[str, ...]) -> dict[str, float]:
    fields = top.inner("success")
    for name in fields.table:
        if name not in metrics:
            there = f"{did_you_mean(name, metrics)}there are {', '.join(metrics)}"
            raise ValueError(f"success.{name}: is no metric of this study; {there}")
    return {name: fields.number(name) for name in fields.table}
