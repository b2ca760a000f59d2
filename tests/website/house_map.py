"""Map of the house: every room of ``src/skyarm`` with one sentence, its imports, and
the file to read first.

    python tests/website/house_map.py     writes docs/images/house.svg and the table of
                                          CONTRIBUTING.md

Rooms and their order are those of the import contract in ``pyproject.toml``, the arrows
are the imports of the source. An arrow that a longer way along others implies is not
drawn. Rooms are ranked by their longest way down; a long arrow takes a narrow place in
each row that it passes, and the rows are put in order by the mean of their neighbours.

Source: Sugiyama, Tagawa, Toda 1981 (layered drawings).
"""

from __future__ import annotations

import ast
import textwrap
import tomllib
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE, DRAWING = ROOT / "src", ROOT / "docs" / "images" / "house.svg"
PAGE = ROOT / "CONTRIBUTING.md"
STYLE = (
    "<style>svg{color:#222}@media (prefers-color-scheme:dark){svg{color:#ddd}}</style>"
)
WIDTH, HEIGHT = 186, 62  # of a room, px
PASSAGE = 14  # of a long arrow, px
BETWEEN, DOWN = 16, 92  # from side to side of neighbours, from row to row
EDGE = 10
LETTERS = 31  # of a line of the small text
SENTENCES = {
    "__main__": "python -m skyarm",
    "cli": "commands: options and one call each",
    "links": "autopilots, ROS and servos behind a socket",
    "identify": "a vehicle's parameters from its logs",
    "paper": "the paper's equations, cases and report",
    "studies.tune": "gains that are best under margins",
    "studies.compare": "laws in the same cases on the same plants",
    "studies.assess": "what a vehicle can do, before it flies",
    "view.film": "films and recordings",
    "envs": "environments for learning",
    "view.figures": "figures from logs",
    "studies.trial": "a scenario with changes, judged",
    "studies.stability": "margins of the linearised loop",
    "studies.sweep": "one scenario, many values",
    "view.studio": "the live page",
    "view.picture": "one picture of a flight, two renderers",
    "studies.flights": "many flights: kept, resumed, on Ray",
    "simulate": "the closed loop, period by period; what its cameras see",
    "scenario": "one experiment, its file and checks",
    "flight_data": "files of real flights",
    "planning": "motions of base and arm from a task",
    "control": "laws with their solvers and blocks, safety, C export",
    "log": "what a flight kept; metrics, files, messages",
    "plant": "the simulated vehicle, ours or MuJoCo's",
    "sensing": "from true state to measurement: sensors, rays, filters",
    "world": "wind, contact, payloads, faults; shapes, teams",
    "reference": "desired motion with four derivatives",
    "dynamics": "rigid bodies, kinematics, rotors, drives",
    "compile": "traced programs: machine code, C, JAX",
    "vehicle": "airframe, arm, rotors; readers of their files",
    "records": "declared fields, tables and meshes read, registry",
    "algebra": "vectors, slopes, logic over any scalar",
    "view.pages": "reports as pages",
}
"""One sentence a room; a room without one is refused."""
FIRST = {
    "__main__": "__main__.py",
    "cli": "cli/run_command.py",
    "links": "links/autopilots/flight.py",
    "identify": "identify/identify_flights.py",
    "paper": "paper/equations.py",
    "studies.tune": "studies/tune/tuning.py",
    "studies.compare": "studies/compare/suite.py",
    "studies.assess": "studies/assess/assessment.py",
    "view.film": "view/film/film_flights.py",
    "envs": "envs/env_task.py",
    "view.figures": "view/figures/flight_plot.py",
    "studies.trial": "studies/trial/trial.py",
    "studies.stability": "studies/stability/margins.py",
    "studies.sweep": "studies/sweep/study.py",
    "view.picture": "view/picture/frames.py",
    "view.studio": "view/studio/page.py",
    "studies.flights": "studies/flights/work.py",
    "simulate": "simulate/period.py",
    "scenario": "scenario/scenario_record.py",
    "flight_data": "flight_data/flight_data.py",
    "planning": "planning/planner.py",
    "control": "control/controller.py",
    "log": "log/flight_log.py",
    "plant": "plant/interface.py",
    "sensing": "sensing/sensor.py",
    "world": "world/component.py",
    "reference": "reference/trajectory.py",
    "dynamics": "dynamics/articulated_body.py",
    "compile": "compile/tracing/program.py",
    "vehicle": "vehicle/vehicle_records.py",
    "records": "records/immutable.py",
    "algebra": "algebra/vector.py",
    "view.pages": "view/pages/sections.py",
}
"""File of each room with which to begin to read."""


