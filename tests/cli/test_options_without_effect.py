"""An option that a command would not read where it stands is refused, also with its
usual value.
"""

from __future__ import annotations

import pytest

from support.commands import refused, skyarm


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("run", "case3", "--log", "a.npz", "--out", "out/run"),
            "--out: must be left out beside --log",
        ),
        (
            ("film", "case3", "a.viser", "--size", "640x360"),
            "--size: must be left out of a recording",
        ),
        (
            ("film", "case3", "a.html", "--fine"),
            "--fine: must be left out of a recording",
        ),
    ],
)
def test_an_option_without_effect_is_refused_before_anything_is_done(
    words, said, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    refused(skyarm(*words), said)
    assert list(tmp_path.iterdir()) == []
