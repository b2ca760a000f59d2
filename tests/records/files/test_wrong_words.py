"""Wrong words of a file: the unknown one is named with the field that it may mean, and all of them at once."""

from __future__ import annotations

import re

import pytest

import skyarm
from commanded import refused
from commanded import skyarm as run
from skyarm.records.files import Fields, all_wrong_words

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


def test_the_unknown_word_is_refused_and_the_missing_field_is_what_it_may_mean(tmp_path):
    said = wrong(tmp_path, duration="duraton")
    assert said.startswith("duraton = 0.1: unknown field; did you mean 'duration'? allowed: ")
    assert "missing" not in said


def test_all_wrong_words_of_a_file_are_named_at_once(tmp_path):
    said = wrong(tmp_path, duration="duraton", control="contrl", gravity="gravitation")
    found = re.findall(r"(?:^|; )([\w.]+) = [\d.]+: unknown field; did you mean '(\w+)'\?", said)
    assert sorted(found) == [("duraton", "duration"), ("plant.gravitation", "gravity"), ("rates.contrl", "control")]
    refused(run("run", str(tmp_path / "f.toml")), "duraton", "contrl", "gravitation")


def read_all(table, *names, number=""):
    """Read fields of a table as the reader of a file does: all wrong words together."""
    with all_wrong_words():
        fields = Fields(table, "")
        for name in names:
            fields.take(name)
        fields.done()
        return fields.number(number) if number else None


def test_a_word_that_is_known_after_all_stands_for_no_missing_field():
    for names in (("frame", "frames"), ("frames", "frame")):
        with pytest.raises(ValueError, match=r"^frame: is missing; there are frames$"):
            read_all({"frames": 1.0}, *names)
    with pytest.raises(ValueError, match=r"^frame: is missing; there are frames$"):
        Fields({"frames": 1.0}, "").take("frame")


def test_wrong_words_go_before_another_error_and_alone_it_stays():
    with pytest.raises(ValueError, match=r"^b = 1: unknown field; allowed: a$"):
        read_all({"a": "x", "b": 1}, "a", number="a")
    with pytest.raises(ValueError, match=r"^a = 'x': must be a finite number$"):
        read_all({"a": "x"}, "a", number="a")


def test_a_vehicle_names_all_of_its_wrong_words(tmp_path):
    file = tmp_path / "v.toml"
    file.write_text('schema = 1\nname = "v"\ntitel = "x"\n[base]\nmas = 1.0\ninertia = [0.1, 0.1, 0.1]\n', "utf-8")
    with pytest.raises(skyarm.VehicleError) as refusal:
        skyarm.load_vehicle(file)
    assert "titel = 'x': unknown field; did you mean 'title'? allowed: " in str(refusal.value)
    assert "base.mas = 1.0: unknown field; did you mean 'mass'? allowed: " in str(refusal.value)
