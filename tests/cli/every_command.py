"""Words with which every command runs in some seconds.

A new command is entered here and in docs/command_line.md: ``test_machine_output.py`` is
red for one that is not.
"""

from __future__ import annotations

from collections.abc import Mapping

COMMANDS: Mapping[str, tuple[str, ...]] = {
    "show": ("hummingbird_arm2_rotors",),
    "check": ("hummingbird", "--arm-poses", "8"),
    "new": ("law", "fresh"),
    "doctor": (),
    "run": ("case3", "--duration", "0.5"),
    "plan": ("eagle_catch_free",),
    "diff": ("flight.npz",),
    "plot": ("flight.npz", "-o", "flight.png", "--kind", "tip"),
    "film": ("flight.npz", "-o", "flight.viser", "--fps", "5"),
    "export": ("flight.npz", "--to", "csv"),
    "identify": ("flight.npz", "--end", "8"),
    "margins": ("short.toml", "--instants", "0"),
    "tune": (
        "hummingbird",
        "--laws",
        "decoupled_pd",
        "--candidates",
        "132",
        "--plants",
        "4",
        "--out",
        "tuned",
    ),
    "sweep": ("study.toml", "--out", "rows"),
    "compare": ("short.toml", "--laws", "paper_pd"),
    "reproduce": (),
}
"""Command -> words after its name."""

KEPT: Mapping[str, tuple[str, ...]] = {"new": ("fresh.py", "test_fresh.py")}
"""Command that never overwrites -> its files, which are removed before it runs
again."""

NEEDS = {"sweep": "pyarrow", "film": "viser", "tune": "cmaes", "identify": "scipy"}
"""Command -> the library without which it is not tried."""

READS = ("check", "diff", "doctor")
"""Commands that write no result: all others take ``-o/--out``."""

CHOOSES = ("run", "fly", "film", "studio", "margins", "tune", "compare", "sweep")
"""Commands that fly laws by choice: ``--laws``."""

SERVES: Mapping[str, str] = {
    "studio": "it flies on a page until Ctrl-C",
    "fly": "it needs an autopilot (tests/links/outside)",
}
"""Command that runs until it is ended -> why it has no result to print."""

OVERWRITES: Mapping[str, str | tuple[tuple[tuple[str, ...], str, str], ...]] = {
    "show": ((("ours.toml", "-o", "a.svg"), "ours.toml", "a.svg"),),
    "check": "it writes nothing",
    "doctor": "it reads and writes no file",
    "diff": "it writes nothing",
    "new": "it reads no file, and replaces none",
    "studio": "it saves flights under new names",
    "reproduce": "it reads no file of the user's",
    "run": (
        (("short.toml", "--out", ".", "--force"), "short.toml", "short.csv"),
        (("short.toml", "--log", "short.csv", "--force"), "short.toml", "short.csv"),
        (("flight.npz", "--log", "flight.npz", "--force"), "flight.npz", "flight.npz"),
        (("short.toml", "--log", "a.csv", "--plot", "a.png"), "short.toml", "a.png"),
        (
            ("short.toml", "--laws", "law.py:make", "--log", "a.csv", "--force"),
            "law.py",
            "a.csv",
        ),
    ),
    "plan": (
        (("task.toml", "--scenario", "task.toml"), "task.toml", "task.toml"),
        (("task.toml", "--out", "a.npz"), "task.toml", "a.npz"),
        (("task.toml", "--out", "a.npz"), "ours.toml", "a.npz"),
    ),
    "fly": "an earlier file of this name gets another one, as of run without --force",
    "plot": ((("flight.npz", "--out", "a.svg"), "flight.npz", "a.svg"),),
    "film": ((("flight.npz", "a.viser"), "flight.npz", "a.viser"),),
    "export": (
        (("short.toml", "--to", "c", "--out", "a.c"), "short.toml", "a.c"),
        (("flight.npz", "--to", "npz"), "flight.npz", "flight.npz"),
        (("flight.npz", "--out", "a.csv"), "flight.npz", "a.csv"),
        (("short.toml", "--to", "mjcf", "--out", "a.xml"), "short.toml", "a.xml"),
    ),
    "identify": (
        (("--design", "ours.toml", "--out", "ours.toml"), "ours.toml", "ours.toml"),
        (("flight.npz", "--lags", "--out", "a.toml"), "flight.npz", "a.toml"),
        (
            ("flight.npz", "--vehicle", "ours.toml", "--out", "."),
            "ours.toml",
            "vehicle.toml",
        ),
    ),
    "margins": (
        (("short.toml", "--instants", "0", "--out", "a.json"), "short.toml", "a.json"),
        (("short.toml", "--instants", "0", "--html", "a.html"), "short.toml", "a.html"),
        (
            ("short.toml", "--laws", "law.py:make", "--out", "law.json"),
            "law.py",
            "law.json",
        ),
    ),
    "tune": ((("short.toml", "--out", "."), "short.toml", "tuned.toml"),),
    "compare": (
        "its folder's files have names of their own; a link there is refused as it is"
        " written"
    ),
    "sweep": "its folder's files have names of their own, and must not be links",
}
"""Command -> why it cannot write over a file that it reads, or words, the file, and the
file that is written."""

