"""No old name is used in the source, the examples, the docs or the README, but where it is documented or taken."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from skyarm import _OLD
from skyarm.actuation.mixer import OLD_POLICIES
from skyarm.control.catalogue.presets import ALIASES as PRESET_ALIASES
from skyarm.control.catalogue.presets import OLD_NAMES as OLD_PRESETS
from skyarm.environment.environment_tables import OLD_MODES
from skyarm.registry.shipped import OLD_NAMES

ROOT = Path(__file__).resolve().parents[2]
FILES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md", *(ROOT / ".github").rglob("*.yml")]
FILES += sorted(
    path
    for folder, suffixes in (("src", (".py", ".toml", ".md")), ("examples", (".py", ".toml")), ("docs", (".md",)))
    for path in (ROOT / folder).rglob("*")
    if path.suffix in suffixes
)

TAKEN = {
    "src/skyarm/__init__.py",
    "src/skyarm/actuation/mixer.py",
    "src/skyarm/control/catalogue/presets.py",
    "src/skyarm/control/controller.py",
    "src/skyarm/environment/environment_tables.py",
    "src/skyarm/registry/shipped.py",
}
"""Files whose tables hold old names, so that they are taken."""

DOCUMENTED = {
    "docs/control_laws.md": {"bulut_computed_torque_style"},
    "docs/scenario_files.md": {"exact_joint", "exact_joint_stiff", "exact_ee", "exact_ee_stiff"},
    "src/skyarm/compare/entrants.py": {"exact_ee"},
    # the word of aerodynamics, of which the old wind took its name
    "src/skyarm/environment/dryden.py": {"Airspeed", "airspeed"},
}
"""Old names that a page or a docstring tells of."""

FUNCTIONS = {"informed", "all_obeyed", "guarded", "make_exact", "ExactParameters"}
LAWS = {name for names in OLD_NAMES.values() for name in names} - {"airspeed", "World"}
AMBIGUOUS = {"airspeed", "World"}
"""Words of physics, too."""

WORDS = {*LAWS, *OLD_PRESETS, *PRESET_ALIASES, *OLD_MODES, *OLD_POLICIES, *_OLD, *FUNCTIONS} - AMBIGUOUS


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_old_name_is_used(path: Path) -> None:
    name = path.relative_to(ROOT).as_posix()
    if name in TAKEN or name.endswith("__init__.py"):
        return
    text = path.read_text(encoding="utf-8")
    used = {word for word in WORDS if re.search(rf"(?<![\w-]){re.escape(word)}(?![\w-])", text)}
    assert used <= DOCUMENTED.get(name, set())


def test_the_old_names_are_old_enough_to_go_with_the_next_version() -> None:
    """What this file looks for is what the tables hold: an empty table would look for nothing."""
    assert len(WORDS) > 15
