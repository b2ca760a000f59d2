"""Every door that a law comes in by, and every place that flies it, tells the same
line.
"""

from __future__ import annotations

import dataclasses
import sys
import types
from collections.abc import Callable
from typing import Any

import pytest

import skyarm
from skyarm.control.law_checks import LawError
from skyarm.control.onboard.export_c import export_c
from skyarm.control.safety import with_safety_layer
from skyarm.records.registry.plugins import load_plugin, register_law_of_file
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.batch import Batch
from skyarm.simulate.examine import check_law, examine
from skyarm.simulate.loop import run, run_in_python
from skyarm.studies.stability.flight_margins import evidence
from support.components import (
    RESULTS,
    STATES,
    TRACES,
    WITHOUT_FLIGHT,
    Mistake,
    registry_kept,
)

PLANES: dict[str, Callable[[Any], Any]] = {
    "run": run,
    "floats": run_in_python,
    "mujoco": lambda scenario: run(dataclasses.replace(scenario, kind="mujoco")),
    "session": skyarm.Session,
    "batch": lambda scenario: Batch(scenario, ["plant.payload.mass"]),
    "check_law": check_law,
    "margins": lambda scenario: evidence(scenario, 0),
    "export_c": lambda scenario: export_c(
        scenario.controller, name="mine", period=0.005
    ),
    "with_safety_layer": lambda scenario: with_safety_layer(scenario.controller),
    "guarded_run": lambda scenario: run(under_guard(scenario)),
}
"""Everything that flies a law, or makes another form of it."""

TOLD = {
    "one_effort": RESULTS["one_effort"],
    "none": RESULTS["none"],
    "counter": STATES["counter"],
    "global": STATES["global"],
    "math": TRACES["math"],
}


@pytest.fixture(autouse=True)
def _kept():
    with registry_kept():
        yield


def under_guard(scenario: Any, *, compiled: bool = True) -> Any:
    """Under guard with limits given, so that the law is not asked for its stiffness."""
    par = dataclasses.make_dataclass("Both", ["model", "mixer", "gain"], frozen=True)
    model = scenario.controller.par.model
    both = dataclasses.replace(
        scenario.controller,
        par=par(model, skyarm.make_controller("indi", model).par.mixer, 10.0),
    )
    both = dataclasses.replace(both, compiled=compiled)
    return dataclasses.replace(
        scenario, controller=with_safety_layer(both, {"stiffness": 4.0, "damping": 2.2})
    )


def file_of(folder: Any, mistake: Mistake) -> Any:
    file = folder / "mine.py"
    file.write_text(mistake.text)
    return file


def planned(folder: Any, mistake: Mistake) -> Any:
    file = file_of(folder, mistake)
    register_law_of_file(f"{file}:make")
    return load_scenario("case1", controller=f"{file}:make", duration=0.25)


@pytest.mark.parametrize(
    "plane", [name for name in PLANES if name != "with_safety_layer"]
)
@pytest.mark.parametrize("name", TOLD)
def test_whatever_flies_it_tells_the_line(tmp_path, name, plane):
    mistake = TOLD[name]
    scenario = planned(tmp_path, mistake)
    check = PLANES[plane] if name not in STATES or plane == "export_c" else check_law
    with pytest.raises(ValueError, match="law '") as caught:
        check(scenario)
    line = str(caught.value)
    assert f"{tmp_path / 'mine.py'}:{mistake.line}: law '" in line
    assert "\n" not in line
    if plane != "guarded_run" or name not in STATES:
        assert line.endswith(mistake.words)


@pytest.mark.parametrize("name", ["one_effort", "none", "nan"])
def test_an_examination_finds_the_wrong_command_that_a_flight_refuses(tmp_path, name):
    mistake = RESULTS[name]
    scenario = planned(tmp_path, mistake)
    (found,) = examine("law", scenario.controller, scenario)
    assert found.owner == f"law {scenario.controller.name!r}"
    assert (found.file, found.line) == (str(tmp_path / "mine.py"), mistake.line)
    with pytest.raises(ValueError, match="law '") as caught:
        check_law(scenario)
    assert str(found) == str(caught.value)
    assert str(found).endswith(mistake.words)


def test_a_law_without_a_mixer_is_not_put_under_guard(tmp_path):
    scenario = planned(tmp_path, RESULTS["nan"])
    with pytest.raises(
        ValueError,
        match=(
            r"mine\.py:27: law 'mine' has constants without a Mixer: par\.mixer must be"
        ),
    ):
        with_safety_layer(scenario.controller)


