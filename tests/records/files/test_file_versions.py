"""Versions that results are stamped with: of the source that runs, and of what is installed."""

from __future__ import annotations

import platform
from importlib import metadata

from bench_timing import describe

import skyarm
from skyarm.records.files.packages import ABSENT, versions


def test_skyarm_s_version_is_that_of_the_source_that_runs(monkeypatch) -> None:
    """An editable installation keeps the number that it was installed with."""
    monkeypatch.setattr(metadata, "version", lambda name: f"{name} 0.0.1")
    versions.__globals__["_version"].cache_clear()
    try:
        assert versions("numpy")["skyarm"] == skyarm.__version__
        assert versions("numpy")["numpy"] == "numpy 0.0.1"
    finally:
        versions.__globals__["_version"].cache_clear()


def test_a_log_and_the_bench_name_every_library_that_flew() -> None:
    log = skyarm.run(skyarm.load_scenario("case1", duration=0.01, plant="mujoco"))
    assert set(log.info["versions"]) == {"python", "skyarm", "numpy", "mujoco-core"}
    assert ABSENT not in log.info["versions"].values()
    about = describe()
    assert about["python"] == platform.python_version()
    assert [about[name] for name in ("skyarm", "numpy", "llvmlite", "mujoco-core")] == [
        skyarm.__version__,
        *map(metadata.version, ("numpy", "llvmlite", "mujoco-core")),
    ]


def test_what_is_not_installed_is_said_to_be_so() -> None:
    assert versions("no-such-package")["no-such-package"] == ABSENT
