"""``skyarm new``: what it writes flies at once, and nothing is overwritten."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path

import pytest

import skyarm as package
from skyarm.cli.new_command import KINDS
from skyarm.studies.sweep.study_file import load_study
from support.commands import refused, skyarm
from support.components import registry_kept

NAMES = {
    "vehicle": "my_vehicle",
    "scenario": "my_scenario",
    "law": "my_law",
    "study": "my_study",
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("new")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for kind, name in NAMES.items():
            done = skyarm("new", kind, name)
            assert (done.code, done.err) == (0, ""), done
            assert "fly it: skyarm" in done.out
    return folder


def functions_of(file: Path) -> dict[str, object]:
    """The test functions of a file that was written, read as pytest reads it."""
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(file.parent))
        spec.loader.exec_module(module)
    return {
        name: value for name, value in vars(module).items() if name.startswith("test_")
    }


@pytest.mark.parametrize("kind", ["vehicle", "scenario", "law"])
def test_the_test_that_was_written_passes(written, kind):
    # what the file registers must not meet the same law of another test
    with registry_kept():
        found = functions_of(written / f"test_{NAMES[kind]}.py")
        assert found
        for check in found.values():
            check()  # type: ignore[operator]


def test_the_study_that_was_written_is_a_study(written):
    study = load_study(written / "my_study.toml")
    assert study.name == "my_study"


@pytest.mark.thorough
def test_pytest_passes_on_all_that_was_written(written):
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-n",
        "0",
        str(written),
    ]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=written
    )
    assert done.returncode == 0, done.stdout


def test_the_test_sees_a_vehicle_that_cannot_fly(written, tmp_path):
    for name in KINDS["vehicle"].values():
        text = (written / name.replace("NAME", "my_vehicle")).read_text("utf-8")
        heavy = text.replace("mass = 1.28 ", "mass = 1280.0 ")
        (tmp_path / name.replace("NAME", "my_vehicle")).write_text(heavy, "utf-8")
    with pytest.raises(AssertionError):
        functions_of(tmp_path / "test_my_vehicle.py")[
            "test_no_check_finds_a_fault_or_a_warning"
        ]()  # type: ignore[operator]


def test_nothing_is_overwritten_and_nothing_is_half_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("test_mine.py", "mine_hover.toml"):
        (tmp_path / name).write_text("mine", "utf-8")
        refused(
            skyarm("new", "vehicle", "mine"),
            name,
            "must not be there yet; --force replaces it",
        )
        assert [each.name for each in tmp_path.iterdir()] == [name]
        assert (tmp_path / name).read_text("utf-8") == "mine"
        (tmp_path / name).unlink()
    os.symlink("nowhere", tmp_path / "mine.toml")
    refused(skyarm("new", "vehicle", "mine"), "mine.toml")
    assert [each.name for each in tmp_path.iterdir()] == ["mine.toml"]


def test_of_three_at_once_one_has_the_name(tmp_path, monkeypatch):
    """All look at the names before any of them writes, as processes at the same time
    do.
    """
    from skyarm.cli import new_command as starter_files

    real, ended = starter_files.write_atomically, []

    def begin():
        try:
            ended.append(starter_files.write_starter("study", "mine", tmp_path))
        except ValueError as error:
            ended.append(str(error))

    def slow(file, content):
        for each in others:
            if not each.is_alive() and each.ident is None:
                each.start()
        time.sleep(0.1)
        return real(file, content)

    others = [threading.Thread(target=begin) for _ in range(2)]
    monkeypatch.setattr(starter_files, "write_atomically", slow)
    begin()
    for each in others:
        each.join()
    refusals = [each for each in ended if isinstance(each, str)]
    assert (len(ended), len(refusals)) == (3, 2)
    assert all(
        "mine.toml'" in each and "must not be there yet" in each for each in refusals
    )


def test_a_disk_that_fills_leaves_nothing(tmp_path, monkeypatch):
    from skyarm.cli import new_command as starter_files

    monkeypatch.chdir(tmp_path)
    real, left = starter_files.write_atomically, [2]

    def full(file, content):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(28, "No space left on device", str(file))
        return real(file, content)

    monkeypatch.setattr(starter_files, "write_atomically", full)
    refused(skyarm("new", "vehicle", "mine"), "No space left")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("vehicl", "x"), ("kind = 'vehicl'", "did you mean 'vehicle'")),
        (("law", "2fast"), ("name = '2fast'",)),
        (("law", "../x"), ("name = '../x'",)),
        (("law", ""), ("name = ''",)),
        (("law", "class"), ("name = 'class'",)),
        (("law", "json"), ("name = 'json'", "hide")),
        (("law", "skyarm"), ("name = 'skyarm'",)),
        (("law", "numpy"), ("name = 'numpy'", "hide")),
        (("law", "conftest"), ("name = 'conftest'", "hide")),
        (("vehicle", "con"), ("name = 'con'",)),
        (("vehicle", "a" * 61), ("name = ",)),
        (("scenario", "x\x1b[31m"), ("name = ",)),
    ],
)
def test_wrong_words_write_nothing(tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    refused(skyarm("new", *words), *said)
    assert list(tmp_path.iterdir()) == []


def test_the_law_that_was_written_flies_by_its_file(written, monkeypatch):
    monkeypatch.chdir(written)
    assert package.__version__
    with registry_kept():
        done = skyarm(
            "run", "case1", "--laws", "my_law.py:make", "--duration", "0.5", "--quiet"
        )
    assert done.code == 0, done


@pytest.mark.parametrize(
    ("rotors", "arm_length", "mass"), [(4, 0.05, 0.05), (6, 0.3, 2.0), (12, 0.6, 8.0)]
)
def test_a_bare_multirotor_of_a_few_numbers_flies(
    rotors, arm_length, mass, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    sizes = ["--arm-length", str(arm_length), "--mass", str(mass)]
    made = skyarm("new", "vehicle", "bare", "--rotors", str(rotors), *sizes)
    assert made.code == 0, made.err
    vehicle = package.load_vehicle("bare.toml")
    assert (len(vehicle.rotors), vehicle.base.mass) == (rotors, mass)
    for one, other in pairwise([*vehicle.rotors, vehicle.rotors[0]]):
        assert one.direction == -other.direction
        assert one.position.norm() == pytest.approx(arm_length, rel=1e-5)
    checked = skyarm("check", "bare.toml")
    assert "can fly: no fault, 0 warnings" in checked.out
    for check in functions_of(tmp_path / "test_bare.py").values():
        check()


def test_numbers_of_a_bare_multirotor_are_refused_where_they_say_nothing(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for words, said in (
        (("vehicle", "a", "--rotors", "3"), "--rotors = 3: must be one of 4, 6"),
        (("vehicle", "a", "--mass", "2"), "--mass: must be left out without --rotors"),
        (("law", "a", "--rotors", "4"), "--rotors = 4: must be of a vehicle"),
        (("vehicle", "a", "--rotors", "4", "--mass", "0"), "--mass = 0.0: must be"),
        (
            ("vehicle", "a", "--rotors", "4", "--mass", "1e300"),
            "--mass = 1e+300: must be within 0.001 to 10000 kg",
        ),
        (
            ("vehicle", "a", "--rotors", "4", "--arm-length", "1e-300"),
            "--arm-length = 1e-300: must be within 0.01 to 10 m",
        ),
        (
            ("vehicle", "a", "--rotors", "4", "--from", "hummingbird"),
            "--rotors = 4: must be of a vehicle without --from",
        ),
    ):
        refused(skyarm("new", *words), said)
    assert not [*tmp_path.iterdir()]
