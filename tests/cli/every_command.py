"""Words with which every command runs in some seconds.

A new command is entered here and in docs/command_line.md: ``test_machine_output.py`` is red for one that is not.
"""

from __future__ import annotations

from collections.abc import Mapping

COMMANDS: Mapping[str, tuple[str, ...]] = {
    "show": ("hummingbird_arm2_rotors",),
    "check": ("hummingbird", "--arm-poses", "8"),
    "new": ("law", "fresh"),
    "doctor": (),
    "run": ("case3", "--duration", "0.5"),
    "diff": ("flight.npz",),
    "plot": ("flight.npz", "-o", "flight.png", "--kind", "tip"),
    "film": ("flight.npz", "flight.viser", "--fps", "5"),
    "export": ("flight.npz", "--to", "csv"),
    "identify": ("flight.npz", "--end", "2"),
    "margins": ("short.toml", "--instants", "0"),
    "tune": ("hummingbird", "--controller", "decoupled_pd", "--candidates", "64", "--plants", "4", "--out", "tuned"),
    "sweep": ("study.toml", "--out", "rows"),
    "compare": ("short.toml", "--laws", "paper_pd"),
    "reproduce": (),
}
"""Command -> words after its name."""

KEPT: Mapping[str, tuple[str, ...]] = {"new": ("fresh.py", "test_fresh.py")}
"""Command that never overwrites -> its files, which are removed before it runs again."""

NEEDS = {"sweep": "pyarrow", "film": "viser", "tune": "cmaes", "identify": "scipy"}
"""Command -> the library without which it is not tried."""

SERVES: Mapping[str, str] = {
    "studio": "it flies on a page until Ctrl-C",
    "fly": "it needs an autopilot (tests/links/outside)",
}
"""Command that runs until it is ended -> why it has no result to print."""
