"""What a sweep's worker refuses, and the one line a cluster that cannot be reached leaves."""

from __future__ import annotations

import pickle
from types import SimpleNamespace

import pytest

from skyarm.files import versions
from skyarm.registry.plugins import Plugin
from skyarm.sweep import distributed


class _Plan:
    def batches(self):
        return "batches"


def test_a_worker_refuses_a_plugin_that_is_not_the_one_it_was_started_with(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("NUMBER = 1\n", "utf-8")
    other = Plugin(str(file), "sha256:" + "0" * 64)
    with pytest.raises(ValueError, match=r"mine\.py': has changed since it was loaded first"):
        distributed._fly(b"", "d", (other,), versions()["skyarm"], 0)


def test_a_worker_flies_for_a_sweep_of_its_own_version_only(monkeypatch):
    flown = []
    monkeypatch.setattr(
        distributed, "fly_chunk", lambda plan, batches, index: flown.append((batches, index)) or b"rows"
    )
    plan, here = pickle.dumps(_Plan()), versions()["skyarm"]
    assert distributed._fly(plan, "d", (), here, 3) == b"rows"
    assert distributed._fly(plan, "d", (), here, 4) == b"rows"
    assert flown == [("batches", 3), ("batches", 4)]
    with pytest.raises(
        ValueError, match=rf"^skyarm = {here} on a worker: must be 0\.0\.0 as where the sweep was started$"
    ):
        distributed._fly(plan, "d", (), "0.0.0", 5)
    assert len(flown) == 2
    distributed._COMPILED.clear()


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ConnectionError("\n  no one there\nmore lines\n"), "no one there"),
        (RuntimeError(""), "RuntimeError"),
        (OSError("   "), "OSError"),
    ],
)
def test_a_cluster_that_cannot_be_reached_is_told_in_the_first_line_of_its_error(monkeypatch, error, told):
    def refuse(ray, address):
        raise error

    monkeypatch.setattr(distributed, "require_ray", lambda: SimpleNamespace(is_initialized=lambda: False))
    monkeypatch.setattr(distributed, "_join", refuse)
    with pytest.raises(
        ValueError, match=rf"^--ray = 'nowhere:1': must be the address of a cluster, or \w+ \({told}\)$"
    ):
        list(distributed.fly_on_ray(None, [0], "nowhere:1"))