@dataclass(eq=False)
class Place:
    """Room, or passage of a long arrow (no name), in a row."""

    name: str = ""
    x: float = 0.0
    below: list[Place] = field(default_factory=list)
    above: list[Place] = field(default_factory=list)

    @property
    def width(self) -> int:
        """Width, px."""
        return WIDTH if self.name else PASSAGE


def floors() -> list[list[str]]:
    """Names of the rooms of each floor without the package's, from the top down, as the
    import contract has them.
    """
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    contract = next(
        c for c in settings["tool"]["importlinter"]["contracts"] if c["id"] == "house"
    )
    return [
        [each.strip().removeprefix("skyarm.") for each in row.split("|")]
        for row in contract["layers"]
    ]


def rooms() -> list[str]:
    """Names of the rooms from the top down."""
    return [room for floor in floors() for room in floor]


def room_of(module: str, names: list[str]) -> str | None:
    """Innermost room of a module; None of the package's own file."""
    inside = [name for name in names if f"{module}.".startswith(f"skyarm.{name}.")]
    return max(inside, key=len, default=None)


@cache
def imports() -> dict[str, set[str]]:
    """For each room those that it imports."""
    names = rooms()
    arrows: dict[str, set[str]] = {name: set() for name in names}
    for path in sorted(SOURCE.rglob("*.py")):
        room = room_of(".".join(path.relative_to(SOURCE).with_suffix("").parts), names)
        for node in ast.walk(ast.parse(path.read_text())):
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            modules += (
                [alias.name for alias in node.names]
                if isinstance(node, ast.Import)
                else []
            )
            for other in {room_of(module, names) for module in modules} - {room, None}:
                if room is not None and other is not None:
                    arrows[room].add(other)
    return arrows


def reachable(arrows: dict[str, set[str]], room: str) -> set[str]:
    """Rooms that lie below a room, along any number of arrows."""
    found: set[str] = set()
    stack = list(arrows[room])
    while stack:
        each = stack.pop()
        if each not in found:
            found.add(each)
            stack += arrows[each]
    return found


def essential(arrows: dict[str, set[str]]) -> dict[str, set[str]]:
    """Arrows that no longer way implies."""
    below = {room: reachable(arrows, room) for room in arrows}
    return {
        room: {b for b in ends if not any(b in below[c] for c in ends - {b})}
        for room, ends in arrows.items()
    }


def in_rows(arrows: dict[str, set[str]]) -> list[list[Place]]:
    """Rows from the top down, with a passage wherever an arrow crosses one."""
    rank: dict[str, int] = {}
    for room in reversed(rooms()):
        rank[room] = 1 + max((rank[end] for end in arrows[room]), default=-1)
    for room in rooms():  # what imports nothing stands below those that import it
        importers = [rank[other] for other, ends in arrows.items() if room in ends]
        if not arrows[room] and importers:
            rank[room] = min(importers) - 1
    rows: list[list[Place]] = [[] for _ in range(1 + max(rank.values()))]
    places = {room: Place(room) for room in rooms()}
    for room, place in places.items():
        rows[rank[room]].append(place)
    for room in rooms():
        for end in sorted(arrows[room]):
            above = places[room]
            for row in range(rank[room] - 1, rank[end], -1):
                rows[row].append(Place())
                connect(above, rows[row][-1])
                above = rows[row][-1]
            connect(above, places[end])
    return rows[::-1]


def connect(above: Place, below: Place) -> None:
    """Join two places of neighbouring rows."""
    above.below.append(below)
    below.above.append(above)


def spread(rows: list[list[Place]], rounds: int = 60) -> float:
    """Order and place each row near the mean of its neighbours; returns the width of
    all, px.
    """
    for row in rows:
        pack(row)
    for turn in range(rounds):
        downwards = turn % 2 == 0
        for row in rows if downwards else rows[::-1]:
            for place in row:
                near = (
                    (place.above if downwards else place.below)
                    or place.above
                    or place.below
                )
                place.x = sum(each.x for each in near) / len(near) if near else place.x
            row.sort(key=lambda place: place.x)
            pack(row)
    first = min(place.x - place.width / 2 for row in rows for place in row)
    for row in rows:
        for place in row:
            place.x += EDGE - first
    return max(place.x + place.width / 2 for row in rows for place in row) + EDGE


