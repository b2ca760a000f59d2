"""A file that a command has read is known under every name, and none is outside
commands.
"""

from __future__ import annotations

import os
from pathlib import Path

from skyarm.records.files.own_inputs import inputs_kept, is_input, note_input


def test_what_a_command_has_read_is_an_input_of_it_alone(tmp_path: Path) -> None:
    read, other = tmp_path / "read.toml", tmp_path / "other.toml"
    for file in (read, other):
        file.write_text("duration = 1.0")
    second = tmp_path / "second.toml"
    os.link(read, second)
    with inputs_kept():
        assert not is_input(read)
        note_input(read)
        found = [is_input(each) for each in (read, second, other, tmp_path / "none")]
        assert found == [True, True, False, False]
    note_input(read)
    assert not is_input(read)
