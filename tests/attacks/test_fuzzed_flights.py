"""Damaged files of real flights: a flight with notes or one line, in little time and
memory.
"""

from __future__ import annotations

import random
import resource
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import skyarm
from skyarm.flight_data.columns_file import read_columns
from skyarm.flight_data.flight_data import load_flight
from support.cases import sampled
from support.logs import flown

FLIGHTS = Path(__file__).parents[1] / "data" / "flights"
HEAD = 3000
WORDS = (
    b"\xff\xff\xff\xff",
    b"\0\0\0\0",
    b"\xff\xff\xff\x7f",
    b"\xff" * 8,
    b"\0\0\0\0\1\0\0\0",
)


def damaged(data: bytes, rng: random.Random) -> bytes:
    """One to twenty changes, half of them in the head."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        if not found:
            break
        at = min(
            rng.randrange(HEAD if rng.random() < 0.5 else len(found)), len(found) - 1
        )
        kind = rng.randrange(7)
        if kind == 0:
            found[at] = rng.randrange(256)
        elif kind == 1:
            found[at] ^= 1 << rng.randrange(8)
        elif kind == 2:
            word = rng.choice(WORDS)
            found[at : at + len(word)] = word
        elif kind == 3:
            del found[at : at + rng.randrange(1, 60)]
        elif kind == 4:
            found[at:at] = rng.randbytes(rng.randrange(1, 30))
        elif kind == 5:
            place = rng.randrange(len(found))
            found[at:at] = found[place : place + rng.randrange(1, 200)]
        elif rng.random() < 0.3:
            del found[at:]
    return bytes(found)


def own(kind: str) -> Callable[[Path], bytes]:
    return lambda folder: skyarm.save_log(flown(), folder / f"own.{kind}").read_bytes()


def rows(path: Path, count: int) -> bytes:
    return b"\n".join(path.read_bytes().split(b"\n")[:count])


FILES: dict[str, tuple[str, Callable[[Path], bytes]]] = {
    "crazyflie": (
        "a",
        lambda _: (FLIGHTS / "crazyflie" / "log15_from_20_to_23_s").read_bytes(),
    ),
    "ulog": (
        "a.ulg",
        lambda _: (FLIGHTS / "px4" / "sample_px4_events_cut.ulg").read_bytes(),
    ),
    "csv": (
        "a.csv",
        lambda _: rows(
            FLIGHTS / "nanobench" / "B9_trefoil_medium_rep4_from_20_to_23_s.csv", 40
        ),
    ),
    "columns": (
        "a.toml",
        lambda _: (FLIGHTS / "gazebo_iris" / "columns.toml").read_bytes(),
    ),
    "npz": ("a.npz", own("npz")),
    "mcap": ("a.mcap", own("mcap")),
    "bag": (
        "a.mcap",
        lambda folder: own("mcap")(folder).replace(b"flight.npz", b"flight.xyz"),
    ),
}


@pytest.mark.attack
@pytest.mark.parametrize("kind", FILES)
def test_two_thousand_damaged_files(kind: str, tmp_path: Path) -> None:
    attack(
        kind, tmp_path, 2000 if kind in ("crazyflie", "ulog", "csv", "columns") else 300
    )


@pytest.mark.parametrize("kind", sampled(list(FILES), 4))
def test_some_damaged_files(kind: str, tmp_path: Path) -> None:
    attack(kind, tmp_path, 25)


def attack(kind: str, folder: Path, count: int) -> None:
    if kind in ("bag", "mcap"):
        pytest.importorskip("mcap", reason="needs the extra 'logs'")
        pytest.importorskip("rosbags", reason="needs the extra 'flights'")
    name, make = FILES[kind]
    data, rng, read = make(folder), random.Random(kind), 0
    (folder / "columns.toml").write_bytes(
        (FLIGHTS / "nanobench" / "columns.toml").read_bytes()
    )
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(count):
        path = folder / name
        path.write_bytes(damaged(data, rng))
        begin = time.process_time()
        try:
            if kind == "columns":
                read_columns(path)
            else:
                load_flight(path)
            read += 1
        except ValueError as error:
            words = str(error)
            assert "\n" not in words
            assert len(words) < 1200
            assert name in words
        assert time.process_time() - begin < 10.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory < 1_000_000  # kB
    assert read or kind == "npz"
