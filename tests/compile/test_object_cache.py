"""Object code is kept for its own user alone, within a limit, and forgotten where it
was used longest ago.
"""

from __future__ import annotations

import os
import stat
import threading
import time
import warnings
from pathlib import Path

import pytest

from skyarm.compile.llvm import object_cache
from skyarm.compile.llvm import object_cache as cache_places
from skyarm.compile.llvm.object_cache import (
    KEY,
    KEY_BYTES,
    cache_folder,
    size_limit,
    state_folder,
    unused_reason,
)
from skyarm.records.files import private

WITH_MODES = pytest.mark.skipif(
    not private.WITH_OWNERS, reason="no owners and modes of files here"
)


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("SKYARM_CACHE", str(folder))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv("SKYARM_CACHE_SIZE", raising=False)
    return folder


def kept(identity, content=b"code"):
    """Path of an entry after it was kept."""
    before = set(cache_folder().glob("*.o")) if cache_folder().is_dir() else set()
    object_cache.store(identity, content)
    assert object_cache.load(identity) == content
    (entry,) = set(cache_folder().glob("*.o")) - before
    return entry


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


def used(path, ago):
    os.utime(path, (time.time() - ago,) * 2)


def test_what_was_kept_is_found_under_its_own_text_alone():
    assert object_cache.load("a") is None
    kept("a", b"code of a")
    assert object_cache.load("a") == b"code of a"
    assert object_cache.load("b") is None


@WITH_MODES
def test_folders_and_key_are_their_user_s_alone_whatever_the_umask(cache, tmp_path):
    before = os.umask(0)
    try:
        entry = kept("a")
    finally:
        os.umask(before)
    key = tmp_path / "state" / "skyarm" / KEY
    assert [mode(each) for each in (cache, key.parent, key, entry)] == [
        0o700,
        0o700,
        0o600,
        0o600,
    ]
    assert len(key.read_bytes()) == KEY_BYTES
    assert not key.is_relative_to(cache)


def test_an_entry_of_another_program_under_this_name_is_not_believed():
    first, second = kept("first", b"one"), kept("second", b"two")
    second.write_bytes(first.read_bytes())
    assert object_cache.load("second") is None
    assert object_cache.load("first") == b"one"


def test_an_entry_under_the_key_of_another_user_is_not_believed(tmp_path, monkeypatch):
    entry = kept("a", b"evil")
    forged = entry.read_bytes()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "other"))
    assert object_cache.load("a") is None
    object_cache.store("a", b"good")
    assert object_cache.load("a") == b"good"
    entry.write_bytes(forged)
    assert object_cache.load("a") is None


@pytest.mark.parametrize("damage", ["empty", "short", "long", "gone", "folder", "link"])
def test_a_damaged_key_is_replaced_and_what_it_signed_is_built_again(damage, tmp_path):
    entry = kept("a")
    key = state_folder() / KEY
    content = key.read_bytes()
    key.unlink()
    if damage == "folder":
        key.mkdir()
    elif damage == "link":
        (tmp_path / "planted").write_bytes(b"k" * KEY_BYTES)
        (tmp_path / "planted").chmod(0o600)
        key.symlink_to(tmp_path / "planted")
    elif damage != "gone":
        key.write_bytes(
            {"empty": b"", "short": content[:-1], "long": content + b"x"}[damage]
        )
        key.chmod(0o600)
    assert object_cache.load("a") is None
    object_cache.store("a", b"code")
    if damage == "folder":  # nothing can be signed, so nothing is kept
        assert object_cache.load("a") is None
        assert "no key can be written" in unused_reason()
        return
    assert object_cache.load("a") == b"code"
    assert not key.is_symlink()
    assert key.read_bytes() not in (content, b"k" * KEY_BYTES)
    assert len(key.read_bytes()) == KEY_BYTES
    assert entry.is_file()
    assert [each.name for each in key.parent.iterdir()] == [KEY]


@WITH_MODES
@pytest.mark.parametrize("rights", [0o644, 0o640, 0o660, 0o666])
def test_a_key_that_others_could_read_is_replaced(rights):
    kept("a")
    key = state_folder() / KEY
    content = key.read_bytes()
    key.chmod(rights)
    assert object_cache.load("a") is None
    object_cache.store("a", b"code")
    assert object_cache.load("a") == b"code"
    assert key.read_bytes() != content
    assert mode(key) == 0o600


