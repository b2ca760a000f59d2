"""Pages that show code, the files that they take for granted, and a run of one."""

from __future__ import annotations

import os
import re
from pathlib import Path

from page_snippets import DOCS, ROOT, Block, Ran, blocks, run_page

import skyarm
from support.components import registry_kept

FRONT = "../README.md"
FILES = {
    path.relative_to(DOCS).as_posix(): path for path in sorted(DOCS.rglob("*.md"))
} | {FRONT: ROOT / "README.md"}
PAGES = {name: path.read_text("utf-8") for name, path in FILES.items()}
SECONDS = 0.5
"""Length of a flight whose numbers the page does not show."""


def prepared(name: str) -> dict[str, str]:
    """Files that a page takes for granted."""
    vehicle, flight = (
        (ROOT / "examples" / "files" / f"{each}.toml").read_text("utf-8")
        for each in ("quad_with_link", "every_table")
    )
    files = {
        "my/vehicle.toml": vehicle,
        "my/flight.toml": flight,
        "flight.toml": flight,
    }
    if "my_law.py:make" in PAGES[name] and "skyarm new law" not in PAGES[name]:
        files["my_law.py"] = (
            Path(skyarm.__file__).parent / "cli/starters/law.py.txt"
        ).read_text("utf-8")
    for example in re.findall(
        r"[ \"](examples/(?:\w+\.(?:urdf|py)|loads_and_gusts\.toml)"
        r"|examples/(?:pick_and_place_box|see_with_the_wrist)\.toml(?=[\" ]))",
        PAGES[name],
    ):
        files[example] = (ROOT / example).read_text("utf-8")
    if "examples/see_with_the_wrist.toml" in files:  # its vehicle
        vehicle = "examples/arm_with_shapes.toml"
        files[vehicle] = (ROOT / vehicle).read_text("utf-8")
    if name == "pressing.md":  # the reader makes it
        press, lines = (
            block.text for block in blocks(PAGES[name]) if block.language == "toml"
        )
        files["slide.toml"] = press.replace(
            "duration = 5.0", "duration = 12.0"
        ).replace('base = { kind = "signals", z = 1.0 }\n', lines)
    if name == "export_c.md":
        files["tuned.toml"] = next(
            block.text
            for block in blocks(PAGES["tuning.md"])
            if "[gains]" in block.text
        )
    return files


def own_blocks(name: str) -> list[Block]:
    """Blocks of a page that run here."""
    found = blocks(PAGES[name])
    if name == "extending.md":  # its package: tests/test_docs_extending.py
        return [block for block in found if block.title != "pyproject.toml"]
    # JAX, which reads its flags once a process: tests/envs
    if name == "environments.md":
        jax = next(i for i, block in enumerate(found) if "import jax" in block.text)
        return [*found[:jax], *found[jax + 2 :]]
    # its C is compiled by tests/control/onboard/test_export_c.py
    if name == "export_c.md":
        return [block for block in found if block.language != "c"]
    if name == "clusters.md":  # its scripts run on Ray: tests/test_docs_clusters.py
        return [
            block for block in found if block.language == "bash" and not block.title
        ]
    return found


WITH_CODE = [
    name
    for name in PAGES
    if any(block.language in ("python", "sh", "bash") for block in own_blocks(name))
]
PROGRAMS = {"autopilots.md": ("SKYARM_PX4", "SKYARM_ARDUPILOT")}
"""Page -> environment variables of the programs that its commands fly."""


def missing_programs(name: str) -> list[str]:
    """Variables that a page's commands need and that are not set."""
    return [
        variable for variable in PROGRAMS.get(name, ()) if variable not in os.environ
    ]


def flown(name: str, folder: Path) -> Ran:
    """A page that was run in a folder."""
    for file, text in prepared(name).items():
        (folder / file).parent.mkdir(exist_ok=True)
        (folder / file).write_text(text, "utf-8")
    ran = Ran()
    with registry_kept():
        run_page(own_blocks(name), ran, seconds=SECONDS)
    return ran
