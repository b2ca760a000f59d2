"""Tables of evidence for settings inferred from the numbers of Barakou et al. 2026."""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.paper.counted_cells import (
    RULE,
    counts,
    in_group,
    inferred_value,
    stated_value,
)
from skyarm.paper.inferred_settings import PREDICTION, unstated_study
from skyarm.paper.published import Record
from skyarm.paper.unstated_study import table_by_name
from skyarm.view.pages import Facts, Table

GROUPS = {
    "seen": "Cases 2 and 3 (fitted)",
    "gust": "gust (predicted)",
    "wind": "constant wind (predicted)",
    "case1_rest": "Case 1, what its own target and start do not set (predicted)",
}


def number(value: float) -> str:
    """Text of a number with at most six digits."""
    return f"{value:.6g}"


def settings_table(evidence: Record) -> Table:
    """Table of the inferred settings: continuous ones with their range of nearly equal
    loss, and discrete choices.
    """
    study = unstated_study()
    stages = evidence["stages"]
    settings = stages["fit"]["settings"]
    rows = []
    for name in study["fit"]["free"]:
        each = table_by_name(study["parameters"], name)
        low, high = stages[f"profile {name}"]["within_1"]
        rows.append(
            (
                each["words"],
                number(settings[name]),
                each["unit"],
                f"{number(low)} ... {number(high)}",
            )
        )
    for name, taken in study["fit"]["choices"].items():
        choice = table_by_name(study["choices"], name)
        # a choice has no range: what was not taken stands in its place
        others = [each["words"] for each in choice["options"] if each["name"] != taken]
        rows.append(
            (
                choice["words"],
                table_by_name(choice["options"], taken)["words"],
                "choice",
                f"not: {'; '.join(others)}",
            )
        )
    return _table(
        "Inferred settings",
        ("setting", ">value", "unit", "loss within 1 of the least, on a grid"),
        rows,
    )


def ladder_table(evidence: Record) -> Table:
    """Table of the misfit to published numbers as inferred settings are added one after
    the other.
    """
    rows = [
        (
            each["name"],
            str(each["numbers"]),
            str(each["choices"]),
            *_loss_cells(each),
            *_laws(each),
        )
        for each in evidence["stages"]["ladder"]["rungs"]
    ]
    head = (
        "step",
        ">numbers",
        ">choices",
        *_JUDGED,
        ">PD: loss",
        ">PD within 25 %",
        ">CT: loss",
        ">CT within 25 %",
    )
    return _table("Ladder: each step adds to the one before", head, rows)


def choices_table(evidence: Record) -> Table:
    """Table of the misfit for each option of a discrete setting, with the continuous
    settings refitted.
    """
    rows = []
    for name, stage in evidence["stages"].items():
        if name.startswith("choice "):
            rows += [
                (
                    stage["words"],
                    option["words"],
                    "taken" if option["taken"] else "",
                    *_loss_cells(option),
                )
                for option in stage["options"]
            ]
    return _table(
        "Choices, the numbers fitted again", ("choice", "option", "", *_JUDGED), rows
    )


def profile_tables(evidence: Record) -> list[Table]:
    """Tables of the misfit over each continuous setting, with the others held fixed,
    and with the others refitted.
    """
    study = unstated_study()
    tables = []
    for name in study["fit"]["free"]:
        stage = evidence["stages"][f"profile {name}"]
        each = table_by_name(study["parameters"], name)
        columns = zip(stage["value"], stage["held"], stage["refitted"], strict=True)
        rows = [
            (number(value), f"{fixed:.1f}", f"{again:.1f}")
            for value, fixed, again in columns
        ]
        title = ", ".join(filter(None, (f"Loss over: {each['words']}", each["unit"])))
        tables.append(
            _table(
                title, (">value", ">the others held", ">the others fitted again"), rows
            )
        )
    return tables


