"""Datagram sockets, and reading of waiting data without blocking, up to a limit."""

from __future__ import annotations

import socket

Address = tuple[str, int]
"""Host and port of the sender of a datagram."""

LOOPBACK = "127.0.0.1"


def open_datagrams(
    address: Address = (LOOPBACK, 0), *, calls: bool = False
) -> socket.socket:
    """Open a UDP socket that does not block, at an address of this machine or connected
    to one.

    Args:
        address: host and port; port 0 takes a free one.
        calls: connect to the address, so that only its datagrams arrive; else bind it.

    Raises:
        OSError: the port is taken, or no such address.
    """
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    try:
        if calls:
            made.connect(address)
        else:
            made.bind(address)
    except OSError:
        made.close()
        raise
    return made


def drain(port: socket.socket, most: int = 256) -> list[tuple[bytes, Address | None]]:
    """Read waiting data of a socket without blocking: at most ``most`` pieces, each
    with its sender.

    A sender that is faster than its reader cannot hold the reader up. A stream's pieces
    have no sender; the last one is empty if the other side has closed the stream.

    Args:
        port: socket of datagrams or of a stream.
        most: pieces.

    Raises:
        OSError: of the port, but that nothing is there or that nobody listens at the
            other side of a datagram port.
    """
    pieces: list[tuple[bytes, Address | None]] = []
    port.setblocking(False)
    for _ in range(most):
        try:
            pieces.append(port.recvfrom(65536))
        except BlockingIOError:
            break
        except ConnectionRefusedError:
            continue  # an earlier datagram of ours found nobody
        if not pieces[-1][0] and port.type == socket.SOCK_STREAM:
            break
    return pieces
