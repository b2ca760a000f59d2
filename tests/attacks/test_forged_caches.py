"""Whatever stands in the cache of machine code, what is executed is what this user
built, or it is built again.
"""

from __future__ import annotations

import hashlib
import os
import random
import shutil
from pathlib import Path

import numpy as np
import pytest

from skyarm.compile.llvm import object_cache
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.object_cache import KEY
from skyarm.compile.tracing.program import trace_loop
from skyarm.records.files import private

CODE = {"a": bytes(range(256)) * 8, "b": b"other code" * 100}

FORGED = b"evil code" * 100


def _damage(entry: Path, key: Path, other: bytes, rng: random.Random) -> None:
    """One thing that befalls a cache, or that somebody who may write into it does."""
    held = bytearray(entry.read_bytes() if entry.is_file() else b"x" * 100)
    what = rng.randrange(13)
    if what == 0:
        entry.write_bytes(bytes(held[: rng.randrange(len(held) + 1)]))
    elif what == 1:
        held[rng.randrange(len(held))] ^= 1 << rng.randrange(8)
        entry.write_bytes(bytes(held))
    elif what == 2:
        entry.write_bytes(bytes(held) + rng.randbytes(rng.choice((1, 32, 5000))))
    elif what in (3, 4, 5):
        # as versions before the key wrote entries; another content behind a true code;
        # another program's entry
        old = hashlib.sha256(FORGED).digest() + FORGED
        entry.write_bytes(
            (old, bytes(held[: object_cache.CODE_BYTES]) + FORGED, other)[what - 3]
        )
    elif what == 6:
        entry.unlink(missing_ok=True)
        entry.symlink_to(
            rng.choice(
                ("/dev/zero", "/etc/passwd", "no such file", entry.name, str(key))
            )
        )
    elif what == 7:
        entry.unlink(missing_ok=True)
        entry.mkdir()
    elif what == 8:
        key.write_bytes(key.read_bytes()[: rng.randrange(32)])
    elif what == 9:
        changed = bytearray(key.read_bytes())
        changed[rng.randrange(len(changed))] ^= 1
        key.write_bytes(bytes(changed))
    elif what == 10:
        key.unlink()
    elif what == 11:
        rng.choice((entry, key)).chmod(
            rng.choice((0o000, 0o200, 0o444, 0o644, 0o666, 0o777))
        )
    else:
        rng.choice((entry, key)).parent.chmod(rng.choice((0o755, 0o775, 0o777, 0o700)))


def attack(count: int, folder: Path, seed: int) -> int:
    """Damage caches in one way or two; returns how many still gave an entry. It must be
    the true one.
    """
    believed = 0
    cache, key = folder / "cache", folder / "state" / "skyarm" / KEY
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        for each in (cache, folder / "state"):
            if each.exists():
                shutil.rmtree(each)
        for name, code in CODE.items():
            object_cache.store(name, code)
        entries = {hashlib.sha256(name.encode()).hexdigest(): name for name in CODE}
        paths = {entries[path.stem]: path for path in cache.glob("*.o")}
        other = paths["b"].read_bytes()
        for _ in range(rng.choice((1, 1, 2))):
            if (
                key.is_file()
                and not paths["a"].is_dir()
                and not paths["a"].is_symlink()
            ):
                _damage(paths["a"], key, other, rng)
        where = f"{number} of seed {seed}"
        found = object_cache.load("a")
        believed += found is not None
        assert found in (None, CODE["a"]), where
        object_cache.store("a", CODE["a"])
        if not paths["a"].is_dir():
            assert object_cache.load("a") == CODE["a"], where
    return believed


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv("SKYARM_CACHE_SIZE", raising=False)
    return tmp_path


@pytest.mark.skipif(not private.WITH_OWNERS, reason="no owners and modes of files here")
def test_two_hundred_damaged_caches_give_the_true_code_or_none(places: Path) -> None:
    assert 4 < attack(200, places, seed=1) < 160


@pytest.mark.attack
@pytest.mark.parametrize("part", range(10))
@pytest.mark.skipif(not private.WITH_OWNERS, reason="no owners and modes of files here")
def test_twenty_thousand_damaged_caches_give_the_true_code_or_none(
    part: int, places: Path
) -> None:
    assert attack(2000, places, seed=100 + part)


def test_a_forged_entry_with_a_plain_digest_is_not_executed(places: Path) -> None:
    """The attack that the key ends: another program's code, behind the digest that
    anybody can make.
    """
    rows = np.ones((3, 0))

    def kernel(factor: float) -> Kernel:
        return Kernel(
            trace_loop(lambda c, p, r, u: ((c[0] * factor,), ()), (1.0,), (), ())
        )

    cache = Path(os.environ["SKYARM_CACHE"])
    kernel(2.0)
    (own,) = cache.glob("*.o")
    kernel(5.0)
    (other,) = set(cache.glob("*.o")) - {own}
    code = other.read_bytes()[object_cache.CODE_BYTES :]
    for forged in (hashlib.sha256(code).digest() + code, other.read_bytes()):
        own.write_bytes(forged)
        carry, _ = kernel(2.0).run(np.ones((1, 1)), np.zeros((0, 1)), rows)
        assert carry.tolist() == [[8.0]]
