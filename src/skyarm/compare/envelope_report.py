"""The envelope's report: how far each law is good, what violates the rules, and a table for each axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.compare.envelope_axes import TIP
from skyarm.compare.envelope_record import FLAGSHIP, JUDGED, LEVELS, WORSE, lost_at, within
from skyarm.files import versions
from skyarm.pages import DASH, Report, Section, Table, image, number
from skyarm.view.figures.comparison_figures import envelope_figure
from skyarm.view.figures.style import image_bytes

DPI = 160
LOST = "lost"
CAPTION = "Error of every law along every axis, mm. A cross in the band at the top is a law that is lost there"

RULES = (
    "No trial in which the flagship is lost and another law is not; none in which its error is more than "
    f"{100.0 * (WORSE - 1.0):.0f} % larger than that of the paper's law."
)

MEANING = (
    "Errors are distances of the tip from where a level base on its reference would carry it: mean / largest, mm; of "
    "steps the base's overshoot. A law is lost where its flight ended early, tilted by over 80 degrees or "
    "was, in the mean over its last 5 s, over 0.5 m off."
)

HOW = (
    "Trials of {seconds}; motions grow from rest between 2 and 5 s. Perfect state, or where an axis is noisy "
    "1 mm, 1 cm/s, 2 mrad, 0.01 rad/s, joints 1 mrad, and measurements 5 ms old, of which laws that can are told. "
    "Another vehicle than the paper's is given forces and payloads by its weight, accelerations by its thrust margin "
    "where that is smaller, and swings of the arm by its joints' limits."
)

NO_FLAGSHIP, NO_VIOLATION = f"Not known: {FLAGSHIP} did not fly.", "None."

VIOLATION_HEAD = ("trial", "rule", ">flagship, mm", ">other, mm")


def envelope_picture(found: Mapping[str, Any]) -> bytes:
    """PNG of every axis."""
    return image_bytes(envelope_figure(found["axes"], found["laws"]), dpi=DPI)


def envelope_report(found: Mapping[str, Any], picture: bytes | None = None) -> Report:
    """Sentences, summary, a table for each axis, and violations."""
    axes, laws = found["axes"], found["laws"]
    rows = violation_rows(found["violations"])
    none = [NO_VIOLATION if FLAGSHIP in laws else NO_FLAGSHIP] if not rows else []
    seconds = " and ".join(f"{each:g} s" for each in sorted({axis["window_s"][1] for axis in axes.values()}))
    counted = [f"{len(each)} {one if len(each) == 1 else many}" for each, one, many in
               ((laws, "law", "laws"), (axes, "axis", "axes"))]  # fmt: skip
    violated = [Table(head=VIOLATION_HEAD, rows=rows)] if rows else []
    return Report(
        title=f"The envelope of {found['vehicle']}",
        facts=f"{', '.join(counted)}, seed {found['seed']}, plant {found['plant']}; skyarm {versions()['skyarm']}",
        sections=[
            summary_section(found, picture),
            *(
                Section(
                    title=axis_title(name, axis),
                    remark=HOW.format(seconds=seconds) if name == next(iter(axes)) else "",
                    tables=[Table(head=axis_head(axis), rows=axis_rows(axis))],
                )
                for name, axis in axes.items()
            ),
            Section(title="Violations", notes=[RULES, *none], tables=violated),
        ],
    )


def summary_section(found: Mapping[str, Any], picture: bytes | None = None) -> Section:
    """Each law in a sentence, and how far it is good along every axis."""
    axes, laws = found["axes"], found["laws"]
    words = [f"{law} keeps the tip {sentence}" for law, sentence in found["sentences"].items()]
    words += [f"{law} does not fly: {why}" for law, why in found["not_flown"].items()]
    return Section(
        name="In a sentence",
        notes=[MEANING, *words],
        pictures=image(CAPTION, CAPTION, picture, wide=True) if picture else "",
        tables=[Table(head=summary_head(laws), rows=summary_rows(axes, laws))],
    )


def cell_text(point: Mapping[str, Any], judged: str) -> str:
    """Mean and largest error in mm; of a step overshoot in mm and time away in s; or that the vehicle was lost.

    Of perturbed plants how many keep the tip and how many are lost, the median of their means and the largest error.
    """
    if "plants" in point:
        plants = point["plants"]
        parts = [f"{plants['held']} of {plants['of']}"]
        parts += [f"{plants['lost']} lost"] if plants["lost"] else []
        if plants["lost"] < plants["of"]:
            parts.append(f"{number(point['tip_mean'], 1e3)} / {number(point['tip_max'], 1e3)}")
        return "; ".join(parts)
    if point["lost"]:
        return LOST
    if judged == JUDGED[TIP]:
        return f"{number(point['judged'], 1e3)} / {number(point['tip_max'], 1e3)}"
    return f"{number(point['judged'], 1e3)}; {number(point['outside'])} s"


def axis_head(axis: Mapping[str, Any]) -> list[str]:
    """Names of the columns of an axis."""
    return ["law", *(f">{value:g} {axis['unit']}" for value in axis["values"])]


def axis_rows(axis: Mapping[str, Any]) -> list[list[str]]:
    """A row for each law."""
    return [[law, *(cell_text(point, axis["judged"]) for point in points)] for law, points in axis["laws"].items()]


def axis_title(name: str, axis: Mapping[str, Any]) -> str:
    """Name, what is flown, and with which sensors."""
    return f"{name.replace('_', ' ')}: {axis['title']}{', with noise' if axis['noisy'] else ''} ({axis['judged']}, mm)"


def reach_text(axis: Mapping[str, Any], points: Sequence[Mapping[str, Any]]) -> str:
    """Values up to which a law stays within each level, and where it is lost if anywhere."""
    values, gone = axis["values"], lost_at(points)
    counts = [within(points, level) for level in LEVELS]
    good = " / ".join(f"{values[count - 1]:g}" if count else DASH for count in counts)
    return f"{good}, lost at {', '.join(f'{values[k]:g}' for k in gone)}" if gone else good


def summary_rows(axes: Mapping[str, Any], laws: Sequence[str]) -> list[list[str]]:
    """A row for each axis: what it is, its range, and of each law how far it is good and where it is lost."""
    rows = []
    for name, axis in axes.items():
        values, unit = axis["values"], axis["unit"]
        span = f"{values[0]:g} to {values[-1]:g} {unit}"
        cells = [reach_text(axis, axis["laws"][law]) if law in axis["laws"] else DASH for law in laws]
        rows.append([f"{name.replace('_', ' ')}, {span}", *cells])
    return rows


def summary_head(laws: Sequence[str]) -> list[str]:
    """Names of its columns."""
    levels = " / ".join(f"{1e3 * level:g}" for level in LEVELS)
    return [f"within {levels} mm up to", *(f">{law}" for law in laws)]


def violation_rows(found: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """A row for each violation: trial, rule, the flagship's error, the other law's."""
    rows = []
    for each in found:
        count = f" ({each['plants']} of the plants)" if "plants" in each else ""
        trial = f"{each['axis'].replace('_', ' ')} {each['value']:g} {each['unit']}{count}"
        lost = f"lost; not lost: {', '.join(each['kept_by'])}"
        rule = lost if each["rule"] == LOST else f"worse than {each['kept_by'][0]}"
        rows.append([trial, rule, number(each["own"], 1e3), number(each["other"], 1e3)])
    return rows
