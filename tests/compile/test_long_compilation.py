"""Compiling that takes minutes is announced, with how long it takes."""

from __future__ import annotations

import warnings

import pytest

from skyarm.compile.llvm import kernel
from skyarm.compile.machine_code import LongCompilationWarning


@pytest.mark.parametrize(
    ("size", "effort", "words"), [(340e6, 0, "340 MB of .* about 4 min"), (34e6, 1, "34 .* 2 min")]
)
def test_minutes_of_compiling_are_announced_before_it_begins(size, effort, words, monkeypatch):
    built = []
    monkeypatch.setenv("SKYARM_EFFORT", "2")
    monkeypatch.setattr(kernel.object_cache, "load", lambda _: None)
    monkeypatch.setattr(kernel, "build", lambda *given: built.append(given))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(LongCompilationWarning, match=words):
            kernel._make_engine(" " * int(size), effort)
    assert not built


def test_seconds_of_compiling_and_kept_code_are_not(monkeypatch):
    kernel.announce(4_000_000, 2)
    kernel.announce(30_000_000, 0)
    monkeypatch.setattr(kernel.object_cache, "load", lambda _: b"kept")
    monkeypatch.setattr(kernel, "_load_engine", lambda content: content)
    assert kernel._make_engine(" " * 50_000_000, 2) == b"kept"
