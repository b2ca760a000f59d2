"""What holds for every process of the tests, before NumPy is loaded."""

from __future__ import annotations

import compileall
import gc
import json
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support.shares import ShareScheduling, is_shared, others_of

# one thread of BLAS a process, as the command line sets it: the processes of the tests
# take every core already, and threads that wait for each other there made some tests
# five times slower
for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# a shell ignores SIGINT in what it starts in the background, and every process of the
# tests would inherit that
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# a trace makes a hundred thousand nodes and no garbage; looking for some after every
# 700 took a sixth of all the time
gc.set_threshold(50_000, 20, 100)


def pytest_configure(config: pytest.Config) -> None:
    """Keep machine code in one folder for all processes of the tests, and for the next
    run of them.

    It is made without optimisation, which has the same bits
    (``tests/compile/test_native``) and is made five times as fast: most tests fly a
    program of their own for less than a second.

    Write byte code where it is told not to: some hundred processes would each compile
    what they import.
    """
    os.environ.setdefault("SKYARM_EFFORT", "0")
    os.environ.setdefault(
        "SKYARM_CACHE", str(config.rootpath / ".pytest_cache" / "machine_code")
    )
    if sys.dont_write_bytecode:
        sys.dont_write_bytecode = False
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        # the library's before any test copies its folder; the others' when they are
        # first imported
        compileall.compile_dir(Path(__file__).parents[1] / "src" / "skyarm", quiet=2)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Tell a worker its share; one in place of a dead one has none."""
    worker, count = int(node.gateway.id.removeprefix("gw")), len(node.config.option.tx)
    node.workerinput["others"] = (
        sorted(others_of(worker, count))
        if is_shared(node.config) and worker < count
        else []
    )


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out the files of other workers."""
    others = getattr(config, "workerinput", {}).get("others", ())
    return (
        collection_path.relative_to(config.rootpath).as_posix() in others or None
        if others
        else None
    )


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config) -> ShareScheduling | None:
    """Hand out tests of files that workers collected apart."""
    return ShareScheduling(config) if is_shared(config) else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Mark as thorough what ``tests/budget.json`` leaves to the nightly workflow, and
    what needs CasADi and says so.

    `make thorough` alone installs that. They import it plainly: without it they are red
    there, and one that does not say so is red in `make test`.
    """
    table = json.loads((Path(__file__).with_name("budget.json")).read_text("utf-8"))
    for item in items:
        nightly = table.get(item.path.relative_to(config.rootpath).as_posix(), {}).get(
            "nightly", ()
        )
        if (
            item.name in nightly
            or item.name.split("[")[0] in nightly
            or "casadi" in item.name
        ):
            item.add_marker("thorough")


def pytest_collection_finish() -> None:
    """Collected tests and imported modules stay: they need not be looked through again
    and again.
    """
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _precision_of_jax() -> Iterator[None]:
    """Refuse a test that leaves JAX in 64 bits for the next one of its process;
    `jax_doubles` takes it back.
    """
    yield
    jax = sys.modules.get("jax")
    assert jax is None or not jax.config.read("jax_enable_x64"), (
        "JAX is left in 64 bits"
    )


@pytest.fixture(autouse=True)
def _no_other_process(request: pytest.FixtureRequest) -> Iterator[None]:
    """Leave out the trial of plugins in another process, half a second each, unless a
    test is for it.
    """
    module = sys.modules.get("skyarm.simulate.examine")
    if module is None or "tried_elsewhere" in request.fixturenames:
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "is_of_plugin", lambda code: False)
        yield


@pytest.fixture
def tried_elsewhere() -> None:
    """Keep the trial of plugins in another process."""


@pytest.fixture(scope="session")
def campaign() -> Any:
    """Twenty episodes of the paper of 30 s as stated, thirty with settings that were
    found, on both plants.
    """
    from skyarm.paper.reproduce import run_campaign

    return run_campaign(("rigid_body", "mujoco"), sensitivity=False)


ONE_AGENT = (
    "plant",
    "controller",
    "reference",
    "tracking_start",
    "path_time",
    "noise",
    "sensors",
    "estimator",
    "drives",
    "delays",
    "initial",
    "faults",
    "payloads",
)
"""Shortcuts of `Scenario` to the words of one agent, which are for users."""


@pytest.fixture(autouse=True, scope="session")
def _no_shortcut_inside() -> None:
    """Refuse a shortcut to one agent that the library itself reads: it would not hold
    for a scenario of several.
    """
    from skyarm import Scenario

    inside = str(Path(__file__).parents[1] / "src")

    def only_outside(name: str) -> property:
        def read(scenario: Scenario) -> Any:
            by = sys._getframe(1).f_code
            assert not by.co_filename.startswith(inside), (
                f"{by.co_filename}, {by.co_name}: reads scenario.{name}"
            )
            return getattr(scenario.agent, name)

        return property(read)

    for name in ONE_AGENT:
        setattr(Scenario, name, only_outside(name))
