"""Transcripts: what is recorded is played back to the byte; another exchange and
damaged files are refused.
"""

from __future__ import annotations

import gzip
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from skyarm.links.transcript import MAGIC, Tape, TranscriptError


def record(file: Path) -> list[bytes]:
    """Record an exchange of three messages."""
    tape, sent = Tape(str(file)), list[bytes]()
    tape.send("simulator", b"one", sent.append)
    tape.time = 0.25
    assert tape.receive("simulator", lambda: b"two\x00\xff") == b"two\x00\xff"
    assert tape.receive("onboard", lambda: b"") == b""
    tape.close()
    tape.close()
    return sent


def test_an_exchange_is_played_back_to_the_byte(tmp_path: Path) -> None:
    assert record(tmp_path / "t.gz") == [b"one"]
    tape = Tape(played=str(tmp_path / "t.gz"))
    assert tape.plays
    tape.send("simulator", b"one", lambda data: pytest.fail("nothing is sent"))
    assert (
        tape.receive("simulator", lambda: pytest.fail("nothing is received"))
        == b"two\x00\xff"
    )
    assert tape.receive("onboard", lambda: b"x") == b""
    with pytest.raises(TranscriptError, match="ends at 0 s, before the flight does"):
        tape.receive("onboard", lambda: b"")


def test_another_exchange_is_refused_with_time_and_channel(tmp_path: Path) -> None:
    record(tmp_path / "t.gz")
    with pytest.raises(
        TranscriptError,
        match="at 0 s: 3 bytes sent over simulator differ from the 3 recorded",
    ):
        Tape(played=str(tmp_path / "t.gz")).send("simulator", b"ons", lambda data: None)
    with pytest.raises(
        TranscriptError, match="sent over onboard, but sent over simulator is recorded"
    ):
        Tape(played=str(tmp_path / "t.gz")).send("onboard", b"one", lambda data: None)
    with pytest.raises(
        TranscriptError, match="received over simulator, but sent over simulator"
    ):
        Tape(played=str(tmp_path / "t.gz")).receive("simulator", lambda: b"")


def test_a_transcript_names_its_autopilot(tmp_path: Path) -> None:
    file = str(tmp_path / "t.gz")
    tape = Tape(file, name="px4")
    tape.send("simulator", b"one", lambda data: None)
    tape.close()
    Tape(played=file, name="px4").send("simulator", b"one", lambda data: None)
    with pytest.raises(
        TranscriptError,
        match=r"^controller.replayed = '.*t.gz': must be .* ardupilot, is of px4$",
    ):
        Tape(played=file, name="ardupilot")
    record(tmp_path / "old.gz")  # without a name
    Tape(played=str(tmp_path / "old.gz"), name="px4").send(
        "simulator", b"one", lambda data: None
    )


def test_two_records_of_an_exchange_are_the_same_file(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        record(tmp_path / name / "t.gz")
    assert (tmp_path / "a" / "t.gz").read_bytes() == (
        tmp_path / "b" / "t.gz"
    ).read_bytes()


def test_files_that_are_no_transcripts_are_refused_when_opened(tmp_path: Path) -> None:
    record(tmp_path / "t.gz")
    whole = (tmp_path / "t.gz").read_bytes()
    for data in (
        b"",
        b"x",
        whole[:20],
        gzip.compress(b"other"),
        b"\x1f\x8b" + b"\0" * 40,
    ):
        (tmp_path / "bad").write_bytes(data)
        with pytest.raises(
            TranscriptError, match="must be a transcript that was recorded"
        ) as caught:
            Tape(played=str(tmp_path / "bad"))
        assert "\n" not in str(caught.value)
    with pytest.raises(TranscriptError, match="must be a transcript"):
        Tape(played=str(tmp_path / "absent"))
    with pytest.raises(TranscriptError, match="must be a file that can be written"):
        Tape(str(tmp_path / "absent" / "t.gz"))


def test_a_transcript_begins_with_the_first_message_and_replaces_only_a_transcript(
    tmp_path: Path,
) -> None:
    file = tmp_path / "t.gz"
    record(file)
    whole = file.read_bytes()
    Tape(str(file)).close()  # a flight that did not begin
    assert file.read_bytes() == whole
    Tape(str(tmp_path / "new.gz")).close()
    assert not (tmp_path / "new.gz").exists()
    (tmp_path / "thesis.txt").write_text("years", "utf-8")
    with pytest.raises(TranscriptError, match="must not be a file of another kind"):
        Tape(str(tmp_path / "thesis.txt"))
    with pytest.raises(
        TranscriptError,
        match=r"controller\.transcript: must be left out beside controller\.replayed",
    ):
        Tape(str(file), str(file))
    assert file.read_bytes() == whole
    cut = Tape(str(file))
    cut.send("simulator", b"one", lambda data: None)
    # of a flight that was killed: a transcript still
    assert Tape(str(file)).plays is False


def test_damaged_transcripts_end_in_one_line(tmp_path: Path) -> None:
    random, file = np.random.default_rng(3), tmp_path / "t.gz"
    record(file)
    plain = gzip.decompress(file.read_bytes())
    for trial in range(300):
        changed = bytearray(plain)
        changed[random.integers(len(MAGIC), len(changed))] = random.integers(256)
        data = (
            gzip.compress(bytes(changed))
            if trial % 2
            else file.read_bytes()[: random.integers(30, 60)]
        )
        (tmp_path / "bad").write_bytes(data)
        try:
            tape = Tape(played=str(tmp_path / "bad"))
            for _ in range(4):
                tape.receive("simulator", lambda: b"")
        except TranscriptError as error:
            assert "\n" not in str(error)
        else:
            pytest.fail("four messages of three")


def test_a_full_disk_is_named_with_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    words = (
        rf"^controller\.transcript = '{tmp_path}/t.gz': must be a file .* \(No space"
        r" left on device\)$"
    )
    tape = Tape(str(tmp_path / "t.gz"))
    tape.send("simulator", b"one", lambda data: None)
    monkeypatch.setattr(gzip.GzipFile, "write", full)
    with pytest.raises(TranscriptError, match=words):
        tape.send("simulator", b"two", lambda data: None)
    tape.close()
    monkeypatch.undo()
    tape = Tape(str(tmp_path / "t.gz"))
    tape.send("simulator", b"one", lambda data: None)
    assert tape._file is not None
    monkeypatch.setattr(tape._file, "fileobj", SimpleNamespace(write=full))
    with pytest.raises(TranscriptError, match=words):
        tape.close()
    tape.close()
