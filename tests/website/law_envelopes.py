"""The tables of mean errors of docs/results_laws.md, flown as the comparison flies the laws, with perfect state.

python tests/website/law_envelopes.py     flies every law and writes the tables into the page
"""

from __future__ import annotations

import re
from pathlib import Path

from skyarm.control.catalogue import tuned_factors
from skyarm.studies.compare.cell_flights import JITTER, LIMITED, CellFlights
from skyarm.studies.compare.entrants import ENTRANTS, Entrant
from skyarm.studies.compare.suite import CASES, conditions
from skyarm.studies.flights.fly import fly

PAGE = Path(__file__).resolve().parents[2] / "docs" / "results_laws.md"
CASES_SHOWN = ("case3", "case3_wind")
HEAD = "| law | base, mm | joints, mrad | tip, mm | rotor jitter, rad/s a period |\n|-|-:|-:|-:|-:|\n"
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
    for case in CASES_SHOWN:
        metrics = fly(CellFlights(entrant=entrant(name), case=CASES[case], condition=perfect).work())
        found += [1e3 * metrics[f"{kind}_error_mean_continuous"][0] for kind in KINDS] + [metrics[JITTER][0]]
        assert metrics[LIMITED][0] == 0.0, f"{name} in {case}: rotors at a limit in {metrics[LIMITED][0]:.2%}"
    return found


def shown(value: float) -> str:
    """A number with three digits, at most two of them behind the point."""
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def marks(case: str) -> re.Pattern[str]:
    """The table of a case, between its marks."""
    return re.compile(rf"<!-- laws in {case} -->\n(.*?)<!-- /laws -->", re.S)


def rows() -> dict[str, list[str]]:
    """Entrant -> its numbers in the tables of the page, one case after the other."""
    page, found = PAGE.read_text("utf-8"), dict[str, list[str]]()
    for case in CASES_SHOWN:
        (table,) = marks(case).findall(page)
        assert table.startswith(HEAD), case
        for line in table.strip().splitlines()[2:]:
            first, *numbers = (cell.strip() for cell in line.strip("|").split("|"))
            found.setdefault(first.strip("`"), []).extend(numbers)
    return found


def main() -> None:
    """Write the tables."""
    page, found = PAGE.read_text("utf-8"), {name: [*map(shown, flown(name))] for name in rows()}
    width = len(KINDS) + 1
    for k, case in enumerate(CASES_SHOWN):
        lines = [f"| `{name}` | {' | '.join(each[k * width : (k + 1) * width])} |\n" for name, each in found.items()]
        table = f"<!-- laws in {case} -->\n{HEAD}{''.join(lines)}<!-- /laws -->"
        page = marks(case).sub(lambda _, table=table: table, page)
        print(table)
    PAGE.write_text(page, "utf-8")


if __name__ == "__main__":
    main()