@WITH_MODES
@pytest.mark.parametrize("rights", [0o777, 0o775, 0o755, 0o722])
def test_a_folder_open_to_others_is_closed(rights, cache):
    kept("a")
    for folder in (cache, state_folder()):
        folder.chmod(rights)
        assert object_cache.load("a") == b"code"
        assert mode(folder) == 0o700


@WITH_MODES
def test_a_folder_of_another_user_is_told_and_not_used(cache, monkeypatch):
    kept("a")
    monkeypatch.setattr(private.os, "geteuid", lambda: os.getuid() + 12345)
    assert object_cache.load("a") is None
    with pytest.warns(
        RuntimeWarning,
        match=r"cache: it belongs to another user; machine code is not kept",
    ) as told:
        object_cache.store("b", b"code")
    assert len(told) == 1
    assert "\n" not in str(told[0].message)
    assert len(list(cache.glob("*.o"))) == 1
    assert "belongs to another user" in unused_reason()


@WITH_MODES
def test_a_state_folder_of_another_user_is_told_and_nothing_is_kept(cache, monkeypatch):
    kept("a")
    real = Path.stat

    def foreign(path, **options):
        found = real(path, **options)
        return (
            os.stat_result((*found[:4], 54321, *found[5:]))
            if path == state_folder()
            else found
        )

    monkeypatch.setattr(Path, "stat", foreign)
    with pytest.warns(RuntimeWarning, match="skyarm: it belongs to another user"):
        object_cache.store("b", b"code")
    assert len(list(cache.glob("*.o"))) == 1


@WITH_MODES
def test_a_link_of_another_user_in_place_of_the_folder_is_not_followed(
    cache, tmp_path, monkeypatch
):
    kept("a")
    cache.rename(tmp_path / "elsewhere")
    cache.symlink_to(tmp_path / "elsewhere")
    assert object_cache.load("a") == b"code", (
        "one's own link to one's own folder is followed"
    )
    real = Path.lstat
    monkeypatch.setattr(
        Path,
        "lstat",
        lambda path: os.stat_result((*real(path)[:4], 54321, *real(path)[5:])),
    )
    with pytest.warns(RuntimeWarning, match="it is a link of another user"):
        assert object_cache.load("a") is None


def test_entries_are_not_read_through_links_and_links_are_replaced_in_writing(tmp_path):
    entry = kept("a")
    planted = tmp_path / "planted"
    entry.rename(planted)
    entry.symlink_to(planted)
    before = planted.read_bytes()
    assert object_cache.load("a") is None
    object_cache.store("a", b"new code")
    assert object_cache.load("a") == b"new code"
    assert not entry.is_symlink()
    assert planted.read_bytes() == before


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
def test_a_pipe_in_place_of_an_entry_does_not_hang():
    entry = kept("a")
    entry.unlink()
    os.mkfifo(entry)
    assert object_cache.load("a") is None


@WITH_MODES
def test_an_entry_that_others_may_write_is_built_again():
    kept("a").chmod(0o666)
    assert object_cache.load("a") is None


def test_what_was_used_longest_ago_goes_first(monkeypatch):
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "0.001")
    entries = [kept(str(i), bytes(250)) for i in range(3)]
    for entry, ago in zip(entries, (300, 200, 400), strict=True):
        used(entry, ago)
    assert object_cache.load("2") is not None  # used now
    object_cache.store("3", bytes(250))
    assert [object_cache.load(str(i)) is not None for i in range(4)] == [
        False,
        True,
        True,
        True,
    ]
    assert object_cache.contents() == object_cache.Contents(
        entries=3, size=3 * (250 + object_cache.CODE_BYTES)
    )


def test_entries_of_older_versions_go_too_and_files_of_others_stay(cache, monkeypatch):
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "0.001")
    cache.mkdir()
    old, other = cache / f"{'ab' * 32}.o", cache / "thesis.o"
    parts = [
        cache / f".{'cd' * 32}.o.{'0' * 12}.part",
        cache / f".{'cd' * 32}.o.{'1' * 12}.part",
    ]
    for file in (old, other, *parts):
        file.write_bytes(bytes(900))
    for file in (old, other, parts[0]):
        used(file, 1e6)
    object_cache.store("a", bytes(500))
    assert not old.exists()
    assert other.exists()
    assert [part.exists() for part in parts] == [
        False,
        True,
    ], "a temporary file of now has a writer"


