"""Suites of users: what a file says flies, each wrong file is one line, and nothing of
it is lost in silence.
"""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.log.metrics.metric_catalogue import metric_words
from skyarm.scenario.controller_table import controller_by_name
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.studies.compare.compare_laws import compare, suite_of
from skyarm.studies.compare.run_suite import fly_suite
from skyarm.studies.compare.suite_file import FileSuite, load_suite
from skyarm.studies.trial.facts import setting_of
from skyarm.vehicle.vehicle_files import LIBRARY

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "examples" / "loads_and_gusts.toml"

NAME = "ee_error_mean_continuous"

SHORT = """
[suite]
title = "Short"
laws = ["paper_ct"]
duration = 1.0

[[trials]]
name = "push"
unit = "N"
values = [0.5, 1.0]
base = "slow_circle"
arm = "gentle"
noisy = true
flights = 2
entries.environment.forces = [
    { kind = "disturbance", force = [0, { kind = "constant", value = 0.0 }, 0] },
]
numbers."environment.forces.0.force.y.value" = "value * weight"
success.position_error_mean_continuous = 0.05

[[trials]]
name = "mass"
scenario = "case3"
values = [0.0, 0.02]
numbers."plant.payload.mass" = "value"
vary."plant.vehicle.base.mass" = { uniform = [0.7, 0.8] }
flights = 3
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(SHORT, "utf-8")
    return path


def test_a_trial_flies_every_value_with_the_same_noise_and_draws(file: Path) -> None:
    (push, mass), refused = load_suite(file).plan_cells()
    assert refused == {}
    work = push.work()
    np.testing.assert_array_equal(
        work.columns["environment.forces.0.force.y.value"], [0.5, 0.5, 1.0, 1.0]
    )
    np.testing.assert_array_equal(work.episodes, [0, 1, 0, 1])
    work = mass.work()
    drawn = work.columns["plant.vehicle.base.mass"]
    np.testing.assert_array_equal(drawn[:3], drawn[3:])
    assert len(set(drawn)) == 3
    assert 0.7 <= drawn.min() < drawn.max() <= 0.8
    np.testing.assert_array_equal(
        work.columns["plant.payload.mass"], [0.0] * 3 + [0.02] * 3
    )


def test_a_cell_flies_as_the_scenario_with_the_same_words_does(file: Path) -> None:
    """A hover with its entries written by hand, run one flight at a time."""
    found = fly_suite(load_suite(file, only=["push"]), file.parent / "out")
    setting = setting_of(duration=1.0)
    (flights,), _ = load_suite(file, only=["push"]).plan_cells()
    scenario = flights.scenario()
    assert scenario.agent.controller == controller_by_name(scenario, "paper_ct")
    assert scenario.agent.plant.vehicle == setting.truth
    for value, point in zip(
        (0.5, 1.0), found["trials"]["push"]["laws"]["paper_ct"], strict=True
    ):
        errors = []
        for episode in range(2):
            flown = with_numbers(
                scenario, {"environment.forces.0.force.y.value": value}
            )
            log = skyarm.run(dataclasses.replace(flown, episode=episode))
            errors.append(skyarm.score(log, [NAME])[NAME])
        assert point["means"][NAME] == pytest.approx(np.mean(errors), rel=1e-9)
        assert (point["flights"], point["completed"]) == (2, 2)


def test_values_go_with_the_weight_of_another_vehicle(file: Path) -> None:
    (flights,), _ = load_suite(
        file, only=["push"], vehicle="hexarotor_arm6", laws=("centroidal_tip",)
    ).plan_cells()
    weight = float(skyarm.load_vehicle("hexarotor_arm6").mass) / float(
        setting_of().truth.mass
    )
    column = flights.work().columns["environment.forces.0.force.y.value"]
    np.testing.assert_allclose(column, np.repeat([0.5, 1.0], 2) * weight, rtol=1e-12)


def test_values_that_differ_late_fly_as_they_are(file: Path) -> None:
    near = SHORT.replace("values = [0.5, 1.0]", "values = [0.50001, 0.50002]")
    file.write_text(near, "utf-8")
    (flights,), _ = load_suite(file, only=["push"]).plan_cells()
    assert flights.points == (0.50001, 0.50002)


def test_scenarios_of_values_that_differ_late_have_files_of_their_own(
    file: Path,
) -> None:
    near = SHORT.replace("values = [0.5, 1.0]", "values = [0.5, 0.50000001]")
    near = near.replace('{ kind = "constant", value = 0.0 }', '"= 2 * value"')
    near = "\n".join(line for line in near.splitlines() if "force.y.value" not in line)
    file.write_text(near, "utf-8")
    cells, _ = load_suite(file, only=["push"]).plan_cells()
    labels = [each.label for each in cells]
    assert [label.rpartition("_")[2] for label in labels] == ["0.5", "0.50000001"]


def test_an_entry_of_the_value_makes_a_scenario_of_each_value(file: Path) -> None:
    changed = SHORT.replace('{ kind = "constant", value = 0.0 }', '"= 2 * value"')
    changed = "\n".join(
        line for line in changed.splitlines() if "force.y.value" not in line
    )
    file.write_text(changed, "utf-8")
    cells, _ = load_suite(file, only=["push"]).plan_cells()
    assert [
        number_at(each.scenario(), "environment.forces.0.force.y") for each in cells
    ] == [1.0, 2.0]
    assert len({each.label for each in cells}) == 2


def test_a_success_is_a_flight_within_every_bound(file: Path) -> None:
    file.write_text(SHORT.replace("= 0.05", "= 1e-9"), "utf-8")
    suite = load_suite(file, only=["push"])
    found = fly_suite(suite, file.parent / "out")
    assert [
        each["success"] for each in found["trials"]["push"]["laws"]["paper_ct"]
    ] == [0, 0]
    assert "| paper_ct | 0 of 2; " in suite.report(found).markdown()


def test_a_law_that_does_not_fit_is_named_and_the_others_fly(file: Path) -> None:
    suite = load_suite(file, laws=("own", "paper_ct"))
    cells, refused = suite.plan_cells()
    assert refused == {
        "own in push": "flies trials with a scenario, whose own law it is"
    }
    assert {each.name[1:] for each in cells} == {
        ("push", "paper_ct"),
        ("mass", "own"),
        ("mass", "paper_ct"),
    }
    own = next(each for each in cells if each.entrant.name == "own")
    assert (
        own.scenario().agent.controller
        == skyarm.load_scenario("case3", duration=1.0).agent.controller
    )


def test_a_vehicle_without_an_arm_hovers_under_the_laws_that_fit_it(file: Path) -> None:
    suite = load_suite(
        file,
        only=["push"],
        vehicle="hummingbird",
        laws=("indi_tuned", "centroidal_tip"),
    )
    cells, refused = suite.plan_cells()
    assert [each.entrant.name for each in cells] == ["indi_tuned"]
    assert "has no end_effector" in refused["centroidal_tip in push"]
    found = fly_suite(suite, file.parent / "out")
    assert [
        each["completed"] for each in found["trials"]["push"]["laws"]["indi_tuned"]
    ] == [2, 2]


def test_a_vehicle_that_is_too_heavy_is_named_with_its_field(file: Path) -> None:
    heavy = file.parent / "heavy.toml"
    text = (LIBRARY / "hummingbird.toml").read_text("utf-8")
    heavy.write_text(text.replace("mass = 0.716", "mass = 71.6", 1), "utf-8")
    with pytest.raises(
        ValueError,
        match=re.escape(f"trials[push]: vehicle = '{heavy}': must be able to hover;"),
    ):
        load_suite(file, only=["push"], vehicle=str(heavy)).plan_cells()


def test_python_and_the_command_take_the_file_and_a_repeated_call_flies_nothing(
    file: Path,
) -> None:
    assert isinstance(suite_of(file, ["paper_ct"], "laws"), FileSuite)
    out, told = file.parent / "out", list[int]()
    results = compare(file, ["paper_ct"], out, only=["mass"])
    assert json.loads((out / "suite.json").read_text("utf-8")) == results.document
    stamps = {path: path.stat().st_mtime_ns for path in (out / "rows").iterdir()}
    again = compare(
        file, ["paper_ct"], out, only=["mass"], progress=lambda *_: told.append(1)
    )
    assert again.document == results.document
    assert {
        path: path.stat().st_mtime_ns for path in (out / "rows").iterdir()
    } == stamps


def test_the_example_plans_on_three_vehicles() -> None:
    for vehicle in ("", "hexarotor_arm6", "quadrotor_roll_arm2"):
        suite = load_suite(EXAMPLE, vehicle=vehicle, only=["load"])
        cells, refused = suite.plan_cells()
        assert refused == {}
        assert [len(each.points) for each in cells] == [3, 3]


WRONG = {
    "suite.colour = 'red'": ("[suite]", '[suite]\ncolour = "red"'),
    "suite.laws = 'paper_ctt': did you mean": ('["paper_ct"]', '["paper_ctt"]'),
    "suite.laws = []: must be a list of one or more": ('["paper_ct"]', "[]"),
    "suite.title = 3: must be text": ('"Short"', "3"),
    "trials = []: must be one or more tables": (SHORT[SHORT.index("[[trials]]") :], ""),
    "trials[1].name: is missing": ('name = "mass"\n', ""),
    "trials[push].name = 'push': must differ from those of other trials": (
        'name = "mass"',
        'name = "push"',
    ),
    "trials[push].base = 'slow_circl': did you mean 'slow_circle'": (
        '"slow_circle"',
        '"slow_circl"',
    ),
    "trials[push].arm = 3": ('"gentle"', "3"),
    "trials[push].values = [1.0, 1.0]": ("[0.5, 1.0]", "[1.0, 1.0]"),
    "trials[push].values = '1': must be a list of numbers": ("[0.5, 1.0]", '"1"'),
    "trials[push].noisy = 'yes'": ("noisy = true", 'noisy = "yes"'),
    "trials[push].flights = 0: must be a whole number from 1": (
        "flights = 2",
        "flights = 0",
    ),
    "'wait' must be a named number; did you mean 'weight'": (
        "value * weight",
        "value * wait",
    ),
    "numbers: path = 'environment.forces.0.force.w.value': no 'w' here": (
        "force.y.value",
        "force.w.value",
    ),
    "vary: path = 'plant.vehicle.base.mas': no 'mas' here": ("base.mass", "base.mas"),
    (
        "trials[push].success.tilt_mx = 'tilt_mx': did you mean 'tilt_max'?"
        " must be a metric"
    ): (
        "position_error_mean_continuous",
        "tilt_mx",
    ),
    "suite.metrics = 'tilt_mx': did you mean 'tilt_max'? must be a metric": (
        "[suite]",
        '[suite]\nmetrics = ["tilt_mx"]',
    ),
    "suite.metrics = 'standard': must be a metric, not a group": (
        "[suite]",
        '[suite]\nmetrics = ["standard"]',
    ),
    "trials[push]: enviroment": ("entries.environment", "entries.enviroment"),
    "entries.environment.forces[0].force[1] = '{eas}': did you mean 'ease'": (
        '{ kind = "constant", value = 0.0 }',
        '"{eas}"',
    ),
    "trials[mass]: scenario = 'case33': did you mean 'case3'": ('"case3"', '"case33"'),
    "trials[mass].base: must be left out beside scenario": (
        '"case3"',
        '"case3"\nbase = "circle"',
    ),
    "must have exactly one of uniform": ("uniform", "unifrm"),
    "body.mass = -": ("[0.7, 0.8]", "[-1.0, -0.5]"),
    "must be an expression, as": ('"value"\n', "3.0\n"),
    "must not stand under numbers as well": (
        'vary."plant.vehicle.base.mass"',
        'vary."plant.payload.mass"',
    ),
    (
        "entries.environment.forces[0].force[1].value = 'value': must be '= value',"
        " an expression"
    ): (
        "value = 0.0",
        'value = "value"',
    ),
    (
        "entries.environment.forces[0].force[1].value = 'valu': at 1: 'valu' must be"
        " a named number"
    ): (
        "value = 0.0",
        'value = "=valu"',
    ),
    (
        "trials[mass].entries.duration = 3: must be left out; duration of the trial"
        " says it"
    ): (
        "flights = 3",
        "flights = 3\nentries.duration = 3",
    ),
    "trials[mass].entries.plant.kind = 'mujoco': must be left out; --plant says it": (
        "flights = 3",
        'flights = 3\nentries.plant.kind = "mujoco"',
    ),
    (
        "trials[mass].values = [0.0, 0.02]: must be one number: no expression names"
        " value"
    ): (
        '"value"\n',
        '"0.1"\n',
    ),
    "suite.duration = -1.0: must be above 0": ("duration = 1.0", "duration = -1.0"),
    "suite.flights = 2.5: must be a whole number from 1": (
        "duration = 1.0",
        "duration = 1.0\nflights = 2.5",
    ),
    "suite.laws = ['paper_ct', 'paper_ct']": (
        '["paper_ct"]',
        '["paper_ct", "paper_ct"]',
    ),
    "unknown field; did you mean 'suite'": ("[suite]", "[suit]"),
    "unknown field; did you mean 'trials'": (
        SHORT,
        SHORT.replace("[[trials]]", "[[trial]]"),
    ),
    "trials[pu/sh].name = 'pu/sh': must be the name of a file": ('"push"', '"pu/sh"'),
    "vehicle = 'pelikan_arm2': did you mean 'pelican_arm2'": (
        "[suite]",
        '[suite]\nvehicle = "pelikan_arm2"',
    ),
    "trials[push].duration = -1: must be above 0": (
        "noisy = true",
        "noisy = true\nduration = -1",
    ),
    "windows.steady = [4, 90) s: must end": (
        "noisy = true",
        "noisy = true\nwindows = { steady = [4, 90] }",
    ),
    "suite: must be a suite file, and this is a scenario file, for 'skyarm run'": (
        "[suite]",
        "[plant]",
    ),
}


@pytest.mark.parametrize("words", WRONG)
def test_a_wrong_file_is_one_line(file: Path, words: str) -> None:
    before, after = WRONG[words]
    assert before in SHORT
    file.write_text(SHORT.replace(before, after, 1), "utf-8")
    with pytest.raises(ValueError, match=re.escape(words)) as error:
        load_suite(file).plan_cells()
    assert str(error.value).startswith(f"{file}: ")
    assert "\n" not in str(error.value)


def test_of_several_vehicles_the_largest_counts_or_the_one_that_is_named(
    file: Path,
) -> None:
    names = [
        "ee_error_mean_continuous",
        "left/ee_error_mean_continuous",
        "right/ee_error_mean_continuous",
    ]
    file.write_text(
        f'[suite]\nlaws = ["own"]\nmetrics = {json.dumps(names)}\nduration = 0.5\n'
        '[[trials]]\nname = "bar"\nscenario = "two_carry_a_bar"\n',
        "utf-8",
    )
    found = fly_suite(load_suite(file), file.parent / "out")
    (point,) = found["trials"]["bar"]["laws"]["own"]
    largest, left, right = (point["means"][name] for name in names)
    assert largest == max(left, right)


def test_an_expression_under_numbers_may_begin_as_one_in_entries(file: Path) -> None:
    plain = load_suite(file).plan_cells()[0]
    file.write_text(SHORT.replace('"value * weight"', '"= value * weight"'), "utf-8")
    signed = load_suite(file).plan_cells()[0]
    for one, other in zip(plain, signed, strict=True):
        np.testing.assert_equal(one.work().columns, other.work().columns)


def test_gains_of_an_entry_are_of_the_law_of_the_scenario_alone(file: Path) -> None:
    """Any other law comes with gains of its own, and would not see them."""
    file.write_text(f'{SHORT}entries.controller.preset = "paper_pd"\n', "utf-8")
    cells, refused = load_suite(
        file, only=["mass"], laws=("own", "paper_ct")
    ).plan_cells()
    (cell,) = cells
    assert (
        cell.scenario().agent.controller
        == skyarm.load_scenario("case3", controller="paper_pd").agent.controller
    )
    assert refused == {
        "paper_ct in mass": (
            "entries.controller is of the law 'own' alone; another law comes with its"
            " own gains"
        )
    }
    with pytest.raises(
        ValueError,
        match=re.escape(f"{file}: paper_ct in mass: entries.controller is of"),
    ):
        load_suite(file, only=["mass"]).plan_cells()


@pytest.mark.parametrize(
    "entries", ["entries.agents.left.controller.bandwidth = 0.3", "entries.agents = 3"]
)
def test_gains_of_a_member_are_of_the_law_of_the_scenario_too(
    file: Path, entries: str
) -> None:
    file.write_text(
        '[suite]\nlaws = ["indi"]\n[[trials]]\nname = "bar"\nscenario ='
        f' "two_hold_a_bar"\n{entries}\n',
        "utf-8",
    )
    words = (
        "entries.controller is of the law 'own' alone"
        if "left" in entries
        else "agents = 3"
    )
    with pytest.raises(ValueError, match=re.escape(words)):
        load_suite(file).plan_cells()


def test_laws_of_the_command_may_be_files_of_gains_but_no_misspelt_name(
    file: Path,
) -> None:
    gains = file.parent / "tuned.toml"
    gains.write_text(
        'schema = 1\n[law]\npreset = "paper_ct"\n[gains]\n"gains.position" = 8.0\n',
        "utf-8",
    )
    cells, refused = suite_of(
        file, [str(gains), "own"], "--laws", only=["mass"]
    ).plan_cells()
    tuned, _ = cells
    assert refused == {}
    assert tuple(tuned.scenario().agent.controller.par.gains.position) == (
        8.0,
        8.0,
        8.0,
    )
    with pytest.raises(
        ValueError, match="--laws = 'paper_ctt': did you mean 'paper_ct'"
    ):
        suite_of(file, ["paper_ctt"], "--laws")


def test_a_vehicle_beside_scenarios_alone_is_refused(file: Path) -> None:
    with pytest.raises(
        ValueError,
        match=(
            "--vehicle = 'pelican_arm2': must be left out: every trial has a scenario"
        ),
    ):
        load_suite(file, only=["mass"], vehicle="pelican_arm2")
    assert load_suite(file, vehicle="pelican_arm2").vehicle == "pelican_arm2"
    alone = SHORT.replace("[suite]", '[suite]\nvehicle = "pelican_arm2"')
    file.write_text(
        alone[: alone.index("[[trials]]")] + alone[alone.rindex("[[trials]]") :],
        "utf-8",
    )
    with pytest.raises(
        ValueError,
        match=(
            r"suite\.vehicle = 'pelican_arm2': must be left out: every trial has a"
            r" scenario"
        ),
    ):
        load_suite(file)


def test_a_trial_without_chance_flies_once(file: Path) -> None:
    file.write_text(SHORT.replace("noisy = true\n", ""), "utf-8")
    push, mass = load_suite(file).plan_cells()[0]
    assert (push.work().count, mass.work().count) == (2, 6)


def test_a_table_says_why_all_ended_and_what_a_success_is(file: Path) -> None:
    text = SHORT.replace("[suite]", '[suite]\nmetrics = ["rate_rms"]').replace(
        '"value * weight"', '"value * 100"'
    )
    file.write_text(
        text.replace("noisy = true\nflights = 2\n", "").replace("= 1.0", "= 3.0", 1),
        "utf-8",
    )
    suite = load_suite(file, only=["push"])
    found = fly_suite(suite, file.parent / "out")
    points = found["trials"]["push"]["laws"]["paper_ct"]
    assert all(not each["completed"] and each["endings"] for each in points)
    table = suite.report(found).markdown()
    assert f"| paper_ct | {', '.join(points[0]['endings'])} |" in table
    words, unit = metric_words("position_error_mean_continuous")
    assert f"Success: {words} at most 0.05 {unit}." in table
    small = [
        each
        | {
            "completed": 1,
            "success": 1,
            "flights": 1,
            "means": {"rate_rms": 0.000512},
        }
        for each in points
    ]
    found["trials"]["push"]["laws"]["paper_ct"] = small
    assert "| paper_ct | 0.000512 | 0.000512 |" in suite.report(found).markdown()


def test_only_takes_names_of_trials(file: Path) -> None:
    with pytest.raises(ValueError, match="--only = 'pull': must be one of push, mass"):
        load_suite(file, only=["pull"])
