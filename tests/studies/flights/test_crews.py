"""Crews: what they keep when they end early, whose scenario changed, and where they fly
what is left.
"""

from __future__ import annotations

import dataclasses
import importlib
import sys
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import pytest

import skyarm
from skyarm.log.flight_log import Log
from skyarm.paper.reproduce import run_campaign
from skyarm.records.files.writing import TakenError
from skyarm.records.registry import RegistryError
from skyarm.records.travel import pack
from skyarm.scenario.scenario_file import load_scenario
from skyarm.studies.flights import (
    Store,
    Work,
    WorkRunner,
    executor,
    processes,
    ray_cluster,
    work,
)
from skyarm.studies.flights.processes import MOST_TRIES, Processes
from skyarm.studies.sweep import run_sweep
from support.components import registry_kept
from support.studies import small_study

CASE = load_scenario("case1", controller="paper_pd", duration=0.02)


@dataclasses.dataclass(kw_only=True)
class Push(skyarm.Force):
    """A force that its owner may change."""

    size: float = 0.1

    def wrenches(
        self, memory: Any, t: Any, motion: Any, rotor_speeds: Sequence[Any]
    ) -> Sequence[Any]:
        return (skyarm.Wrench(force_W=skyarm.Vec3(0.0, 0.0, self.size)),)


def test_a_component_that_was_changed_between_two_crews_flies_as_it_is() -> None:
    push = Push()
    scenario = dataclasses.replace(CASE, forces=(push,))

    def flown() -> float:
        with WorkRunner() as crew:
            (rows,) = crew.rows(
                [
                    Work(
                        label="x",
                        scenario=scenario,
                        metrics=("position_error_mean",),
                        effort=0,
                    )
                ]
            )
            return float(rows["position_error_mean"][0])

    before, push.size = flown(), 5.0
    assert flown() != before
    push.size = 0.1
    assert flown() == before


def test_the_key_depends_on_the_fields_of_an_added_metric() -> None:
    def key(of: float) -> str:
        with registry_kept():

            @skyarm.register.metric("push_count")
            @dataclasses.dataclass(frozen=True, kw_only=True)
            class Count(skyarm.Metric):
                above: float = of

            return Work(label="x", scenario=CASE, metrics=("push_count",)).key

    assert len({key(1.0), key(2.0)}) == 2
    assert key(1.0) == key(1.0)


class Gain:
    """An argument whose text is its address."""

    def __init__(self, size: float) -> None:
        self.size = size


def scaled(log: Log, gain: Gain) -> dict[str, float | None]:
    return {"height": gain.size * float(log.position[-1, 2])}


def test_the_key_depends_on_the_content_and_the_code_of_what_measures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gains = [Gain(1.0), Gain(1.0), Gain(2.0)]

    def keys() -> list[str]:
        return [
            Work(
                label="x", scenario=CASE, alone=True, measure=partial(scaled, gain=gain)
            ).key
            for gain in gains
        ]

    first, second, third = usual = keys()
    assert first == second != third
    monkeypatch.setattr(
        work,
        "own_files",
        lambda thing: {"test_crews.py": "other"} if callable(thing) else {},
    )
    assert not {*keys()} & {*usual}


