"""The front door says what is true: commands and code run, the tables behind it are
what flights give.
"""

import dataclasses
import re
import shlex

import numpy as np
import pytest

from shown_commands import (
    COMMAND_LINE,
    GALLERY,
    LINES,
    LISTED,
    README,
    ROOT,
    SHOWN,
    code_shown,
    needs_program,
    run_command,
    run_shown,
    words_to_run,
)
from skyarm.studies.compare.perturbed_plants import Spread
from support.commands import skyarm
from support.components import registry_kept

LAWS = (ROOT / "docs" / "data" / "results_laws.md").read_text(encoding="utf-8")
ENVELOPE = (ROOT / "docs" / "results_envelope.md").read_text(encoding="utf-8")
PAPER = (ROOT / "docs" / "the_paper.md").read_text(encoding="utf-8")

DOCS = "\n".join(
    page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs").rglob("*.md"))
)
"""All pages: a table is found by its mark, wherever it stands."""


def rows(text):
    """Cells of the rows of a table below its head."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def marked(text, begin, end):
    """What stands between two marks of a page."""
    (found,) = re.findall(rf"<!-- {begin}.*?-->\n(.*?)<!-- /{end} -->", text, re.DOTALL)
    return found


def test_the_readme_is_short():
    assert len(README.encode()) <= 8192
    assert (
        max(len(line) for line in README.splitlines() if not line.startswith("|"))
        <= 120
    )


def test_the_gallery_has_a_picture_and_a_command_in_each_cell():
    gallery = README.partition("## Gallery")[2].partition("\n\n## ")[0]
    cells = [
        cell
        for line in gallery.splitlines()
        if line.startswith("| !")
        for cell in line.strip("| ").split(" | ")
    ]
    assert len(cells) == 6
    for cell in cells:
        assert re.search(
            r"^!\[[^]]+\]\(docs/images/[^)]+\) .*<br>`(skyarm|python) [^`]+`$", cell
        ), cell


def test_the_film_of_the_laws_in_wind_is_light_and_drawn_by_make():
    film = "docs/images/laws_in_wind.mp4"
    assert (ROOT / film).stat().st_size <= 2e6
    recipe = (ROOT / "Makefile").read_text(encoding="utf-8").partition("\nfilms:")[2]
    assert f" film $(WIND) {film} " in recipe.partition("\n\n")[0]


def test_every_make_target_shown_exists():
    targets = set(
        re.findall(
            r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE
        )
    )
    shown = {line.split()[1] for line in LINES if line.startswith("make ")}
    assert shown
    assert shown <= targets


def test_the_page_on_the_command_line_shows_commands():
    assert all(line.startswith("skyarm ") for line in LISTED), COMMAND_LINE
    assert len(GALLERY) >= 5
    assert {shlex.split(line)[1] for line in LISTED} == {
        "check",
        "new",
        "doctor",
        "show",
        "run",
        "plan",
        "diff",
        "plot",
        "reproduce",
        "sweep",
        "export",
        "compare",
        "margins",
        "studio",
        "film",
    }


@pytest.mark.parametrize("line", SHOWN)
def test_every_command_shown_is_understood(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with registry_kept():
        done = skyarm(*words_to_run(line))
    # which is somebody's own: the command is understood up to there
    if needs_program(line):
        assert done.err.startswith("skyarm: autopilot: ")
        assert "'s program is missing" in done.err
        return
    assert done.code == 0, done.err
    assert done.out.strip()


@pytest.mark.site
def test_the_commands_shown_run_to_their_end_one_after_the_other(tmp_path, monkeypatch):
    """In one folder: some read what those before wrote."""
    monkeypatch.chdir(tmp_path)
    for line in (each for each in SHOWN if not needs_program(each)):
        code, told = run_shown(line)
        assert code == 0, (line, told[-2000:])


def test_the_code_shown_is_short():
    assert len([line for line in code_shown().splitlines() if line]) <= 8


def test_examples_shown_are_there():
    shown = re.findall(r"\bexamples/[\w.]+", README)
    assert len(shown) >= 2
    for name in shown:
        assert (ROOT / name).is_file(), name


def test_links_lead_to_files():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target


def test_the_moving_pictures_at_its_head_move_and_are_light():
    from PIL import Image

    head = README.partition("\n## ")[0]
    pictures = re.findall(r"!\[[^]]+\]\(([^)]+)\)", head)
    assert len(pictures) == 3
    for name in pictures:
        assert (ROOT / name).stat().st_size <= 1e6
        with Image.open(ROOT / name) as picture:
            assert picture.is_animated
            assert picture.info["loop"] == 0, "it repeats"
            frames = []
            for k in (0, picture.n_frames // 2):
                picture.seek(k)
                frames.append(np.asarray(picture.convert("L"), dtype=float))
        assert (np.abs(frames[1] - frames[0]) > 40.0).sum() > 500, "vehicles move"
        # what draws it anew
        assert f"{name} " in (ROOT / "Makefile").read_text(encoding="utf-8")


def test_the_code_shown_draws_the_picture_below_it(tmp_path, monkeypatch):
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    exec(compile(code_shown(), "README.md", "exec"), {})
    lines = {each.get_label(): each.get_ydata() for each in plt.gca().get_lines()}
    plt.close("all")
    assert (tmp_path / "tip_error.png").is_file()
    on_circle = {name: values[2000:4000].mean() for name, values in lines.items()}
    # as the text below the picture on the page says, mm
    assert on_circle["paper_ct"] == pytest.approx(672.0, abs=1.0)
    assert on_circle["centroidal_tip"] == pytest.approx(0.036, abs=0.001)
    assert "700 mm under paper_ct, 0.04 mm under centroidal_tip" in README


def test_the_sentences_say_what_the_tables_say():
    words = " ".join(README.split())
    envelope = {}
    for name, *_, found in rows(marked(DOCS, "the envelope:", "the envelope")):
        axis, first, last, unit = re.fullmatch(
            r"(.+), ([\d.]+) to ([\d.]+) (.+)", name
        ).groups()
        envelope[axis] = (found.split(" / ")[0], first, last, unit)
    steps, turbulence, push = (
        envelope[axis] for axis in ("wind steps", "turbulence", "push y")
    )
    assert push[0] == "-", "lost at the smallest tested"
    assert (
        f"within 10 mm in wind steps up to {steps[0]} N and turbulence of"
        f" {turbulence[0]} m/s, but not under a push of {push[1]} N along y" in words
    )
    counts = re.search(r"(\d+) of the 103 numbers of .*? agree within 25 %", words)
    stated = re.search(r"(\d+) of the paper's 103 numbers", " ".join(PAPER.split()))
    assert counts.groups() == stated.groups()


@pytest.mark.site
def test_as_many_vehicles_of_twice_the_mismatch_keep_the_tip_as_the_page_says(
    tmp_path,
):
    words = [
        "compare",
        "envelope-suite",
        "--only",
        "wrong_plants",
        "--laws",
        "centroidal_tip",
    ]
    code, told = run_command([*words, "--out", str(tmp_path / "envelope")])
    assert code == 0, told[-800:]
    (row,) = re.findall(r"^\| centroidal_tip \|.* of .*\|$", told, re.MULTILINE)
    kept = {
        times: re.match(r"(\d+) of (\d+);", cell.strip()).groups()
        for times, cell in zip(
            (0.5, 1, 1.5, 2), row.strip("|").split("|")[1:], strict=True
        )
    }
    assert "| 0.5 times | 1 times | 1.5 times | 2 times |" in told
    words = " ".join(ENVELOPE.split())
    (all_kept, plants), twice = kept[1], int(kept[2][0])
    assert all_kept == plants
    assert f"keeps within it on all {plants} vehicles" in words
    assert f"misses the limit on {int(plants) - twice} of {plants}" in words
    assert Spread().mass == 0.2


def test_the_table_of_laws_is_what_flights_give():
    """The centroidal law flies the preset of its plain name, as in the noisy column."""
    from skyarm.studies.compare.cell_flights import CellFlights
    from skyarm.studies.compare.entrants import ENTRANTS
    from skyarm.studies.compare.suite import CASES, conditions
    from skyarm.studies.flights.fly import fly

    cases = [
        {
            row[0].strip("`"): row[1:4]
            for row in rows(marked(LAWS, f"laws in {case} ", "laws"))
        }
        for case in ("case3", "case3_wind")
    ]
    short = {
        row[0].strip("`"): row[1] for row in rows(marked(LAWS, "compare:", "compare"))
    }
    names = ("paper_pd", "paper_ct", "centroidal_joint", "centroidal_tip")
    assert {name: cases[1][name][2] for name in names} == short
    perfect = conditions()["perfect"]
    for name in names:
        row = [*cases[0][name], *cases[1][name]]
        flown = []
        for case in ("case3", "case3_wind"):
            entrant = dataclasses.replace(ENTRANTS[name], perfect=ENTRANTS[name].noisy)
            found = fly(
                CellFlights(entrant=entrant, case=CASES[case], condition=perfect).work()
            )
            flown += [
                1e3 * found[f"{what}_error_mean_continuous"][0]
                for what in ("position", "joint", "ee")
            ]
        for shown, value in zip(row, flown, strict=True):
            # as printed: half a unit of its last digit
            digits = len(shown.partition(".")[2])
            assert abs(float(shown) - value) <= 0.51 * 10.0**-digits, (
                name,
                shown,
                value,
            )
