"""Old names of the last version work with a line that says the new one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import skyarm as library
from skyarm.records.files.old_names import OldNameWarning
from skyarm.records.registry.registrations import find
from skyarm.studies.sweep.study_file import study_from
from skyarm.world.environment_tables import wind_from


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def study(*controllers: str, **more: str):
    """A study of some controllers."""
    return study_from(
        {
            "schema": 1,
            "name": "x",
            "scenario": "case1",
            "duration": 0.1,
            "episodes": 2,
            "controllers": list(controllers),
            **more,
            "vary": {"plant.vehicle.base.mass": {"uniform": [0.6, 0.7]}},
        }
    )


def test_a_comparison_names_its_entrants_of_which_a_list_of_laws_has_not_all() -> None:
    from skyarm.cli.compare_command import _entrants
    from skyarm.studies.compare.entrants import ENTRANTS

    with pytest.raises(ValueError, match=re.escape(f"must be one of {', '.join(ENTRANTS)}")):
        _entrants("xyzzy")


def old(value: object, name: str) -> None:
    """The one warning of an old name says the new one."""
    (line,) = {str(each.message) for each in value}  # type: ignore[attr-defined]
    assert f"use {name}" in line


def test_old_names_of_winds_are_read(folder: Path) -> None:
    for mode, name, found in (("airspeed", "moving_air", "MovingAir"), ("rotors_force", "force_wind", "ForceWind")):
        with pytest.warns(OldNameWarning) as caught:
            wind = wind_from({"mode": mode}, "wind")
        assert type(wind).__name__ == found
        old(caught, repr(name))
    for kind, mode, name in (("air", "airspeed", "moving_air"), ("force", "rotors_force", "force_wind")):
        with pytest.warns(OldNameWarning) as caught:
            assert find(kind, mode) is find(kind, name)
        old(caught, repr(name))


@pytest.mark.parametrize(("before", "name"), library._OLD.items())
def test_old_names_of_the_front_are_the_new_things(before: str, name: str) -> None:
    with pytest.warns(OldNameWarning) as caught:
        found = getattr(library, before)
    assert found is getattr(library, name)
    old(caught, f"skyarm.{name}")
    assert before not in library.__all__
