"""The files of gains that the page on tuning shows: what stands in them is flown."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import skyarm

PAGE = Path(__file__).parents[3] / "docs" / "tuning.md"


def test_a_scenario_names_the_file_that_the_page_shows(tmp_path: Path) -> None:
    naming, gains = re.findall(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.S)
    (tmp_path / "tuned.toml").write_text(gains, "utf-8")
    case = (
        Path(skyarm.__file__).parent / "scenario" / "library" / "case1.toml"
    ).read_text("utf-8")
    own = re.sub(
        r"^\[controller\]\n.*?\n(?=\[)", naming + "\n", case, flags=re.S | re.M
    )
    assert tomllib.loads(own)["controller"] == {"tuned": "tuned.toml"}
    (tmp_path / "mine.toml").write_text(own, "utf-8")
    found = skyarm.load_scenario(str(tmp_path / "mine.toml")).controller.par
    assert tuple(found.gains.position) == (8.0,) * 3
    assert found.joint_gains.stiffness == (700.0, 300.0)