def rivals_table(evidence: Record) -> Table:
    """Table of alternative explanations of published numbers: misfit with each alone,
    and in addition to the fit.
    """
    study = unstated_study()
    rows = []
    for rival in study["rivals"]:
        stage = evidence["stages"][f"rival {rival['name']}"]
        row = [rival["words"]]
        for group in study["rival_cells"]:
            alone = stage["alone"][group]
            values = ", ".join(map(number, alone["numbers"].values()))
            row += [f"{alone['stated']:.1f} to {alone['loss']:.1f}", values or "-"]
        top = stage.get("on_top")
        row += (
            [", ".join(map(number, top["numbers"].values())) or "-", *_loss_cells(top)]
            if top
            else ["-"] * 5
        )
        rows.append(row)
    head = ["alternative"]
    for group in study["rival_cells"]:
        law = group.removeprefix("steady_")
        head += [f">{law}: loss alone, from to", ">best value"]
    return _table(
        "Rivals, each alone, and on top of the fit",
        (*head, ">value on top", *_JUDGED),
        rows,
    )


def prediction_table(results: Record, predicted: Record, plant: str) -> Table:
    """Table of agreement with published numbers for settings as stated, fitted to Cases
    2 and 3, and fitted to all.

    ``predicted`` are the experiments of results whose inferred column has the predicted
    settings.
    """
    seen = table_by_name(unstated_study()["predictions"], PREDICTION)["seen"]
    rows = []
    columns = (
        (results["experiments"], stated_value),
        (predicted, inferred_value),
        (results["experiments"], inferred_value),
    )
    for group, words in GROUPS.items():
        name = seen if group == "seen" else group
        row = [words]
        for experiments, column in columns:
            near = counts(experiments, column(plant), in_group(name))
            row += (
                [f"{near['loss']:.1f}", _share(near, "10%"), _share(near, "25%")]
                if near
                else ["-"] * 3
            )
        rows.append(row)
    head = [
        f">{which}: {what}"
        for which in ("as stated", "from Cases 2 and 3", "fitted to all")
        for what in ("loss", "within 10 %", "within 25 %")
    ]
    return _table(f"Out of sample, {plant}", ("cells", *head), rows)


def evidence_tables(evidence: Record) -> list[Table]:
    """All tables of evidence for the inferred settings."""
    before = [settings_table(evidence), ladder_table(evidence), choices_table(evidence)]
    return [*before, *profile_tables(evidence), rivals_table(evidence)]


def markdown_of(tables: Sequence[Table]) -> str:
    """Markdown text of tables of evidence."""
    return (
        "\n\n".join(
            [
                RULE,
                *(
                    f"## {each.caption}\n\n{each.markdown(each.caption)}"
                    for each in tables
                ),
            ]
        )
        + "\n"
    )


def _table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    return Table(caption=title, head=head, rows=rows)


_JUDGED = (">loss", ">within 5 %", ">within 10 %", ">within 25 %")


def _loss_cells(agreement: Record) -> list[str]:
    return [
        f"{agreement['loss']:.1f}",
        *(str(agreement[f"within_{share}%"]) for share in (5, 10, 25)),
    ]


def _laws(agreement: Record) -> list[str]:
    groups = [agreement["groups"][law] for law in ("PD", "CT")]
    return [
        text for each in groups for text in (f"{each['loss']:.1f}", _share(each, "25%"))
    ]


def _share(agreement: Record, within: str) -> str:
    return f"{agreement[f'within_{within}']} of {agreement['cells']}"


def inferred_facts(evidence: Record) -> Facts:
    """Inferred settings and their origin, as plain data for the results file."""
    fit = unstated_study()["fit"]
    settings = evidence["stages"]["fit"]["settings"]
    facts = {
        "numbers": len(fit["free"]),
        "choices": len(fit["choices"]),
        "settings": settings,
    }
    return {
        "inferred": (
            facts
            | {
                "found_by": evidence["version"],
                # sixteen digits tell two studies apart
                "study": evidence["study_digest"][:16],
            }
        )
    }
