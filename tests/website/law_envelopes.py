"""The table of mean errors of docs/laws.md, flown as the comparison flies the laws, with perfect state.

python tests/website/law_envelopes.py     flies every law and writes the table into the page
"""

from __future__ import annotations

import re
from pathlib import Path

from skyarm.control.catalogue import tuned_factors
from skyarm.studies.compare.cell_flights import JITTER, LIMITED, CellFlights
from skyarm.studies.compare.entrants import ENTRANTS, Entrant
from skyarm.studies.compare.suite import CASES, conditions
from skyarm.studies.flights.fly import fly

LAWS = Path(__file__).resolve().parents[2] / "docs" / "laws.md"
BLOCK = re.compile(r"<!-- envelope -->\n(.*?)<!-- /envelope -->", re.S)
HEAD = (
    "| mm (joints: mrad; jitter: rad/s) | Case 3: base | joints | tip | jitter | in the wind: base | joints | tip | "
    "jitter |\n|-|-:|-:|-:|-:|-:|-:|-:|-:|\n"
)
KINDS = ("position", "joint", "ee")


def entrant(name: str) -> Entrant:
    """Who flies under a name: an entrant of the comparison, or a preset or a law with tuned gains that is none."""
    return ENTRANTS.get(name) or Entrant(name=name, group="paper", law=name, tuned=name in tuned_factors())


def flown(name: str) -> list[float]:
    """Mean errors in Case 3 and in the wind: base, mm; joints, mrad; tip, mm; rotor jitter, rad/s.

    Raises:
        AssertionError: a rotor is at its limit, which the page says of none.
    """
    perfect = conditions()["perfect"]
    found = []
    for case in ("case3", "case3_wind"):
        metrics = fly(CellFlights(entrant=entrant(name), case=CASES[case], condition=perfect).work())
        found += [1e3 * metrics[f"{kind}_error_mean_continuous"][0] for kind in KINDS] + [metrics[JITTER][0]]
        assert metrics[LIMITED][0] == 0.0, f"{name} in {case}: rotors at a limit in {metrics[LIMITED][0]:.2%}"
    return found


def shown(value: float) -> str:
    """A number with three digits, at most two of them behind the point."""
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def rows() -> dict[str, list[str]]:
    """Entrant -> its numbers in the table of the page."""
    (table,) = BLOCK.findall(LAWS.read_text("utf-8"))
    cells = ([cell.strip() for cell in line.strip("|").split("|")] for line in table.strip().splitlines()[2:])
    return {first.strip("`"): numbers for first, *numbers in cells}


def main() -> None:
    """Write the table."""
    lines = [f"| `{name}` | " + " | ".join(map(shown, flown(name))) + " |\n" for name in rows()]
    table = f"<!-- envelope -->\n{HEAD}{''.join(lines)}<!-- /envelope -->"
    LAWS.write_text(BLOCK.sub(lambda _: table, LAWS.read_text("utf-8")), "utf-8")
    print(*lines, sep="")


if __name__ == "__main__":
    main()
