"""Wrong words of a file: named with the field that they may mean."""

from __future__ import annotations

import pytest

import skyarm
from skyarm.records.files import Fields, unreadable
from skyarm.records.read_table import record_from
from skyarm.scenario.scenario_record import Change
from support.commands import refused
from support.commands import skyarm as command

FLIGHT = """
name = "f"
{duration} = 0.1

[rates]
{control} = 200

[plant]
vehicle = "hummingbird_arm2_rotors"
{gravity} = 9.81

[controller]
preset = "centroidal_tip"
"""


def wrong(tmp_path, **words):
    usual = {"duration": "duration", "control": "control", "gravity": "gravity"}
    (tmp_path / "f.toml").write_text(FLIGHT.format(**usual | words), "utf-8")
    with pytest.raises(skyarm.ScenarioError) as refusal:
        skyarm.load_scenario(tmp_path / "f.toml")
    return str(refusal.value).partition("f.toml: ")[2]


def test_a_missing_field_is_named_with_the_word_that_may_mean_it(tmp_path):
    assert wrong(tmp_path, duration="duraton").startswith(
        "duration: is missing; is 'duraton' a misspelling of it? there are "
    )
    assert (
        "rates.contrl = 200: unknown field; did you mean 'control'? allowed: "
        in wrong(tmp_path, control="contrl")
    )


def test_a_file_that_is_not_there_is_answered_with_the_nearest_of_its_folder(tmp_path):
    for name in ("mine.toml", "mien.npz", "b.toml"):
        (tmp_path / name).write_text("")
    (tmp_path / "mein.toml").mkdir()
    # with its folder, or another file of that name may be meant
    said = f"did you mean '{tmp_path / 'mine.toml'}'? no such file"
    assert unreadable(tmp_path / "mien.toml") == said
    # a like suffix is no like name
    assert unreadable(tmp_path / "x.toml") == "no such file"
    assert unreadable(tmp_path / "gone" / "mien.toml") == "no such file"


def test_commands_propose_the_file_that_may_be_meant(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text("")
    (tmp_path / "mine.npz").write_text("")
    for words in (["run"], ["check"], ["show"], ["sweep"], ["plan"], ["compare"]):
        refused(command(*words, "mien.toml"), "did you mean 'mine.toml'? no such file")
    for words in (["film", "a.webp"], ["plot", "-o", "a.png"], ["diff", "mine.npz"]):
        name, *more = words
        refused(command(name, "mien.npz", *more), "did you mean 'mine.npz'?")


def test_a_field_without_a_like_word_is_missing():
    with pytest.raises(ValueError, match=r"^frame: is missing; there are a$"):
        Fields({"a": 1.0}, "").take("frame")


def test_a_wrong_word_is_refused_when_its_table_has_been_read():
    fields = Fields({"a": "x", "b": 1}, "")
    fields.take("a")
    with pytest.raises(ValueError, match=r"^b = 1: unknown field; allowed: a$"):
        fields.done()


def test_a_field_that_the_record_has_is_not_offered_for_another_that_is_missing():
    with pytest.raises(
        ValueError, match=r"^changes\[0\].at: is missing; there are path, value$"
    ):
        record_from(
            Change, Fields({"path": "plant.gravity", "value": 1.0}, "changes[0]")
        )
    with pytest.raises(
        ValueError,
        match=(
            r"^changes\[0\].at: is missing; is 'att' a misspelling of it\? there are"
            r" att, path, value$"
        ),
    ):
        record_from(
            Change,
            Fields({"att": 0.0, "path": "plant.gravity", "value": 1.0}, "changes[0]"),
        )
