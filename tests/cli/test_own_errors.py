"""What code of one's own raises is one line at the command line, with its file, line
and class, whatever it raises.
"""

from __future__ import annotations

import re

import pytest

from skyarm.records.files.user_code import own_failure
from skyarm.scenario.scenario_file import LIBRARY
from support.commands import refused, skyarm
from support.components import registry_kept

CASE = (
    (LIBRARY / "case1.toml")
    .read_text("utf-8")
    .replace('name = "case1"', 'name = "mine"')
)

HEAD = """from dataclasses import dataclass
import sys
import skyarm

"""

LAW = (
    HEAD
    + """@dataclass(frozen=True, kw_only=True)
class Par:
    model: skyarm.Model

def law(memory, measurement, reference, dt, *, par):
    RAISE

def make(model):
    par = Par(model=model)
    return skyarm.Controller(name="mine", law=law, par=par, compiled=COMPILED)
"""
)
MAKER = HEAD + "def make(model):\n    RAISE\n"
AIR = (
    HEAD
    + """@skyarm.register.air("mine")
@dataclass(frozen=True, kw_only=True)
class Mine(skyarm.Air):
    number: float = 1.0

    def velocity(self, memory, t, position_W):
        RAISE
"""
)
CHECKED = AIR.replace(
    "def velocity(self, memory, t, position_W)", "def __post_init__(self)"
)
MOTION = HEAD + '@skyarm.register.motion("mine")\ndef mine():\n    RAISE\n'
FORMAT = (
    HEAD + "def write(log, path):\n   "
    ' RAISE\n\nskyarm.register.log_format("mine")(skyarm.LogFormat(write))\n'
)
ESTIMATOR = (
    HEAD
    + """@skyarm.register.estimator("mine")
@dataclass(frozen=True, kw_only=True)
class Mine(skyarm.Estimator):
    def step(self, memory, readings, command, dt):
        RAISE
"""
)

ERRORS = {
    "value": (
        'raise ValueError("gain must be positive")',
        "ValueError: gain must be positive",
    ),
    "below": ('float("12,5")', "ValueError: could not convert string to float: '12,5'"),
    "unicode": (
        r'b"\xff".decode()',
        "UnicodeDecodeError: 'utf-8' codec can't decode byte 0xff",
    ),
    "os": (
        'open("gone.json")',
        "FileNotFoundError: [Errno 2] No such file or directory: 'gone.json'",
    ),
    "key": ('raise KeyError("gain")', "KeyError: 'gain'"),
    "exit": ("sys.exit(7)", "SystemExit: 7"),
}


@pytest.fixture(autouse=True)
def _kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with registry_kept():
        yield


def flown(folder, code, raises, case=CASE, options=()):
    """Line at which it is raised, and what the command line does with it."""
    (folder / "mine.toml").write_text(case)
    text = code.replace("RAISE", raises)
    (folder / "mine.py").write_text(text)
    line = text[: text.index(raises)].count("\n") + 1
    return line, skyarm(
        "run", "mine.toml", "--duration", "0.1", "--plugin", "mine.py", *options
    )


@pytest.mark.parametrize("kind", ERRORS)
@pytest.mark.parametrize("compiled", ["True", "False"])
def test_an_error_of_a_law(tmp_path, kind, compiled):
    raises, words = ERRORS[kind]
    code = LAW.replace("COMPILED", compiled)
    line, done = flown(tmp_path, code, raises, options=("--laws", "mine.py:make"))
    refused(done, f"mine.py:{line}: {words}")


OTHERS = {
    "maker": (MAKER, CASE, ("--laws", "mine.py:make")),
    "air": (AIR, CASE + '[[environment.air]]\nkind = "mine"\n', ()),
    "estimator": (ESTIMATOR, CASE + '[estimator]\nkind = "mine"\n', ()),
    "motion": (MOTION, re.sub('kind = "hover"\n.*', 'kind = "mine"', CASE), ()),
    "format": (FORMAT, CASE, ("--log", "flight.mine")),
}


@pytest.mark.parametrize("kind", ["value", "below", "os", "exit"])
@pytest.mark.parametrize("other", OTHERS)
def test_an_error_of_anything_else(tmp_path, other, kind):
    code, case, options = OTHERS[other]
    raises, words = ERRORS[kind]
    line, done = flown(tmp_path, code, raises, case, options)
    refused(done, f"mine.py:{line}: {words}")


def test_what_a_records_own_check_says_stays_the_files_word(tmp_path):
    case = CASE + '[[environment.air]]\nkind = "mine"\n'
    _, done = flown(
        tmp_path, CHECKED, 'raise ValueError("number = 1: must be above 2")', case
    )
    refused(done, "mine.toml: environment.air[0].number = 1: must be above 2")


def test_what_the_library_refuses_stays_its_word(tmp_path):
    maker = MAKER.replace("RAISE", "return RAISE")
    code = maker.replace(
        "import sys", "from skyarm.control.catalogue import make_controller"
    )
    _, done = flown(
        tmp_path,
        code,
        'make_controller("nope", model)',
        options=("--laws", "mine.py:make"),
    )
    refused(done, "'nope'", "must be one of")
    assert "Error" not in done.err


def test_a_command_of_ones_own_exits_as_it_likes(tmp_path):
    (tmp_path / "mine.py").write_text(
        HEAD + '@skyarm.register.command("leave")\ndef leave():\n    """Leave."""\n   '
        " sys.exit(7)\n"
    )
    done = skyarm("leave", "--plugin", "mine.py")
    assert (done.code, done.err) == (7, "")


def test_nothing_is_said_of_an_error_that_was_never_raised():
    assert own_failure(ValueError("never raised")) == ""
    assert own_failure(KeyError("never raised")) == ""