def test_what_another_part_flew_meanwhile_is_not_counted(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    study, others = small_study(episodes=8, chunk=2), list[Any]()

    def beside(done: int, total: int) -> None:
        if not others:
            others.append(None)
            others.append(run_sweep(study, tmp_path, part="2/2"))

    mine = run_sweep(study, tmp_path, part="1/2", progress=beside)
    assert (mine.flown, others[1].flown, mine.rows) == (4, 4, 16)


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pools of threads in place of processes."""
    monkeypatch.setattr(
        processes, "ProcessPoolExecutor", lambda count, **_: ThreadPoolExecutor(count)
    )


def test_what_has_landed_is_kept_when_a_crew_is_interrupted(
    tmp_path: Path, threads: None
) -> None:
    pytest.importorskip("pyarrow")
    works = [Work(label=f"w{k}", scenario=CASE, seed=k, effort=0) for k in range(3)]

    def interrupted() -> None:
        with WorkRunner("processes", 2, Store(tmp_path)) as crew:
            for _ in crew.fly(works):
                wait(crew._executor._flying)  # type: ignore[union-attr]
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    with WorkRunner(store=Store(tmp_path)) as again:
        assert len(list(again.fly(works))) == 3
    assert again.flights == 0


def fails() -> None:
    raise ZeroDivisionError


def test_what_has_landed_beside_an_error_is_given_when_processes_end(
    threads: None,
) -> None:
    pool = Processes(2)
    for k in (2, 3):
        pool.submit(k, divmod, 7, k)
    pool.submit("fails", fails)
    wait(pool._flying)
    assert sorted(pool.close(abandon=True)) == [(2, (3, 1)), (3, (2, 1))]


class Breaking:
    """A pool whose processes are killed by hand."""

    made: ClassVar[list[Breaking]] = []

    def __init__(self, *_: Any, **__: Any) -> None:
        self.calls: list[Future[Any]] = []
        Breaking.made.append(self)

    def submit(self, *_: Any) -> Future[Any]:
        self.calls.append(Future())
        return self.calls[-1]

    def shutdown(self, **_: Any) -> None:
        pass


def test_a_call_that_never_began_is_not_charged_for_a_process_that_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(processes, "ProcessPoolExecutor", Breaking)
    Breaking.made.clear()
    pool, last = Processes(1), 2 * MOST_TRIES

    def broken() -> None:
        for call in Breaking.made[-1].calls:
            if not call.done():
                call.set_exception(BrokenProcessPool())

    def lands(*error: Any) -> None:
        """The first call of the new pool lands."""
        usual(*error)
        Breaking.made[-1].calls[0].set_result("landed")

    usual = pool._mend
    monkeypatch.setattr(pool, "_mend", lands)
    for k in range(last):
        pool.submit(k, divmod, 7, 2)
    for k in range(last):
        broken()
        assert pool.collect() == (k, "landed")
    pool.submit("dies", divmod, 7, 2)
    monkeypatch.setattr(pool, "_mend", lambda *error: (usual(*error), broken()))
    broken()
    with pytest.raises(OSError, match=f"ended unexpectedly, {MOST_TRIES} times"):
        pool.collect()
    assert len(Breaking.made) == 1 + last + MOST_TRIES - 1


def test_the_usual_place_is_that_of_the_works_that_are_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    works, places = (
        [Work(label=f"w{k}", scenario=CASE, seed=k, effort=0) for k in range(3)],
        list[str](),
    )
    monkeypatch.setattr(
        executor,
        "_executor",
        lambda on, _: (places.append(on), executor.InProcess())[1],
    )
    with WorkRunner(store=Store(tmp_path)) as crew:
        list(crew.fly(works[:1]))
    for _ in range(2):
        with WorkRunner(None, 2, Store(tmp_path)) as crew:
            assert [each.label for each, _ in crew.fly(works)] == ["w0", "w1", "w2"]
    with WorkRunner(None, 2) as crew:
        assert len(crew.rows(works)) == 3
    assert places == ["local", "local", "processes"]


def test_a_place_without_a_name_is_not_one_left_out() -> None:
    with pytest.raises(ValueError, match="on = ''"):
        run_campaign(("rigid_body",), sensitivity=False, inferred=False, on="")


def test_a_process_that_refused_one_outfit_performs_the_calls_of_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ray_cluster, "_arrived", {})
    monkeypatch.setattr(processes, "_REFUSED", [])

    def unload(parents: bytes) -> None:
        if parents == b"wrong":
            raise RegistryError("plugin: is missing")

    monkeypatch.setattr(processes, "unload", unload)
    wrong, right, call = (
        pack((b"wrong", ())),
        pack((b"right", ())),
        pack((divmod, (7, 2))),
    )
    for _ in range(2):
        with pytest.raises(RegistryError, match="is missing"):
            ray_cluster.perform_on_node({}, wrong, call)
        assert ray_cluster.perform_on_node({}, right, call) == (3, 1)


@pytest.mark.parametrize(("held", "part"), [("1_of_2", "01/2"), ("", "1/1")])
def test_a_part_is_one_however_it_is_written(
    tmp_path: Path, held: str, part: str
) -> None:
    pytest.importorskip("pyarrow")
    with Store(tmp_path).alone(held), pytest.raises(TakenError):
        run_sweep(small_study(episodes=2), tmp_path, part=part)


def test_a_folder_named_ray_is_no_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ray").mkdir()
    monkeypatch.delitem(sys.modules, "ray", raising=False)
    monkeypatch.setattr(
        sys,
        "path",
        [str(tmp_path), *(each for each in sys.path if "site-packages" not in each)],
    )
    importlib.invalidate_caches()
    try:
        with pytest.raises(
            ValueError, match=r"^--on = 'ray:h:1': needs the extra 'ray'"
        ):
            executor.require_place("ray:h:1", "--on")
    finally:
        sys.modules.pop("ray", None)


@pytest.mark.parametrize("workers", ["x", None, 1.5, 0, -1, True])
def test_workers_are_a_whole_number_wherever_they_fly(workers: Any) -> None:
    with pytest.raises(
        ValueError, match=r"^workers = .*: must be a whole number, at least 1"
    ):
        WorkRunner("processes", workers)


@pytest.mark.parametrize("part", ["", (3, 2), 1, "3/2"])
def test_a_part_is_one_of_some(part: Any, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^--part = .*: must be K/N"):
        run_sweep(small_study(episodes=1), tmp_path / "out", part=part)
    assert not (tmp_path / "out").exists()
