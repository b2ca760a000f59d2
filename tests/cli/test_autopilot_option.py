"""Flights under an autopilot by the command line: options behind the colon, progress,
causes, and Ctrl-C.
"""

from __future__ import annotations

import dataclasses
import signal
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from skyarm.cli import run_command
from skyarm.cli.autopilot_option import (
    load_under_autopilot,
    outside_command,
    with_typed_options,
)
from skyarm.cli.output import bar
from skyarm.control.controller import autopilot_of
from skyarm.log.flight_log import Log
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop import run, run_until_interrupted
from support.commands import refused, skyarm

OWN = (
    'schema = 1\nname = "own"\nduration = 1.0\n[plant]\nvehicle ='
    ' "hummingbird"\n[controller]\nautopilot = "px4"\n[reference]\nbase = { kind ='
    ' "hover", position = [0.0, 0.0, 1.0] }\n'
)
"""Scenario of a file that has an autopilot."""

PREPARED = {"name": "px4", "prepared_s": 19.0}


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Program in PX4's place that ends at once without a word."""
    (tmp_path / "etc").mkdir()
    path = tmp_path / "px4"
    path.write_text("#!/bin/sh\nexit 0\n", "utf-8")
    path.chmod(0o755)
    monkeypatch.setenv("SKYARM_PX4", str(path))
    monkeypatch.chdir(tmp_path)
    return path


def test_options_behind_the_colon_are_those_of_the_record() -> None:
    scenario = load_scenario("case3", controller="px4")
    assert with_typed_options(scenario, "px4") is scenario
    found = with_typed_options(
        scenario, "px4:outside,instance=3,climb=1.5,transcript=a.tape"
    )
    assert autopilot_of(found.controller) == dataclasses.replace(
        autopilot_of(scenario.controller),
        outside=True,
        instance=3,
        climb=1.5,
        transcript="a.tape",
    )
    tables = (
        "px4:parameters={MPC_XY_P=1.2,A=1},"
        "joint_gains={stiffness=[20,20],damping=[5,5]},"
        'transcript="a,b",climb=2'
    )
    par = with_typed_options(scenario, tables).controller.par
    assert par.autopilot.parameters == (("MPC_XY_P", 1.2), ("A", 1))
    assert (
        par.joint_gains.stiffness,
        par.autopilot.transcript,
        par.autopilot.climb,
    ) == ((20.0, 20.0), "a,b", 2.0)


def test_a_file_keeps_the_options_of_its_own_autopilot(tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    file.write_text(
        OWN.replace('"px4"', '"px4"\nclimb = 1.0\nparameters = { MPC_XY_P = 1.2 }'),
        "utf-8",
    )
    record = autopilot_of(
        load_under_autopilot(str(file), "px4:patience=10", None).controller
    )
    assert (record.climb, record.parameters, record.patience) == (
        1.0,
        (("MPC_XY_P", 1.2),),
        10.0,
    )
    record = autopilot_of(load_under_autopilot(str(file), "ardupilot", None).controller)
    assert (record.name, record.climb) == ("ardupilot", 0.5)


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("px5:outside", "--autopilot = 'px5:outside': did you mean 'px4'"),
        (
            "px4:program=3",
            "program = 3: autopilot 'px4' has no such option; it has parameters, climb",
        ),
        ("px4:climb=1,climb=2", "climb = '2': must be given once"),
        ("px4:climb=" + "[" * 3000, "controller.autopilot.climb = '[[["),
        (
            "px4:instance=x",
            "controller.autopilot.instance = 'x': must be a whole number",
        ),
        ("px4:climb=0", "controller.autopilot.climb = 0.0: must be at least 0.2"),
    ],
)
def test_other_options_and_values_are_refused(typed: str, words: str) -> None:
    refused(skyarm("run", "case3", "--autopilot", typed), words)


def test_the_command_of_the_program_outside_names_a_law_where_the_file_has_none(
    tmp_path: Path,
) -> None:
    scenario = with_typed_options(
        load_scenario("case3", controller="px4"), "px4:outside,instance=2"
    )
    command = (
        "skyarm fly {} --link mavlink://127.0.0.1:14542 --joints udp://127.0.0.1:14642"
    )
    assert outside_command("case3", scenario) == command.format("case3")
    file = tmp_path / "own.toml"
    file.write_text(OWN, "utf-8")
    assert outside_command(str(file), scenario) == command.format(f"{file} --laws LAW")
    assert outside_command("case3", load_scenario("case3")) == ""
    other = with_typed_options(
        load_scenario("case3", controller="ardupilot"), "ardupilot:outside"
    )
    assert outside_command("case3", other).endswith(":14640 --rate-bandwidth 18,18,6")
    slow = dataclasses.replace(
        other.plant.vehicle,
        rotors=tuple(
            dataclasses.replace(rotor, time_constant_up=0.2, time_constant_down=0.2)
            for rotor in other.plant.vehicle.rotors
        ),
    )
    plant = dataclasses.replace(
        other, plant=dataclasses.replace(other.plant, vehicle=slow)
    )  # the parameters are the model's
    assert outside_command("case3", plant) == outside_command("case3", other)