REPLACES: Mapping[str, str | tuple[tuple[tuple[str, ...], str, str], ...]] = {
    "show": ((("hummingbird_arm2_rotors", "--out", "a.svg"), "a.svg", "replaced"),),
    "check": "it writes nothing",
    "doctor": "it writes no file",
    "diff": "it writes nothing",
    "studio": "it saves flights under new names",
    "fly": "an earlier log gets a number, as of run",
    "compare": (
        (
            ("short.toml", "--seeds", "1", "--laws", "paper_pd", "--out", "a"),
            "a/report.html",
            "replaced",
        ),
    ),
    "reproduce": "the same command goes on in its folder",
    "new": (
        (("study", "mine"), "mine.toml", "kept"),
        (("study", "mine", "--out", "a"), "a/test_mine.py", "kept"),
    ),
    "run": (
        (("short.toml", "--out", "."), "short.csv", "numbered"),
        (("short.toml", "--log", "a.csv"), "a.csv", "numbered"),
        (("short.toml", "--log", "a.csv", "--force"), "a.csv", "replaced"),
        (("short.toml", "--log", "b.csv", "--plot", "a.png"), "a.png", "replaced"),
    ),
    "plan": (
        (("up.toml", "--out", "a.npz"), "a.npz", "replaced"),
        (("up.toml", "--report", "a.html"), "a.html", "replaced"),
        (("up.toml", "--scenario", "a.toml"), "a.toml", "kept"),
    ),
    "plot": ((("flight.npz", "--out", "a.svg"), "a.svg", "replaced"),),
    "film": (
        (("flight.npz", "--fps", "5", "--out", "a.viser"), "a.viser", "replaced"),
    ),
    "export": (
        (("short.toml", "--to", "c", "--out", "a.c"), "a.c", "replaced"),
        (("flight.npz", "--to", "csv"), "flight.csv", "replaced"),
        (("short.toml", "--to", "mjcf", "--out", "a.xml"), "a.xml", "replaced"),
    ),
    "identify": (
        (
            (
                "--design",
                "hummingbird_arm2_rotors",
                "--seconds",
                "10",
                "--out",
                "a.toml",
            ),
            "a.toml",
            "refused",
        ),
        (("flight.npz", "--lags", "--out", "a.toml"), "a.toml", "refused"),
    ),
    "margins": (
        (("short.toml", "--instants", "0", "--out", "a.json"), "a.json", "replaced"),
        (("short.toml", "--instants", "0", "--html", "a.html"), "a.html", "replaced"),
    ),
    "tune": (
        (
            ("short.toml", "--candidates", "132", "--plants", "4", "--out", "there"),
            "there/best.toml",
            "numbered",
        ),
        (
            ("short.toml", "--candidates", "132", "--plants", "4", "--out", "there"),
            "there/tuned.toml",
            "replaced",
        ),
    ),
    "sweep": (
        (
            ("study.toml", "--save", "1", "--out", "."),
            "episode_1_decoupled_pd.toml",
            "numbered",
        ),
    ),
}
"""Command -> why there is nothing to replace, or words, a file that is there, and what
becomes of it."""
