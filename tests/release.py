"""What must hold before a version is published, for the workflows and by hand; needs
nothing but Python and pip.

python tests/release.py tag v0.4.0    the tag is the version of the source, of the
                                      citation and of the changelog
python tests/release.py build         source and wheel into dist/, both whole
python tests/release.py install       the wheel alone in a new environment: its weight,
                                      the commands shown
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from collections.abc import Iterable
from pathlib import Path

from shown_commands import ROOT, SHOWN, code_shown, needs_program, words_to_run

DIST = ROOT / "dist"
HEAVIEST = 450
"""MB that an environment with the library and without pip may take."""


def version() -> str:
    """The version that the source states."""
    (found,) = re.findall(
        r'^__version__ = "(.+)"$',
        (ROOT / "src/skyarm/__init__.py").read_text("utf-8"),
        re.M,
    )
    return str(found)


def wrong_with_tag(tag: str, source: str, citation: str, changelog: str) -> str | None:
    """One line on what does not fit to a tag; None if all does.

    Args:
        tag: as pushed. source: version of the source. citation, changelog: texts of the
            files.
    """
    if tag != f"v{source}":
        return f"tag {tag}: must be v{source}, the version of src/skyarm/__init__.py"
    if f"\nversion: {source}\n" not in citation:
        return f"CITATION.cff: version must be {source}"
    if not re.search(rf"^## {re.escape(source)} - \d{{4}}-\d\d-\d\d$", changelog, re.M):
        return f"CHANGELOG.md: must have a section '## {source} - YYYY-MM-DD'"
    unreleased = re.search(r"^## Unreleased\n(.*?)(?=^## |\Z)", changelog, re.M | re.S)
    if unreleased and unreleased[1].strip():
        return f"CHANGELOG.md: what stands under Unreleased must move under {source}"
    return None


def sources() -> set[str]:
    """Files of the package, below src, but for pages beside their code."""
    files = (path for path in (ROOT / "src" / "skyarm").rglob("*") if path.is_file())
    return {
        path.relative_to(ROOT / "src").as_posix()
        for path in files
        if path.suffix not in (".pyc", ".pyo", ".md")
    }


def wrong_with_contents(held: Iterable[str], wanted: set[str]) -> str | None:
    """One line on files that a wheel lacks or holds beyond the package; None if it is
    whole.
    """
    names = {
        name for name in held if ".dist-info/" not in name and not name.endswith("/")
    }
    if missing := sorted(wanted - names):
        return f"the wheel lacks {', '.join(missing[:5])}"
    if more := sorted(names - wanted):
        return f"the wheel holds {', '.join(more[:5])}, which is not of the package"
    return None


def wrong_with_page(metadata: str, repository: str) -> str | None:
    """One line on what the index page of a wheel lacks; None if it is whole.

    Args:
        metadata: of the wheel. repository: OWNER/NAME whose workflow builds it; empty
            elsewhere, where links stay as they are.
    """
    head, _, text = metadata.partition("\n\n")
    if "# skyarm" not in text:
        return "the wheel's metadata lacks README"
    if repository and f"/{repository}\n" not in f"{head}\n":
        return f"the wheel's metadata lacks the address of {repository}"
    left = re.findall(r"\]\((?!https?:|#)([^)\s]+)\)", text) if repository else []
    return (
        "README of the wheel's metadata has links that lead nowhere:"
        f" {', '.join(left[:3])}"
        if left
        else None
    )


def megabytes(folder: Path) -> float:
    """What a folder takes on disk, in MB of 2^20 bytes."""
    stats = (path.lstat() for path in folder.rglob("*"))
    return (
        sum(getattr(each, "st_blocks", -(-each.st_size // 512)) * 512 for each in stats)
        / 2**20
    )


def environment(folder: Path, *, with_pip: bool) -> Path:
    """Make an environment; returns its Python."""
    venv.create(folder, with_pip=with_pip)
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def run(*command: str | Path, cwd: Path = ROOT) -> None:
    """Run a command; what it prints is shown."""
    print("$", *command, flush=True)
    subprocess.run([str(word) for word in command], check=True, cwd=cwd)


def build() -> str | None:
    """Build source and wheel as the project file says, in an environment of their
    own.
    """
    for old in DIST.glob("skyarm-*"):
        old.unlink()
    with tempfile.TemporaryDirectory() as folder:
        python = environment(Path(folder) / "build", with_pip=True)
        run(
            python,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "hatchling>=1.27",
        )
        run(python, "-m", "hatchling", "build", "-d", DIST)
    (wheel,), (archive,) = DIST.glob("*.whl"), DIST.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as file:
        (metadata,) = (
            name for name in file.namelist() if name.endswith(".dist-info/METADATA")
        )
        wrong = wrong_with_contents(file.namelist(), sources())
        wrong = wrong or wrong_with_page(
            file.read(metadata).decode(), os.environ.get("GITHUB_REPOSITORY", "")
        )
    with tarfile.open(archive) as file:
        inside = {name.partition("/")[2] for name in file.getnames()}
    built_by = {
        "pyproject.toml",
        "hatch_build.py",
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
    }
    kept = {f"src/{name}" for name in sources()} | built_by
    lacking = sorted(kept - inside)
    return wrong or (
        f"the source archive lacks {', '.join(lacking[:5])}" if lacking else None
    )


def install() -> str | None:
    """Install the wheel where there is nothing else, weigh it, run the commands and the
    code shown.
    """
    (wheel,) = DIST.glob("*.whl")
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        fresh, python = (
            environment(here / "user", with_pip=False),
            environment(here / "pip", with_pip=True),
        )
        run(
            python,
            "-m",
            "pip",
            "--python",
            fresh,
            "install",
            "--quiet",
            "--disable-pip-version-check",
            wheel,
        )
        weight = megabytes(here / "user")
        print(f"the environment takes {weight:.0f} MB")
        if weight > HEAVIEST:
            return f"the environment takes {weight:.0f} MB: must be {HEAVIEST} at most"
        (here / "work").mkdir()
        for line in SHOWN:
            words = words_to_run(line)
            run(
                fresh,
                "-m",
                "skyarm",
                *words,
                *(["--help"] if needs_program(line) else []),
                cwd=here / "work",
            )
        run(fresh, "-c", code_shown(), cwd=here / "work")
    return None


def main() -> None:
    """Do what the first argument says."""
    step, *rest = sys.argv[1:] or ["help"]
    wrong: str | None = __doc__
    if step == "tag" and len(rest) == 1:
        texts = [
            (ROOT / name).read_text("utf-8")
            for name in ("CITATION.cff", "CHANGELOG.md")
        ]
        wrong = wrong_with_tag(rest[0], version(), *texts)
    elif step == "build" and not rest:
        wrong = build()
    elif step == "install" and not rest:
        wrong = install()
    sys.exit(wrong)


if __name__ == "__main__":
    main()