@pytest.mark.parametrize("quiet", [False, True])
def test_a_take_off_that_fails_is_one_line_of_cause(program: Path, quiet: bool) -> None:
    ended = skyarm(
        "run", "case3", "--autopilot", "px4", *(["--quiet"] if quiet else [])
    )
    assert ended.code == 3
    first, *others = (ended.err if quiet else ended.out).splitlines()
    cause = (
        "PX4 ended while it started with code 0 and printed nothing: is it PX4's"
        " program?"
    )
    assert (
        first.removeprefix("skyarm: ")
        == f"case3: autopilot, no take-off in 0 s: {cause}"
    )
    assert all(line.startswith(("log: ", "picture: ")) for line in others)
    assert "it hovers" not in ended.err


def test_quiet_says_the_cause_of_a_law_s_flight_on_standard_error(
    tmp_path: Path,
) -> None:
    file = tmp_path / "low.toml"
    file.write_text(
        'schema = 1\nname = "low"\nduration = 3.0\n[plant]\nvehicle ='
        ' "hummingbird"\n[controller]\npreset ='
        ' "centroidal_joint"\n[reference.base]\nkind = "signals"\nz = [0.5, { kind ='
        ' "sequence", start = 0.1, segments = [[0.5, -1.0]] }]\n',
        "utf-8",
    )
    ended = skyarm("run", str(file), "--quiet", "--out", str(tmp_path / "out"))
    assert (ended.code, ended.out) == (3, "")
    warned, cause = ended.err.splitlines()  # the fall begins with a step of the rate
    assert warned.startswith(
        "skyarm: warning: low: reference.base: the velocity steps by 2 m/s at 0.1 s"
    )
    assert cause.startswith("skyarm: low: ground, ")


def flown_for(seconds: float) -> Callable[..., tuple[Log, BaseException | None]]:
    """Flight of the paper's law in the autopilot's place, which a Ctrl-C ends after a
    time.
    """

    def fly(
        planned: Scenario,
        progress: Callable[[int, int], None],
        preparing: Callable[[float, float], None],
        _: Path,
    ) -> tuple[Log, BaseException | None]:
        preparing(12.0, 120.0)
        preparing(19.0, 19.0)
        scenario = load_scenario("case3", duration=2.0)

        def interrupt(done: int, _total: int) -> None:
            if done >= seconds * scenario.rates.control:
                signal.raise_signal(signal.SIGINT)

        log, interrupted = run_until_interrupted(scenario, interrupt)
        return (
            dataclasses.replace(log, info={**log.info, "autopilot": PREPARED}),
            interrupted,
        )

    return fly


@pytest.fixture
def signals_kept() -> Iterator[None]:
    """A command that was ended by a signal ignores signals from then on: this process
    is one of other tests, too.
    """
    held = {each: signal.getsignal(each) for each in signal.valid_signals()}
    yield
    for each, handler in held.items():
        if handler is not None and signal.getsignal(each) != handler:
            signal.signal(each, handler)


@pytest.mark.usefixtures("signals_kept")
def test_ctrl_c_keeps_the_log_of_what_an_autopilot_has_flown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_command, "run_until_interrupted", flown_for(1.0))
    monkeypatch.setattr(run_command, "bar", partial(bar, pause=0.0))
    ended = skyarm("run", "case3", "--autopilot", "px4:outside", "--out", str(tmp_path))
    assert ended.code == 130
    assert "case3: running, 1 s of 2 s" in ended.out
    assert "autopilot px4: hovered 19 s after power-on" in ended.out
    assert len(skyarm_log(tmp_path).time) == 200
    assert ended.err.splitlines() == [
        "skyarm: case3: take-off of px4, 12 s",
        (
            "skyarm: it hovers: skyarm fly case3 --link mavlink://127.0.0.1:14540"
            " --joints udp://127.0.0.1:14640"
        ),
        "skyarm: interrupted; finished files are whole",
    ]


def test_the_studio_checks_its_folder_first_and_makes_none(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("", "utf-8")
    refused(
        skyarm("studio", "--out", str(file / "out")),
        "output folder = ",
        "must be writable",
    )
    refused(
        skyarm("studio", "absent.toml", "--port", "0", "--out", str(tmp_path / "new")),
        "absent.toml",
    )
    assert not (tmp_path / "new").exists()
    refused(
        skyarm(
            "studio",
            "absent.toml",
            "--port",
            "0",
            "--out",
            str(tmp_path / "a" / "b" / "c"),
        ),
        "absent.toml",
    )
    assert not (tmp_path / "a").exists()


def skyarm_log(folder: Path) -> Log:
    from skyarm.log.formats import load_log

    return load_log(folder / "case3.npz")


def test_a_flight_that_nobody_interrupts_is_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scenario = load_scenario("case3", duration=0.2)
    log, interrupted = run_until_interrupted(scenario)
    assert interrupted is None
    assert log.position.tolist() == run(scenario).position.tolist()