DOORS = ("decorator", "plugin", "file_and_maker", "python", "make_controller")


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize(
    "mistake",
    [RESULTS["one_effort"], WITHOUT_FLIGHT["signature"]],
    ids=["flown", "unflown"],
)
def test_whichever_door_it_comes_in_by(tmp_path, monkeypatch, door, mistake):
    make = _registered(mistake.make) if door == "plugin" else mistake.make
    file = file_of(tmp_path, dataclasses.replace(mistake, make=make))
    module = types.ModuleType("mine")
    if door in ("decorator", "python", "make_controller"):
        monkeypatch.setitem(sys.modules, "mine", module)
        exec(compile(file.read_text(), str(file), "exec"), module.__dict__)
    if door in ("decorator", "make_controller"):
        skyarm.register.law("own_mistake")(module.make)
    if door == "plugin":
        load_plugin(file)
    if door == "file_and_maker":
        register_law_of_file(f"{file}:make")
    with pytest.raises(ValueError, match=rf"mine\.py:{mistake.line}: law '") as caught:
        _flown_by(door, file, module)
    assert str(caught.value).endswith(mistake.words)


def _flown_by(door: str, file: Any, module: Any) -> None:
    base = load_scenario("case1", duration=0.25)
    model = base.controller.par.model
    if door == "python":
        scenario = dataclasses.replace(base, controller=module.make(model))
    elif door == "make_controller":
        scenario = dataclasses.replace(
            base, controller=skyarm.make_controller("own_mistake", model)
        )
    else:
        law = f"{file}:make" if door == "file_and_maker" else "own_mistake"
        scenario = load_scenario("case1", controller=law, duration=0.25)
    run(scenario)


def _registered(make: str) -> str:
    return make.replace("def make", '@skyarm.register.law("own_mistake")\ndef make')


def test_shipped_laws_are_not_checked(monkeypatch):
    from skyarm.control import law_checks
    from skyarm.control.catalogue import LAWS
    from skyarm.control.law_checks import checked_law, is_own

    monkeypatch.setattr(
        law_checks, "trace", lambda *_, **__: pytest.fail("was checked")
    )
    scenario = load_scenario("case1", controller="paper_ct", duration=0.05)
    check_law(scenario)
    model = scenario.controller.par.model
    for name in LAWS:
        controller = skyarm.make_controller(name, model)
        assert not is_own(controller), name
        assert checked_law(controller) is controller.law
        if hasattr(controller.par, "mixer"):
            # limits are given, so that the law is not asked for its stiffness, which
            # takes a tenth of a second each
            assert not is_own(
                with_safety_layer(controller, {"stiffness": 4.0, "damping": 2.2})
            ), name


def test_a_law_of_ones_own_is_found_wherever_it_hides(tmp_path):
    """Within a shipped guard, a partial function, a method, an object, a function of
    functions.
    """
    import functools

    from skyarm.control.law_checks import is_own

    controller = planned(tmp_path, RESULTS["nan"]).controller
    law = controller.law
    assert is_own(controller)

    class Holder:
        def law(self, memory: Any, seen: Any, wanted: Any, dt: Any, *, par: Any) -> Any:
            return law(memory, seen, wanted, dt, par=par)

        __call__ = law

    for each in (
        functools.partial(law),
        Holder().law,
        Holder(),
        functools.lru_cache(law),
        functools.wraps(law)(law),
    ):
        assert is_own(dataclasses.replace(controller, law=each))
    assert is_own(under_guard(planned(tmp_path, RESULTS["nan"])).controller)


def test_a_law_that_is_called_with_floats_keeps_what_it_likes(tmp_path):
    """Its results are looked at all the same."""
    scenario = planned(tmp_path, STATES["counter"])
    flown = dataclasses.replace(
        scenario, controller=dataclasses.replace(scenario.controller, compiled=False)
    )
    log = run(flown)
    assert (log.rotor_commands[1:, 0] - log.rotor_commands[:-1, 0] == 1.0).all()
    (tmp_path / "b").mkdir()
    scenario = planned(tmp_path / "b", RESULTS["one_effort"])
    wrong = dataclasses.replace(
        scenario, controller=dataclasses.replace(scenario.controller, compiled=False)
    )
    with pytest.raises(
        ValueError, match="gives 1 efforts: must be 2, one for each joint"
    ):
        run(wrong)


def test_a_called_law_under_guard_is_not_given_up_for_a_mistake_in_its_code(tmp_path):
    """The guard flies on where numbers or a solver fail; a law that gives too few
    efforts is wrong.
    """
    scenario = under_guard(planned(tmp_path, RESULTS["one_effort"]), compiled=False)
    with pytest.raises(
        LawError,
        match=r"mine\.py:27: law 'mine' gives 1 efforts: must be 2, one for each joint",
    ):
        run(scenario)


def test_an_error_of_the_laws_own_stays_what_it_is(tmp_path):
    """In Python its traceback is what helps; the command line makes it one line."""
    body = (
        "def law(memory, seen, wanted, dt, *, par):\n    raise KeyError('no gain of"
        " this name')\n"
    )
    scenario = planned(tmp_path, Mistake(body, ""))
    with pytest.raises(KeyError, match="no gain of this name") as caught:
        run(scenario)
    assert str(tmp_path / "mine.py") in str(caught.traceback[-1].path)
