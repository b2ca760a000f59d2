"""Words that a shell completes, by Typer's own scripts."""

from __future__ import annotations

import pytest

from skyarm.cli.arguments import name_completion
from support.commands import skyarm


def answered(words: str, place: int, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Completions that bash gets for a line of words, the cursor in the one at a
    place.
    """
    monkeypatch.setenv("_SKYARM_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(place))
    done = skyarm()
    assert (done.code, done.err) == (0, "")
    return set(done.out.split())


@pytest.mark.parametrize(
    ("words", "place", "expected"),
    [
        ("skyarm chec", 1, {"check"}),
        ("skyarm show quad", 2, {"quadrotor_roll_arm2"}),
        ("skyarm check case3", 2, {"case3", "case3_wind"}),
        (
            "skyarm run case3 --laws paper",
            4,
            {"paper_ct", "paper_ct_euler", "paper_pd"},
        ),
        ("skyarm run case3 --laws paper_p", 4, {"paper_pd"}),
        ("skyarm sweep robustness --laws indi,paper_p", 4, {"indi,paper_pd"}),
        ("skyarm studio --la", 2, {"--laws"}),
        ("skyarm sweep rob", 2, {"robustness"}),
        ("skyarm new s", 2, {"scenario", "study"}),
        ("skyarm run --dur", 2, {"--duration"}),
        ("skyarm plan eagle", 2, {"eagle_catch", "eagle_catch_free"}),
        ("skyarm plot a.npz --kind t", 4, {"tracking", "tip", "team"}),
        ("skyarm run case3 --plant m", 4, {"mujoco"}),
        ("skyarm compare --plant r", 3, {"rigid_body"}),
        ("skyarm compare survive", 2, {"survive-suite"}),
        ("skyarm compare case1", 2, {"case1"}),
        ("skyarm film a.npz --camera f", 4, {"follow", "fixed"}),
        ("skyarm export a.npz --to m", 4, {"mcap", "mjcf"}),
        ("skyarm sweep a.toml --on p", 4, {"processes"}),
        ("skyarm show zzz", 2, set()),
        ("skyarm identify la", 2, {"lags"}),
        ("skyarm identify lags --be", 3, {"--begin"}),
        ("skyarm identify design --dr", 3, set()),
    ],
)
def test_names_commands_and_options_are_completed(
    words, place, expected, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    assert answered(words, place, monkeypatch) == expected


def test_a_path_is_completed_in_its_folder(monkeypatch, tmp_path):
    (tmp_path / "mine").mkdir()
    for name in ("mine.toml", "mine/inner.toml", "mine/inner.txt"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    assert answered("skyarm run ./mi", 2, monkeypatch) == {"./mine.toml"}
    assert answered("skyarm run mine/", 2, monkeypatch) == {"mine/inner.toml"}
    assert answered(f"skyarm run {tmp_path}/mine.", 2, monkeypatch) == {
        f"{tmp_path}/mine.toml"
    }
    assert answered("skyarm run ./gone/mi", 2, monkeypatch) == set()


def test_files_of_the_folder_are_completed(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in ("mine.toml", "mine.urdf", "mine.txt"):
        (tmp_path / name).touch()
    assert answered("skyarm show mine", 2, monkeypatch) == {"mine.toml", "mine.urdf"}
    assert "mine.txt" not in name_completion("vehicle", "scenario")("mine")
