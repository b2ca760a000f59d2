"""Versions that results are stamped with: of the source that runs, and of what is
installed.
"""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib import metadata

import pytest
from bench_timing import describe

import skyarm
from skyarm.records.files import packages
from skyarm.records.files.packages import ABSENT, versions


@pytest.fixture
def forgotten() -> Iterator[None]:
    """No version is remembered, before or after."""
    packages._version.cache_clear()
    yield
    packages._version.cache_clear()


def test_skyarm_s_version_is_that_of_the_source_that_runs(
    monkeypatch, forgotten
) -> None:
    """An editable installation keeps the number that it was installed with."""
    monkeypatch.setattr(
        packages, "installed_versions", lambda names: dict.fromkeys(names, "0.0.1")
    )
    assert versions("numpy") == {
        "python": platform.python_version(),
        "skyarm": skyarm.__version__,
        "numpy": "0.0.1",
    }


def test_a_package_that_is_no_folder_on_the_path_has_the_version_of_its_metadata(
    monkeypatch, forgotten
) -> None:
    monkeypatch.setattr(packages, "installed_versions", lambda names: {})
    assert versions("numpy", "no-such-package")["numpy"] == metadata.version("numpy")
    assert versions("no-such-package")["no-such-package"] == ABSENT


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
