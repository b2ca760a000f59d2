"""The tables under *Envelope* on the pages of the laws: flown as the comparison flies them, with perfect state.

python tests/website/law_envelopes.py     flies every law and writes its table into its page
"""

from __future__ import annotations

import re
from pathlib import Path

from skyarm.control.catalogue import tuned_factors
from skyarm.studies.compare.cells import Flights, fly
from skyarm.studies.compare.entrants import ENTRANTS, Entrant
from skyarm.studies.compare.suite import CASES, conditions

LAWS = Path(__file__).resolve().parents[2] / "docs" / "laws"
BLOCK = re.compile(r"<!-- envelope: (.+?) -->\n(.*?)<!-- /envelope -->", re.S)
HEAD = (
    "| mm (joints: mrad) | Case 3: base | joints | tip | in the wind: base | joints | tip |\n"
    "| --- | ---: | ---: | ---: | ---: | ---: | ---: |\n"
)
KINDS = ("position", "joint", "ee")


def entrant(name: str) -> Entrant:
    """Who flies under a name: an entrant of the comparison, or a preset or a law with tuned gains that is none."""
    return ENTRANTS.get(name) or Entrant(name=name, group="paper", law=name, tuned=name in tuned_factors())


def flown(name: str) -> list[float]:
    """Mean errors in Case 3 and in the wind: base, mm; joints, mrad; tip, mm."""
    perfect = conditions()["perfect"]
    found = []
    for case in ("case3", "case3_wind"):
        metrics = fly(Flights(entrant=entrant(name), case=CASES[case], condition=perfect)).metrics
        found += [1e3 * metrics[f"{kind}_error_mean_continuous"][0] for kind in KINDS]
    return found


def shown(value: float) -> str:
    """A number with three digits, at most two of them behind the point."""
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def tables() -> dict[str, list[str]]:
    """Entrants of each page that has a table."""
    found = {}
    for page in sorted(LAWS.glob("*.md")):
        for names, _ in BLOCK.findall(page.read_text("utf-8")):
            found[page.stem] = names.split(", ")
    return found


def rows(page: str) -> dict[str, list[str]]:
    """Entrant -> the numbers that a page shows of it."""
    ((_, table),) = BLOCK.findall((LAWS / f"{page}.md").read_text("utf-8"))
    cells = ([cell.strip() for cell in line.strip("|").split("|")] for line in table.strip().splitlines()[2:])
    return {first.strip("`"): numbers for first, *numbers in cells}


def main() -> None:
    """Write every table."""
    for page, names in tables().items():
        path = LAWS / f"{page}.md"
        lines = [f"| `{name}` | " + " | ".join(map(shown, flown(name))) + " |\n" for name in names]
        table = f"<!-- envelope: {', '.join(names)} -->\n{HEAD}{''.join(lines)}<!-- /envelope -->"
        path.write_text(BLOCK.sub(lambda _, t=table: t, path.read_text("utf-8")), "utf-8")
        print(page, *lines, flush=True)


if __name__ == "__main__":
    main()
