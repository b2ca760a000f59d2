"""``skyarm export``: a log in another format, one line for what cannot be."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

import skyarm as library
from support.commands import refused, skyarm
from support.components import registry_kept
from support.logs import flown, same


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    library.save_log(flown(), "flight.npz")
    with registry_kept():
        yield tmp_path


def test_a_log_goes_through_every_format_that_is_read_back(folder):
    for words, line in (
        (("flight.npz", "--to", "mcap"), "log: flight.mcap"),
        (("flight.mcap", "-o", "deep/other.mcap"), "log: deep/other.mcap"),
        (("deep/other.mcap", "--to", "npz", "-o", "again.npz"), "log: again.npz"),
        (("again.npz", "--to", "csv"), "log: again.csv"),
    ):
        done = skyarm("export", *words)
        assert (done.code, done.out.strip(), done.err) == (0, line, "")
    assert same(library.load_log("again.npz"), flown())
    heads, rows = (folder / "again.csv").read_text().split("\n", 1)
    assert heads.startswith("time [s],position_x [m]")
    assert np.array_equal(
        np.loadtxt(rows.splitlines(), delimiter=",")[:, 1:4], flown().position
    )


def test_a_bag_counts_from_the_epoch_that_is_asked_for_and_has_a_clock(folder):
    """Read by mcap's own reader; the flight inside stays the same to the bit."""
    reader = pytest.importorskip("mcap.reader", reason="needs the extra 'test'")
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="needs the extra 'test'")
    assert (
        skyarm("export", "flight.npz", "--to", "mcap", "--epoch", "1700000000.5").code
        == 0
    )
    with (folder / "flight.mcap").open("rb") as stream:
        read = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        found = [
            (m.log_time, c.topic, d)
            for _, c, m, d in read.iter_decoded_messages(topics=["/clock", "/odom"])
        ]
    start, time = 1_700_000_000_500_000_000, np.rint(flown().time * 1e9).astype(int)
    clock = [
        (at, each.clock.sec * 10**9 + each.clock.nanosec)
        for at, topic, each in found
        if topic == "/clock"
    ]
    assert clock == [(t, t) for t in (start + time).tolist()]
    stamps = [each.header.stamp for _, topic, each in found if topic == "/odom"]
    assert stamps[0].sec * 10**9 + stamps[0].nanosec == start
    assert np.array_equal(library.load_log("flight.mcap").position, flown().position)
    refused(
        skyarm("export", "flight.npz", "--to", "csv", "--epoch", "1"),
        "--epoch = 1.0: must be left out of .csv",
    )
    refused(
        skyarm("export", "flight.npz", "--to", "mcap", "--epoch", "-1"),
        "--epoch = -1.0: must be at least 0",
    )
    for late in ("2147483648", "1e30"):  # seconds of a ROS message are an int32
        refused(
            skyarm("export", "flight.npz", "--to", "mcap", "--epoch", late),
            "must be at most 2147483647 s",
        )


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("flight.npz",), "--to: is missing; must be one of npz, csv, mcap, c, mjcf"),
        (
            ("hummingbird", "-o", "x.xml"),
            "--to: is missing; must be one of npz, csv, mcap, c, mjcf",
        ),
        (
            ("my/vehicle.toml", "-o", "x.xml"),
            "--to: is missing; must be one of npz, csv, mcap, c, mjcf",
        ),
        (("flight.npz", "--to", "xls"), "--to = 'xls': must be one of"),
        (("flight.npz", "--to", "mcpa"), "--to = 'mcpa': did you mean 'mcap'?"),
        (
            ("flight.npz", "--to", "mcap", "-o", "a.npz"),
            "--out = 'a.npz': must end in .mcap, as --to = 'mcap'",
        ),
        (("flight.npz", "-o", "a"), "--out = 'a': suffix ''"),
        (
            ("flight.npz", "--to", "npz"),
            "--out = 'flight.npz': must be another file than those that are read",
        ),
        (("none.mcap", "--to", "npz"), "flight = 'none.mcap': no such file"),
        (("case3", "--to", "npz"), "flight = 'case3': suffix ''"),
        (
            ("cut.npz", "--to", "mcap"),
            "log = 'cut.npz': must be a log that save_npz wrote",
        ),
        (("text.mcap", "--to", "npz"), "log = 'text.mcap': must be a whole MCAP file"),
    ],
)
def test_what_cannot_be_written_is_one_line_and_leaves_nothing(folder, words, line):
    (folder / "cut.npz").write_bytes((folder / "flight.npz").read_bytes()[:-100])
    (folder / "text.mcap").write_text("no log")
    before = sorted(path.name for path in folder.iterdir())
    refused(skyarm("export", *words), line)
    assert sorted(path.name for path in folder.iterdir()) == before


FORMAT = """import skyarm

def write(log, path):
    path.write_text("half")
    path.with_suffix(".more").write_text("half")
    WHOLE

skyarm.register.log_format("mine")(skyarm.LogFormat(write))
"""


def test_a_format_of_ones_own_may_write_more_than_one_file(folder):
    (folder / "own.py").write_text(FORMAT.replace("WHOLE", "return path"))
    assert (
        skyarm(
            "run",
            "case1",
            "--duration",
            "0.25",
            "--plugin",
            "own.py",
            "--log",
            "deep/flight.mine",
        ).code
        == 0
    )
    shutil.rmtree(folder / "__pycache__", ignore_errors=True)
    assert sorted(path.name for path in (folder / "deep").iterdir()) == [
        "flight.mine",
        "flight.more",
    ]


def test_the_log_of_one_of_several_vehicles_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    team = library.run(library.load_scenario("two_on_cables", duration=0.1))
    library.save_log(team, "team.npz")
    for words in (("show", "team.npz"), ("identify", "lags", "team.npz")):
        refused(skyarm(*words), "skyarm export LOG --vehicle left -o NEW.npz")
    assert (
        skyarm("export", "team.npz", "--vehicle", "right", "-o", "right.npz").code == 0
    )
    assert same(library.load_log("right.npz"), team.agents["right"])
    assert skyarm("show", "right.npz").code == 0
    refused(
        skyarm("export", "team.npz", "--vehicle", "rihgt", "-o", "x.npz"),
        "--vehicle = 'rihgt': did you mean 'right'?",
    )
