"""Reading what has arrived at a socket, and no more than a fair share."""

from __future__ import annotations

import socket

import pytest

from skyarm.links.sockets import drain, open_datagrams


def test_datagrams_come_with_their_senders_and_no_more_than_asked_for() -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as theirs,
    ):
        ours.bind(("127.0.0.1", 0))
        ours.setblocking(False)
        theirs.bind(("127.0.0.1", 0))
        for k in range(20):
            theirs.sendto(bytes([k]), ours.getsockname())
        assert drain(ours, most=15) == [
            (bytes([k]), theirs.getsockname()) for k in range(15)
        ]
        assert [data for data, _ in drain(ours)] == [bytes([k]) for k in range(15, 20)]
        assert drain(ours) == []


def test_the_end_of_a_stream_is_an_empty_piece_and_the_last() -> None:
    ours, theirs = socket.socketpair()
    with ours:
        ours.setblocking(False)
        theirs.sendall(b"abc")
        theirs.close()
        assert [data for data, _ in drain(ours)] == [b"abc", b""]


def test_a_broken_port_is_an_error() -> None:
    port = socket.socket()
    port.close()
    with pytest.raises(OSError, match="descriptor"):
        drain(port)


def test_a_port_is_bound_once_and_one_that_calls_hears_its_partner_alone() -> None:
    with open_datagrams() as ours, open_datagrams() as stranger:
        with pytest.raises(OSError, match="in use"):
            open_datagrams(ours.getsockname())
        with open_datagrams(ours.getsockname(), calls=True) as caller:
            caller.send(b"hello")
            assert drain(ours) == [(b"hello", caller.getsockname())]
            stranger.sendto(b"odd", caller.getsockname())
            ours.sendto(b"yes", caller.getsockname())
            assert [data for data, _ in drain(caller)] == [b"yes"]
