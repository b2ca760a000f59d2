"""Presets, laws and tuned laws by one name, wherever a command takes a controller."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

import skyarm as library
from skyarm.cli.output import write_json
from skyarm.control.catalogue import (
    LAWS,
    PRESETS,
    is_named,
    make_controller,
    make_named,
    make_tuned,
    preset,
    tuned_factors,
)
from skyarm.control.model import Model
from skyarm.records.leaves import leaves
from skyarm.simulate import Log
from support.commands import refused, skyarm

MODEL = Model(vehicle=library.load_vehicle("hummingbird_arm2"))
KNOWN = {
    "control_period": 0.0025,
    "reference_period": 0.01,
    "delay": 0.005,
    "delay_periods": 2,
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_name_makes_the_controller_that_its_maker_makes() -> None:
    for name in PRESETS:
        assert leaves(make_named(name, MODEL).par) == leaves(preset(name, MODEL).par)
    for name in LAWS:
        found, own = make_named(name, MODEL), make_controller(name, MODEL)
        assert (found.name, leaves(found.par)) == (own.name, leaves(own.par))
    for name in tuned_factors():
        assert leaves(make_named(f"{name}_tuned", MODEL).par) == leaves(
            make_tuned(name, MODEL).par
        )
        assert leaves(make_named(f"{name}_tuned", MODEL).par) != leaves(
            make_named(name, MODEL).par
        )


def test_no_name_means_two_controllers() -> None:
    assert not set(PRESETS) & set(LAWS)
    assert not any(name.endswith("_tuned") for name in (*PRESETS, *LAWS))
    assert not is_named("centroidal_tuned")
    assert not is_named("centroidal_tuned")
    assert not is_named(["centroidal"])


@pytest.mark.parametrize(
    ("name", "periods"),
    [("centroidal", 2), ("centroidal_tip", 2), ("indi", 2), ("indi_tuned", 2)],
)
def test_a_controller_is_told_of_its_loop(name: str, periods: int) -> None:
    assert make_named(name, MODEL, KNOWN).par.delay_periods == periods
    assert make_named(name, MODEL).par.delay_periods == 0


@pytest.mark.parametrize(
    ("name", "law"),
    [("centroidal", "centroidal_joint"), ("indi", "indi"), ("kim2013", "")],
)
def test_run_takes_any_law(folder: Path, name: str, law: str) -> None:
    assert skyarm("run", "case1", "--duration", "0.1", "--laws", name).code == 0
    assert Log.load_npz(folder / "out" / "run" / "case1.npz").info["controller"] == (
        law or name
    )


def test_run_takes_tuned_gains(folder: Path) -> None:
    records = []
    for name in ("indi", "indi_tuned"):
        assert skyarm("run", "case1", "--duration", "0.1", "--laws", name).code == 0
        records.append(
            Log.load_npz(folder / "out" / "run" / "case1.npz").info["scenario_record"]
        )
    assert records[0] != records[1]


def test_c_is_exported_of_any_name(folder: Path) -> None:
    for name in ("ct_ladder", "ct_ladder_tuned", "centroidal_joint"):
        ended = skyarm(
            "export",
            "--to",
            "c",
            name,
            "--vehicle",
            "hummingbird_arm2",
            "--out",
            f"{name}.c",
        )
        assert ended.code == 0, ended.err
        assert f"{name}_step" in (folder / f"{name}.c").read_text()


@pytest.mark.parametrize(
    "command",
    [
        ("run", "case1", "--laws", "{}"),
        ("margins", "case1", "--laws", "{}"),
        ("compare", "case1", "--laws", "own,{}x"),
        ("sweep", "carrying", "--laws", "{}"),
        ("film", "case1", "x.webp", "--laws", "{}"),
        ("studio", "case1", "--laws", "{}"),
        ("export", "--to", "c", "{}", "--vehicle", "hummingbird", "--out", "x.c"),
    ],
)
@pytest.mark.parametrize("name", ["lqr", "centroidal_tuned", "indi_tuned_tuned", ""])
def test_an_unknown_name_is_refused_in_short_with_where_to_see_all(
    folder: Path, command: tuple[str, ...], name: str
) -> None:
    words = (
        "must be",
        "a preset, a law or LAW_tuned (",
        " ...; 'skyarm show' shows all)",
    )
    outcome = skyarm(*(each.format(name) for each in command))
    name += "x" * (command[0] == "compare")
    refused(
        outcome,
        f"{'--laws' if '--laws' in command else 'controller'} = {name!r}: ",
        *words,
    )
    assert outcome.err.partition(" ...;")[0].count(", ") < 6
    assert not list(folder.iterdir())


@pytest.mark.parametrize("command", ["run", "compare", "margins", "tune"])
def test_a_misspelt_law_is_told_its_name_under_the_option(
    folder: Path, command: str
) -> None:
    told = skyarm(command, "case1", "--laws", "centroidal_joit")
    refused(
        told,
        "skyarm: --laws = 'centroidal_joit': did you mean 'centroidal_joint'? must be",
    )
    refused(
        skyarm(command, "case1", "--laws", "gains.toml"),
        "skyarm: --laws = 'gains.toml': no such file",
    )


def test_the_list_is_given_as_data() -> None:
    ended = skyarm("show", "--json")
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert [each["name"] for each in found["presets"]] == list(PRESETS)
    laws = {each["name"]: each for each in found["laws"]}
    assert list(laws) == list(LAWS)
    assert "accelerometer" in laws["centroidal"]["options"]
    assert {name for name, each in laws.items() if each["tuned"]} == set(
        tuned_factors()
    )
    text = " ".join(skyarm("show").out.split())
    for kind in ("scenarios", "studies", "presets", "laws"):
        for each in found[kind]:
            assert each["title"], each
            assert each["title"] in text


@pytest.mark.skipif(
    not Path("/dev/null").is_char_device(), reason="no device to write into"
)
def test_a_device_is_written_into_and_a_link_is_followed(folder: Path) -> None:
    os.mkfifo(folder / "pipe")
    reader = os.open(folder / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_json(folder / "pipe", {"schema": 1})
        assert (folder / "pipe").is_fifo(), "replaced by a file"
        assert os.read(reader, 10).startswith(b"{")
    finally:
        os.close(reader)
    (folder / "link.json").symlink_to("target.json")
    write_json(folder / "link.json", {"schema": 1})
    assert (folder / "link.json").is_symlink()
    assert json.loads((folder / "target.json").read_text())["schema"] == 1
    (folder / "loop").symlink_to("loop")
    export = ("export", "hummingbird", "--to", "mjcf", "--out")
    with pytest.raises(OSError, match=r"loop': must be writable .*symbolic links"):
        write_json(folder / "loop", {})
    refused(skyarm(*export, ""), "--out = '': must be the path of a file")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("reproduce", "--workers", "99999999999999999999"),
            "--workers = 99999999999999999999: must be from 0 to 10000",
        ),
        (
            ("sweep", "robustness", "--workers", "10001"),
            "--workers = 10001: must be from 0 to 10000",
        ),
        (
            ("compare", "--workers", "10001"),
            "--workers = 10001: must be from 0 to 10000",
        ),
        (
            ("export", "--to", "c", "case1", "--out", "x.c", "--rate", "1e300"),
            "--rate = 1e+300: must be from 0.001 to 1000000 Hz",
        ),
    ],
)
def test_numbers_beyond_any_use_are_refused(
    folder: Path, arguments: tuple[str, ...], words: str
) -> None:
    refused(skyarm(*arguments), words)
    assert not [path for path in folder.rglob("*") if path.is_file()]


@pytest.mark.parametrize(
    "word", ["mylqr.py", "mylqr.py:", "mylqr.toml:make", "mylqr.py:4"]
)
@pytest.mark.parametrize(
    "words",
    [
        ("run", "case3", "--laws"),
        ("margins", "case3", "--laws"),
        ("export", "--to", "c", "-o", "x.c"),
    ],
)
def test_a_law_of_a_file_that_is_written_otherwise_is_told_how(
    folder: Path, words: tuple[str, ...], word: str
) -> None:
    refused(
        skyarm(*words, word),
        f"{'--laws' if '--laws' in words else 'controller'} = '{word}'",
        "FILE.py:make, its function named behind a colon",
        "mylqr.py:make",
    )


def test_every_list_of_controllers_and_every_help_says_file_make(folder: Path) -> None:
    refused(
        skyarm("run", "case3", "--laws", "lqr"), "or FILE.py:make on the command line"
    )
    for command in ("run", "margins", "export"):
        shown = " ".join(skyarm(command, "--help").out.replace("│", " ").split())
        assert "FILE.py:make" in shown, command


def test_no_help_shows_a_type_of_python(folder: Path) -> None:
    for command in ("run", "sweep", "margins", "compare", "export"):
        assert "list[" not in skyarm(command, "--help").out, command
    assert "list[" not in skyarm("--help").out


def test_an_unknown_kind_in_a_file_is_told_of_plugins(folder: Path) -> None:
    from skyarm.scenario.scenario_file import LIBRARY

    (folder / "mine.toml").write_text(
        (LIBRARY / "case3.toml").read_text("utf-8")
        + '\n[sensors.cam]\nkind = "camera10"\n',
        "utf-8",
    )
    refused(
        skyarm("run", "mine.toml"),
        "sensors.cam.kind = 'camera10'",
        "names of one's own come by --plugin FILE.py",
    )