def pack(row: list[Place]) -> None:
    """Push neighbours apart that overlap, both by half."""
    for _ in range(200):
        worst = 0.0
        for one, two in pairwise(row):
            short = (one.width + two.width) / 2 + BETWEEN - (two.x - one.x)
            if short > 1e-6:
                one.x, two.x, worst = (
                    one.x - short / 2,
                    two.x + short / 2,
                    max(worst, short),
                )
        if worst < 0.01:
            return


def draw_room(place: Place, top: float) -> list[str]:
    """Box of a room with its name and its sentence."""
    words = textwrap.wrap(SENTENCES[place.name], LETTERS)
    parts = [
        f'<rect x="{place.x - WIDTH / 2:.0f}" y="{top:g}" width="{WIDTH}"'
        f' height="{HEIGHT}" rx="5"/>'
    ]
    parts.append(
        f'<text class="name" x="{place.x:.0f}" y="{top + 19:g}">{place.name}</text>'
    )
    return parts + [
        f'<text x="{place.x:.0f}" y="{top + 36 + 14 * i:g}">{line}</text>'
        for i, line in enumerate(words)
    ]


def draw_line(above: Place, below: Place, top: float) -> str:
    """Line from a place to one of the next row, with a head where it ends at a room."""
    begin, end = top + HEIGHT, top + DOWN
    bend = (end - begin) / 2
    path = (
        f"M{above.x:.0f} {begin:g}C{above.x:.0f} {begin + bend:g} {below.x:.0f}"
        f" {end - bend:g} {below.x:.0f} {end:g}"
    )
    if not below.name:
        return f'<path d="{path}v{HEIGHT}"/>'
    return f'<path d="{path}" marker-end="url(#head)"/>'


def drawing() -> str:
    """The house as SVG."""
    rows = in_rows(essential(imports()))
    width = spread(rows)
    parts, height = list[str](), EDGE * 2 + DOWN * (len(rows) - 1) + HEIGHT
    for i, row in enumerate(rows):
        top = EDGE + DOWN * i
        for place in row:
            parts += draw_room(place, top) if place.name else []
            parts += [draw_line(place, below, top) for below in place.below]
    head = (
        '<marker id="head" markerWidth="7" markerHeight="7" refX="6" refY="3.5"'
        ' orient="auto">'
    )
    return "\n".join(
        [
            (
                f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f}'
                f' {height}" width="{width:.0f}" font-family="sans-serif"'
                ' font-size="11" text-anchor="middle">'
            ),
            "<title>Rooms of skyarm and their imports</title>",
            f"{STYLE}<style>.name{{font-weight:bold;font-size:14px}}</style>",
            (
                f'<defs>{head}<path d="M0 0L7 3.5L0 7z"'
                ' fill="currentColor"/></marker></defs>'
            ),
            '<g fill="none" stroke="currentColor">',
            *(part for part in parts if not part.startswith("<text")),
            '</g><g fill="currentColor">',
            *(part for part in parts if part.startswith("<text")),
            "</g></svg>\n",
        ]
    )


HEAD = "| floor | room | what is in it | begin to read |\n"


def table() -> str:
    """The house as a table of Markdown, the top floor first."""
    rows = [
        f"| {len(floors()) - 1 - i} | `{room}` | {SENTENCES[room]} |"
        f" `{FIRST[room]}` |\n"
        for i, floor in enumerate(floors())
        for room in floor
    ]
    return "".join([HEAD, "| --- | --- | --- | --- |\n", *rows])


def with_table(page: str) -> str:
    """Text of a page with the table of today in place of the one that it has."""
    before, _, after = page.partition(HEAD)
    return before + table() + "\n" + after.partition("\n\n")[2]


if __name__ == "__main__":
    DRAWING.write_text(drawing())
    PAGE.write_text(with_table(PAGE.read_text()))
    print(DRAWING.relative_to(ROOT), PAGE.relative_to(ROOT))
