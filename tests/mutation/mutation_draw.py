"""The rooms of the source, and a seeded draw of changes from each.

A mutant is known by its file, the text of its line and the change, so that a record
outlives lines that move.
"""

from __future__ import annotations

import ast
import bisect
import hashlib
import random
from collections import defaultdict
from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path

import mutation_operators as operators

LIGHT = ("cli", "paper", "root", "view.figures", "view.film", "view.pages")
"""Rooms of commands and pictures, which get half a share."""
BIG = ("control", "links", "studies", "view")
"""Rooms whose subfolders are rooms of the draw."""
APART = ("links", "studies", "view")
"""Those whose tests lie in subfolders of the same names."""
FEWEST = 3


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """One change of one file."""

    file: str
    """Below ``src/skyarm``."""
    line: str
    """Text of the line where the change begins, without indentation."""
    nth: int
    """Which of the lines with this text, from 0."""
    column: int
    """Place in that text."""
    old: str
    new: str
    kind: str

    @property
    def key(self) -> str:
        """Return a short name that stays while the line does."""
        parts = "\n".join(str(value) for value in asdict(self).values())
        return hashlib.sha256(parts.encode()).hexdigest()[:8]

    @property
    def room(self) -> str:
        """Return the room of the file."""
        return room(self.file)

    def place(self, text: str) -> int | None:
        """Return where in the file's text the change begins; None if the line is no
        longer there.
        """
        place = 0
        seen = 0
        for line in text.splitlines(keepends=True):
            if line.strip() == self.line:
                if seen == self.nth:
                    start = place + line.index(self.line) + self.column
                    return start if text.startswith(self.old, start) else None
                seen += 1
            place += len(line)
        return None

    def there(self, package: Path) -> bool:
        """Say whether the line that it changes is still in the source."""
        path = package / self.file
        return path.is_file() and self.place(path.read_text()) is not None

    def changed(self, text: str) -> str | None:
        """Return the mutated file."""
        start = self.place(text)
        return (
            None
            if start is None
            else text[:start] + self.new + text[start + len(self.old) :]
        )


def room(file: str) -> str:
    """Return the room of a file below ``src/skyarm``; the big rooms by their
    subfolders.
    """
    parts = Path(file).parts[:-1]
    if not parts:
        return "root"
    if parts[0] not in BIG:
        return parts[0]
    return f"{parts[0]}.{parts[1] if len(parts) > 1 else 'other'}"


def tests_of(name: str) -> str:
    """Return the folder below ``tests`` that is a room's own; the empty text for files
    beside the rooms.

    Tests of control lie in one folder, those of the other big rooms in subfolders of
    the same names.
    """
    if name == "root":
        return ""
    first, _, second = name.partition(".")
    return f"{first}/{second}" if first in APART and second != "other" else first


def all_changes(package: Path) -> dict[str, list[Mutant]]:
    """Return every change of the package by room."""
    found: dict[str, list[Mutant]] = defaultdict(list)
    for path in sorted(package.rglob("*.py")):
        text = path.read_text()
        source = operators.Source(text=text)
        file = path.relative_to(package).as_posix()
        stripped = [line.strip() for line in source.lines]
        for change in operators.changes(source):
            row = bisect.bisect_right(source.starts, change.start) - 1
            indent = len(source.lines[row]) - len(source.lines[row].lstrip())
            found[room(file)].append(
                Mutant(
                    file=file,
                    line=stripped[row],
                    nth=stripped[:row].count(stripped[row]),
                    column=change.start - source.starts[row] - indent,
                    old=change.old,
                    new=change.new,
                    kind=change.kind,
                )
            )
    return dict(found)


def draw(
    package: Path, count: int, seed: int, left_out: Collection[str] = ()
) -> list[Mutant]:
    """Draw `count` mutants, every room by the root of its size, in a room every kind by
    the root of its number.

    A mutant whose key is `left_out` is passed over; the others of its room stay the
    same, one more is drawn.
    """
    found = all_changes(package)
    weights = {
        name: len(changes) ** 0.5 * (0.5 if name in LIGHT else 1.0)
        for name, changes in found.items()
    }
    total = sum(weights.values())
    shares = {
        name: max(FEWEST, round(count * weight / total))
        for name, weight in weights.items()
    }
    largest = sorted(shares, key=lambda name: -shares[name])
    for turn in range(abs(sum(shares.values()) - count)):
        shares[largest[turn % len(largest)]] += (
            1 if sum(shares.values()) < count else -1
        )
    drawn: list[Mutant] = []
    for name in sorted(found):
        drawn += _draw_room(
            package,
            found[name],
            shares[name],
            random.Random(f"{seed} {name}"),
            left_out,
        )
    return drawn


def _draw_room(
    package: Path,
    changes: list[Mutant],
    count: int,
    dice: random.Random,
    left_out: Collection[str],
) -> list[Mutant]:
    """Draw from one room: a kind, then a change of it; no line twice, and nothing that
    is not Python.
    """
    left: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in changes:
        left[mutant.kind].append(mutant)
    drawn: list[Mutant] = []
    lines: set[tuple[str, str, int]] = set()
    while left and len(drawn) < count:
        kind = dice.choices(
            list(left), [len(mutants) ** 0.5 for mutants in left.values()]
        )[0]
        one = left[kind].pop(dice.randrange(len(left[kind])))
        if not left[kind]:
            del left[kind]
        line = (one.file, one.line, one.nth)
        changed = one.changed((package / one.file).read_text())
        fresh = line not in lines and one.key not in left_out
        if fresh and changed is not None and operators.is_python(changed):
            drawn.append(one)
            lines.add(line)
    return drawn


def function_of(text: str, mutant: Mutant) -> int | None:
    """Return the first line of the innermost function around a mutant, as its code
    object has it; None outside.
    """
    start = mutant.place(text)
    if start is None:
        return None
    row = text.count("\n", 0, start) + 1
    best: tuple[int, int] | None = None
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and node.body[
            0
        ].lineno <= row <= (node.end_lineno or 0):
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            best = max(best, (node.lineno, first)) if best else (node.lineno, first)
    return best[1] if best else None
