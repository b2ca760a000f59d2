"""Rows of the bench beside peers and older trees: contenders in turn, each a process of
its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import measure_speed
import pytest
from measure_speed import ROWS, Row, main, measured, scenario_of, spent

from skyarm.compile.tracing.lower import operations
from skyarm.compile.tracing.program import trace_loop
from skyarm.scenario.scenario_file import load_scenario


class Scripted:
    """Contender whose numbers are known: here 3 and 8, the peer half of that, the older
    tree twice.
    """

    order: list[str] = []  # noqa: RUF012

    def __init__(
        self, name: str, *, peer: bool = False, tree: Path = measure_speed.ROOT
    ) -> None:
        self.factor = 0.5 if peer else 1.0 if tree == measure_speed.ROOT else 2.0
        self.values = self.numbers()

    def numbers(self) -> Iterator[float]:
        for value in (3.0, 8.0, 4.0):
            self.order.append(f"{self.factor:g}")
            yield value * self.factor

    def measure(self) -> float:
        return next(self.values)

    def close(self) -> None:
        self.order.append("closed")


def test_contenders_of_a_row_take_turns_and_its_ratios_are_of_one_round(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(measure_speed, "Contender", Scripted)
    monkeypatch.setattr(Scripted, "order", [])
    monkeypatch.setitem(ROWS, "both", Row(lambda: spent, lambda: spent))
    assert measured("both", Path("old"), 3) == ["both", "4 s", "2", "0.5"]
    assert Scripted.order == ["1", "0.5", "2"] * 3 + ["closed"] * 3
    monkeypatch.setitem(ROWS, "here alone", Row(lambda: spent, unit="MB", beside=False))
    assert measured("here alone", Path("old"), 2) == ["here alone", "5.5 MB", "", ""]


def test_a_contender_measures_when_asked_and_one_that_failed_has_no_number() -> None:
    contender = measure_speed.Contender(
        "third run case3, beside import numpy", peer=True
    )
    try:
        assert 0.0 < contender.measure() < 60.0
        contender._process.kill()
        contender._process.wait()
        assert math.isnan(contender.measure())
    finally:
        contender.close()


def test_every_scenario_of_the_rows_is_there() -> None:
    for name in measure_speed.FIRST:
        assert load_scenario(scenario_of(name)).steps > 0


def test_the_peak_is_of_as_many_fused_products_and_sums_as_are_counted() -> None:
    loop = trace_loop(
        measure_speed.chains, (0.5,) * measure_speed.CHAINS, (0.9, 0.1), ()
    )
    assert (
        operations(loop.program.nodes) == 2 * measure_speed.CHAINS * measure_speed.LINKS
    )


def test_rows_are_listed_and_a_folder_that_is_no_tree_is_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    main(["--list", "--only", "batch", "skids f"])
    assert capsys.readouterr().out.split("\n")[0] == "batch pick_and_carry"
    with pytest.raises(SystemExit) as ended:
        main(["--beside", str(tmp_path)])
    assert ended.value.code == 2
    assert "must be the folder of a tree" in capsys.readouterr().err