def test_a_use_is_noted_once_a_minute_at_most():
    entry = kept("a")
    for ago, noted in ((30, False), (90, True)):
        used(entry, ago)
        before = entry.stat().st_mtime_ns
        assert object_cache.load("a") is not None
        assert (entry.stat().st_mtime_ns != before) == noted


def test_nothing_is_kept_beyond_a_limit_of_zero(cache, monkeypatch):
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "0")
    object_cache.store("a", b"code")
    assert object_cache.load("a") is None
    assert not cache.exists()
    assert unused_reason() == "SKYARM_CACHE_SIZE is 0"


@pytest.mark.parametrize("text", ["x", "-1", "nan", "inf", "1e305", "256 MB"])
def test_a_limit_that_is_no_number_is_refused(text, monkeypatch):
    monkeypatch.setenv("SKYARM_CACHE_SIZE", text)
    with pytest.raises(
        ValueError,
        match=r"SKYARM_CACHE_SIZE = '.*': must be a number of MB, at least 0",
    ):
        size_limit()


def test_the_limit_is_256_mb(monkeypatch):
    assert size_limit() == 256_000_000
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "1.5")
    assert size_limit() == 1_500_000


def test_without_a_home_nothing_is_kept(cache, monkeypatch):
    for name in ("XDG_STATE_HOME", "LOCALAPPDATA", "HOME", "USERPROFILE"):
        monkeypatch.delenv(name, raising=False)

    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", staticmethod(no_home))
    object_cache.store("a", b"code")
    assert object_cache.load("a") is None
    assert not list(cache.glob("*"))
    assert unused_reason() == "there is no home folder"


@pytest.mark.skipif(os.name == "nt", reason="XDG folders are not of Windows")
def test_a_relative_state_folder_is_ignored(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", "state")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert state_folder() == tmp_path / ".local" / "state" / "skyarm"


def test_clearing_removes_entries_and_nothing_else(cache):
    kept("a", bytes(10))
    kept("b", bytes(20))
    (cache / "thesis.o").write_bytes(b"mine")
    assert object_cache.clear() == object_cache.Contents(
        entries=2, size=30 + 2 * object_cache.CODE_BYTES
    )
    assert [each.name for each in cache.iterdir()] == ["thesis.o"]
    assert object_cache.clear() == object_cache.Contents(entries=0, size=0)
    kept("a")


def test_a_key_that_another_process_makes_meanwhile_is_taken(monkeypatch):
    drawn = cache_places.os.urandom

    def other_first(count):
        monkeypatch.setattr(cache_places.os, "urandom", drawn)
        private.write_private(state_folder() / KEY, b"o" * count)
        return b"m" * count

    monkeypatch.setattr(cache_places.os, "urandom", other_first)
    assert cache_places.user_key(make=True) == b"o" * KEY_BYTES
    assert [each.name for each in state_folder().iterdir()] == [KEY]


def test_those_that_make_the_first_key_at_once_agree_on_one():
    barrier, found = threading.Barrier(8), []

    def work(i):
        barrier.wait()
        object_cache.store(str(i), b"code")

    threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = [object_cache.load(str(i)) for i in range(8)]
    assert found == [b"code"] * 8


@WITH_MODES
@pytest.mark.parametrize(
    ("rights", "used"), [(0o755, True), (0o775, False), (0o1777, False)]
)
def test_a_folder_that_holds_other_files_keeps_its_rights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rights: int, used: bool
) -> None:
    """Whatever the variable names: a home folder, a shared one. Where others may write
    nothing is kept.
    """
    folder = tmp_path / "shared"
    folder.mkdir()
    (folder / "letter.txt").write_text("not ours", "utf-8")
    folder.chmod(rights)
    monkeypatch.setenv("SKYARM_CACHE", str(folder))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        object_cache.store("text", b"code")
    assert mode(folder) == rights
    assert (object_cache.load("text") == b"code") is used
