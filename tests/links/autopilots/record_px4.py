"""Record a session with PX4 for the tests: ``python record_px4.py FILE`` with PX4's
program in SKYARM_PX4.

Of PX4's messages on the onboard port those that the link reads are left, which keeps
the file small.
"""

from __future__ import annotations

import dataclasses
import gzip
import sys
import tempfile
from pathlib import Path

from px4_flights import QUIET, scenario_of

from skyarm.links import mavlink
from skyarm.links.autopilots import px4
from skyarm.links.transcript import HEAD, MAGIC, RECEIVED
from skyarm.simulate.session import open_session

READ = (
    "HEARTBEAT",
    "LOCAL_POSITION_NED",
    "STATUSTEXT",
    "ESTIMATOR_STATUS",
    "PARAM_VALUE",
    "COMMAND_ACK",
)

SECONDS = 2.0
"""s of flight after the take-off."""


def main(target: str) -> None:
    """Fly, and write the transcript without the messages that nothing reads."""
    px4.SETTLED = 5.0
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.gz"
        flown = dataclasses.replace(
            scenario_of(
                Path(folder), duration=SECONDS, climb=0.2, transcript=str(whole)
            ),
            sensors=QUIET,
        )
        log = open_session(flown).run()
        print(log.status, log.info["autopilot"])
        data = gzip.decompress(whole.read_bytes())[len(MAGIC) :]
    with gzip.GzipFile(target, "wb", compresslevel=9, mtime=0) as file:
        file.write(MAGIC)
        at = 0
        while at < len(data):
            time, what, name, size = HEAD.unpack_from(data, at)
            start = at + HEAD.size + name
            channel, message, at = (
                data[start - name : start],
                data[start : start + size],
                start + size,
            )
            if what == RECEIVED and channel == b"onboard":
                parser = mavlink.Parser(datagrams=True)
                message = b"".join(
                    each
                    for each in frames(message)
                    if any(m.name in READ for m in parser.feed(each))
                )
            file.write(HEAD.pack(time, what, name, len(message)) + channel + message)


def frames(data: bytes) -> list[bytes]:
    """Frames of MAVLink 2 in datagrams one after the other, which begin with a frame
    each.
    """
    found = []
    while data[:1] == b"\xfd":
        size = 12 + data[1] + (13 if data[2] & 1 else 0)
        found.append(data[:size])
        data = data[size:]
    return found


if __name__ == "__main__":
    main(sys.argv[1])
