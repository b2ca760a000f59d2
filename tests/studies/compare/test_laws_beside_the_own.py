"""A comparison on a scenario: the laws that are named, its own first if it is one, each
law once by whatever name.
"""

from __future__ import annotations

import dataclasses
import shutil
from contextlib import nullcontext
from importlib import resources
from pathlib import Path

import pytest

from skyarm.control.catalogue import ControllerError, require_different
from skyarm.records.registry.plugins import load_plugin, register_law_of_file
from skyarm.scenario.controller_table import OwnOptionsWarning
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.loop import run
from skyarm.studies.compare.entrants import chosen_entrants
from skyarm.studies.compare.own_scenario import LAWS, OwnScenario
from skyarm.studies.compare.run_suite import fly_suite, other_report
from skyarm.studies.flights.store import files_by_label
from skyarm.studies.sweep import StudyError
from support.components import registry_kept
from support.studies import small_study

OWN = Path(__file__).parents[3] / "examples" / "own_law.py"


def flights(laws=LAWS, scenario="case3"):
    return OwnScenario(scenario=scenario, laws=laws, seeds=1).plan_cells()[0]


def test_the_laws_that_are_named_fly_and_the_own_one_first_if_it_is_named() -> None:
    def names(laws):
        return [each.entrant.name for each in flights(laws)]

    assert names(LAWS) == [
        "own",
        "paper_pd",
        "centroidal_tip",
    ], "paper_ct is the scenario's own"
    assert names(["indi", "paper_ct"]) == ["indi", "paper_ct"]
    assert names(["indi", "own"]) == ["own", "indi"]
    assert names(["own"]) == ["own"]
    own, named = flights(["own", "paper_pd"], "case1")
    assert own.scenario().controller.name != named.scenario().controller.name


def test_a_scenario_flies_on_its_own_plant_with_its_own_seed() -> None:
    own = dataclasses.replace(load_scenario("case3"), seed=7, kind="mujoco")
    suite = OwnScenario(scenario=own, laws=["own", "indi"])
    for each in suite.plan_cells()[0]:
        assert (each.scenario().kind, each.scenario().seed) == ("mujoco", 7)
    assert suite.options == {"seed": 7, "plant": "mujoco"}
    other = (
        OwnScenario(scenario=own, laws=["indi"], plant="rigid_body", seed=0)
        .plan_cells()[0][0]
        .scenario()
    )
    assert (other.kind, other.seed) == ("rigid_body", 0)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('{"suite": "case1"}', "case1"),
        *((each, "") for each in ('{"a": 1}', "[1]", "{", "")),
    ],
)
def test_a_report_of_another_comparison_is_found_in_its_folder(
    tmp_path: Path, text: str, found: str
) -> None:
    suite = OwnScenario(scenario="case3", laws=["own"])
    assert other_report(suite, tmp_path) == ""
    (tmp_path / "results.json").write_text(text)
    assert other_report(suite, tmp_path) == found


def test_an_autopilot_with_the_file_s_own_options_flies_once(tmp_path: Path) -> None:
    text = (
        resources.files("skyarm.scenario") / "library" / "hover_swing.toml"
    ).read_text("utf-8")
    begin, end = (
        text.index("[controller]"),
        text.index("[", text.index("[controller]") + 1),
    )
    for options, names in (
        ("", ["px4", "paper_ct"]),
        ("climb = 1.0\n", ["own", "px4", "paper_ct"]),
    ):
        file = tmp_path / "swing.toml"
        file.write_text(
            text[:begin] + f'[controller]\nautopilot = "px4"\n{options}' + text[end:],
            "utf-8",
        )
        laws = ["own", "px4", "paper_ct"]
        # the options of the file fly beside, so nothing warns of their loss
        assert [each.entrant.name for each in flights(laws, str(file))] == names
        told = (
            pytest.warns(OwnOptionsWarning, match="flies px4 with its defaults")
            if options
            else nullcontext()
        )
        with told:
            flights(laws[1:], str(file))


def test_a_flight_whose_autopilot_has_failed_is_told_and_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = run(load_scenario("case3", duration=0.1))
    failed = dataclasses.replace(
        log, info={**log.info, "status": "autopilot", "cause": "PX4 ended (no luck)"}
    )
    monkeypatch.setattr("skyarm.studies.flights.fly.run", lambda _: failed)
    suite = OwnScenario(scenario="case3", laws=["own", "px4"])
    found = fly_suite(suite, tmp_path)
    assert (
        "px4: autopilot: PX4 ended (no luck) (1 of 1)" in suite.report(found).markdown()
    )
    assert list(files_by_label(tmp_path / "rows")) == ["given__case3__own"]


@pytest.mark.parametrize("pair", [("indi", "indi"), ("paper_ct", "own_law.py")])
def test_two_names_of_one_law_are_refused_everywhere(
    pair, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(OWN, tmp_path / "own_law.py")
    if pair[1].endswith(".py"):
        pair = ("own_law.py:make_lqr", f"{tmp_path / 'own_law.py'}:make_lqr")
    with registry_kept():
        for name in pair:
            register_law_of_file(name)
        line = (
            f".*: must be a list of different presets or laws; '{pair[0]}' and"
            f" '{pair[1]}' are one"
        )
        with pytest.raises(ControllerError, match=line):
            flights(list(pair))
        with pytest.raises(ControllerError, match=line):
            chosen_entrants(pair, "--laws")
        with pytest.raises(StudyError, match=f"controllers = {line}"):
            small_study(controllers=list(pair))


def test_other_makers_and_files_are_other_laws() -> None:
    require_different(
        [
            "a.py:make",
            "a.py:other",
            "b.py:make",
            "sub/a.py:make",
            "paper_ct",
            "indi",
            "indi_tuned",
        ],
        "x",
    )


def test_the_table_says_own(tmp_path: Path) -> None:
    found = fly_suite(OwnScenario(scenario="case3", laws=["own", "paper_pd"]), tmp_path)
    rows = [
        line.split("|")[1].strip()
        for line in (tmp_path / "tables.md").read_text().splitlines()
        if "|" in line
    ]
    assert rows == ["law", "---", "own", "paper_pd"]
    assert list(found["summaries"]["given"]["case3"]) == ["own", "paper_pd"]
    assert "Means over the flights" in (tmp_path / "report.html").read_text("utf-8")


def test_a_metric_of_one_s_own_has_its_unit_and_three_digits(tmp_path: Path) -> None:
    with registry_kept():
        load_plugin(OWN.with_name("own_metric.py"))
        suite = OwnScenario(
            scenario=load_scenario("case3", duration=0.1), laws=["paper_pd"]
        )
        found = fly_suite(suite, tmp_path)
        (laws,) = found["summaries"]["given"].values()
        energy = laws["paper_pd"]["metrics"]["rotor_energy"]["mean"]
        head, _, row = (
            suite.report(found).markdown().split("| law ")[1].splitlines()[:3]
        )
    assert head.endswith("| work of the rotors' drag torque, J |")
    assert row.endswith(f"| {energy:.3g} |")
