"""The part on JAX of the page on environments runs, in a process of its own: JAX reads
its flags once.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
pytest.importorskip("jax", reason="needs the extra 'jax'")

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (
    (DOCS / "environments.md")
    .read_text("utf-8")
    .split("\n## In JAX\n")[1]
    .split("\n## ")[0]
)


def shown(language):
    """Blocks of a language."""
    return [block.partition("```")[0] for block in PAGE.split(f"```{language}\n")[1:]]


@pytest.mark.thorough
def test_what_is_shown_prints_what_is_shown(tmp_path):
    code = "\n".join(shown("python"))
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
    )
    assert done.stdout.split() == "".join(shown("text")).split()


def test_the_page_calls_functions_that_there_are():
    from skyarm.envs.jax_environment import JaxEnvironment

    called = set(re.findall(r"\benv\.(\w+)", PAGE)) - {"action_size"}
    assert called == {"reset", "step"}
    assert all(hasattr(JaxEnvironment, name) for name in called)
