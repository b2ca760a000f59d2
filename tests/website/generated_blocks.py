"""Tables of the reference pages, generated from records, registries and signatures.

A page holds ``<!-- generated: KIND WORDS -->``, the table, ``<!-- /generated -->``. ``--write`` fills every block of
docs/*.md, or of the pages that are named; :func:`stale_blocks` finds those that differ from the program.
"""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import AUTOPILOTS, LAWS
from skyarm.control.laws.centroidal.options import RETIRED
from skyarm.control.laws.predictive.cost import Weights
from skyarm.control.laws.predictive.observer import Bandwidths
from skyarm.control.model import TORQUE_GAINS, GeometricGains, JointGains, Terms
from skyarm.control.option_units import OptionText, option_texts
from skyarm.records.units import Unit, units
from skyarm.scenario.controller_table import option_words

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
BLOCK = re.compile(r"^<!-- generated: ([^\n]*?) -->\n(.*?)^<!-- /generated -->$", re.M | re.S)

Rows = Iterable[Sequence[str]]


def table(heads: Sequence[str], rows: Rows) -> str:
    """Markdown table without the columns in which no row has anything."""
    cells = [[cell.replace("|", "\\|").strip() for cell in row] for row in rows]
    kept = [i for i in range(len(heads)) if i == 0 or any(row[i] for row in cells)]
    lines = ["| " + " | ".join(heads[i] for i in kept) + " |", "|" + "-|" * len(kept)]
    lines += ["| " + " | ".join(row[i] or "-" for i in kept) + " |" for row in cells]
    return "\n".join(lines) + "\n"


OPTION_HEADS = ("option", "type and unit", "default", "allowed", "meaning", "effect")


def shown(value: object) -> str:
    """Default value as a file writes it."""
    if value is None or value == () or (isinstance(value, str) and not value):
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, float | int):
        return "no limit" if math.isinf(value) else f"`{value:.10g}`"
    if isinstance(value, tuple | list | Vec3 | Quaternion):
        return "`[" + ", ".join(f"{float(each):.10g}" for each in value) + "]`"
    if value == Terms():
        return "none"
    return "" if dataclasses.is_dataclass(value) else f"`{value}`"


def bounds(unit: Unit) -> str:
    """Allowed numbers in words; empty if any number is allowed."""
    low, high = unit.low, unit.high
    if math.isfinite(low) and math.isfinite(high):
        return f"above {low:g}, below {high:g}" if unit.strict else f"{low:g} to {high:g}"
    if math.isfinite(low):
        return f"above {low:g}" if unit.strict else f"at least {low:g}"
    if math.isfinite(high):
        return f"below {high:g}" if unit.strict else f"at most {high:g}"
    return ""


def effect_of(unit: Unit) -> str:
    """Effect of a higher or lower value, where the unit of a field states one."""
    return str(getattr(unit, "effect", ""))


def typed(entry: str, unit: str) -> str:
    """Type and unit as one cell."""
    return ", ".join(filter(None, (entry, unit)))


TABLES: dict[str, type] = {
    "gains": GeometricGains,
    "joint_gains": JointGains,
    "weights": Weights,
    "bandwidths": Bandwidths,
}
"""Options of laws that are tables of a record's fields."""

ON_TORQUE = ("decoupled_pd", "admittance_pd")
"""Laws whose joint gains act on torque."""


def law_block(law: str) -> str:
    """Options of a law or of an autopilot, in the order of its maker."""
    assert law in (*LAWS, *AUTOPILOTS), f"no law {law}"
    rows: list[Sequence[str]] = []
    texts = option_texts(law)
    for word, option in option_words(law).items():
        if law == "centroidal" and option in RETIRED:
            continue
        text = texts[option]
        rows.append(_option_row(word, text))
        rows += _table_rows(word, law, text)
    return table(OPTION_HEADS, rows)


def _option_row(word: str, text: OptionText) -> Sequence[str]:
    allowed = text.allowed if "`" in text.allowed else re.sub(r'("[^"]*")', r"`\1`", text.allowed)
    default = text.usual or shown(text.default)
    return (
        f"`{word}`",
        typed(text.entry, text.unit.unit),
        default,
        allowed or bounds(text.unit) or ("true or false" if text.entry == "true or false" else ""),
        text.unit.meaning,
        text.effect or effect_of(text.unit),
    )


def _table_rows(option: str, law: str, text: OptionText) -> list[Sequence[str]]:
    """Rows of the fields of an option that is a table."""
    if option not in TABLES:
        return []
    kind, rows = TABLES[option], list[Sequence[str]]()
    torque = TORQUE_GAINS if option == "joint_gains" and law in ON_TORQUE else {}
    for name, unit in units(kind).items():
        own = torque.get(name, unit)
        entry = "three numbers" if kind is GeometricGains else "one number for each joint"
        entry = entry if option in ("gains", "joint_gains") else "number"
        default = getattr(text.default, name, None)
        rows.append(
            (
                f"`{option}.{name}`",
                typed(entry, own.unit),
                "" if default is None else shown(default),
                bounds(unit),
                own.meaning,
                effect_of(unit),
            )
        )
    return rows


KINDS: dict[str, Callable[..., str]] = {"law": law_block}
"""Kind of a block -> function of its words that returns the table."""


def made(head: str) -> str:
    """Table of a block from the words of its first line.

    Raises:
        ValueError: an unknown kind.
    """
    kind, *words = head.split()
    if kind not in KINDS:
        raise ValueError(f"generated: {kind}: must be one of {', '.join(KINDS)}")
    return KINDS[kind](*words)


def filled(text: str) -> str:
    """Page with all its blocks as the program has them."""
    return BLOCK.sub(lambda found: f"<!-- generated: {found[1]} -->\n{made(found[1])}<!-- /generated -->", text)


def pages() -> list[Path]:
    """Pages with a block."""
    return [path for path in sorted(DOCS.glob("*.md")) if "<!-- generated: " in path.read_text("utf-8")]


def heads() -> dict[str, str]:
    """First line of each block of the pages, with the name of its page."""
    return {found[1]: path.name for path in pages() for found in BLOCK.finditer(path.read_text("utf-8"))}


def stale_blocks(path: Path) -> list[str]:
    """First lines of the blocks of a page that differ from the program."""
    text = path.read_text("utf-8")
    opened = len(re.findall(r"^<!-- generated: ", text, re.M))
    found = list(BLOCK.finditer(text))
    wrong = [] if len(found) == opened else ["a block that is not closed by <!-- /generated -->"]
    return wrong + [each[1] for each in found if each[2] != made(each[1])]


def main(arguments: Sequence[str]) -> Any:
    """Fill the blocks of the named pages, or of all; without ``--write`` name the stale ones."""
    chosen = [Path(name).resolve() for name in arguments if name != "--write"] or pages()
    for path in chosen:
        for head in stale_blocks(path):
            print(f"{path.name}: {head}")
        if "--write" in arguments:
            text = path.read_text("utf-8")
            if (new := filled(text)) != text:
                path.write_text(new, "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
