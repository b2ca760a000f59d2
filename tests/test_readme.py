"""The front door says what is true: its commands run, its code runs, its table is what flights give."""

import dataclasses
import re
import shlex

import numpy as np
import pytest

from added_components import registry_kept
from commanded import skyarm
from shown_commands import LINES, README, ROOT, SHOWN, code_shown, run_shown, words_to_run


def test_every_make_target_shown_exists():
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    shown = {line.split()[1] for line in LINES if line.startswith("make ")}
    assert shown
    assert shown <= targets


def test_the_readme_shows_commands():
    assert {shlex.split(line)[1] for line in SHOWN} == {
        "check",
        "new",
        "doctor",
        "show",
        "run",
        "replay",
        "diff",
        "plot",
        "reproduce",
        "sweep",
        "stats",
        "export",
        "bench",
        "compare",
        "margins",
        "basin",
        "studio",
        "film",
    }


@pytest.mark.parametrize("line", SHOWN)
def test_every_command_shown_is_understood(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with registry_kept():
        done = skyarm(*words_to_run(line))
    assert done.code == 0, done.err
    assert done.out.strip()


@pytest.mark.site
def test_the_commands_shown_run_to_their_end_one_after_the_other(tmp_path, monkeypatch):
    """In one folder: some read what those before wrote."""
    monkeypatch.chdir(tmp_path)
    for line in SHOWN:
        code, told = run_shown(line)
        wanted = 1 if line.startswith("skyarm diff") else 0  # two flights that differ
        assert code == wanted, (line, told[-2000:])


def test_the_code_shown_is_short():
    assert len(code_shown().strip().splitlines()) <= 12


def test_links_lead_to_files():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target


def test_the_moving_picture_at_its_head_moves_and_is_light():
    from PIL import Image

    first = re.search(r"!\[[^]]+\]\(([^)]+)\)", README)[1]
    assert README.index(first) < README.index("make reproduce")
    assert (ROOT / first).stat().st_size <= 3e6
    with Image.open(ROOT / first) as picture:
        assert picture.is_animated
        assert picture.info["loop"] == 0, "it repeats"
        assert picture.width == 800, "its labels are meant for a page"
        frames = []
        for k in (0, picture.n_frames // 2):
            picture.seek(k)
            frames.append(np.asarray(picture.convert("L"), dtype=float))
    assert (np.abs(frames[1] - frames[0]) > 40.0).sum() > 500, "vehicles and cursor"
    # what draws it anew
    assert f"{first} " in (ROOT / "Makefile").read_text(encoding="utf-8")


def test_the_film_behind_it_is_light():
    (film,) = re.findall(r"\]\(([^)]+\.mp4)\)", README)
    assert (ROOT / film).stat().st_size <= 2e6
    assert f"{film} " in (ROOT / "Makefile").read_text(encoding="utf-8")


def test_the_table_of_laws_is_what_flights_give():
    """The centroidal law flies the preset of its plain name, as in the noisy column."""
    from skyarm.studies.compare.cells import Flights, fly
    from skyarm.studies.compare.entrants import ENTRANTS
    from skyarm.studies.compare.suite import CASES, conditions

    (table,) = re.findall(r"<!-- compare: .*?-->\n(.*?)<!-- /compare -->", README, re.DOTALL)
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.strip().splitlines()[2:]]
    perfect = conditions()["perfect"]
    for row, name in zip(rows, ("paper_pd", "paper_ct", "centroidal_joint", "centroidal_tip"), strict=True):
        flown = []
        for case in ("case3", "case3_wind"):
            entrant = dataclasses.replace(ENTRANTS[name], perfect=ENTRANTS[name].noisy)
            found = fly(Flights(entrant=entrant, case=CASES[case], condition=perfect)).metrics
            flown += [1e3 * found[f"{what}_error_mean_continuous"][0] for what in ("position", "joint", "ee")]
        for shown, value in zip(row[1:7], flown, strict=True):
            # as printed: half a unit of its last digit
            digits = len(shown.partition(".")[2])
            assert abs(float(shown) - value) <= 0.51 * 10.0**-digits, (name, shown, value)
