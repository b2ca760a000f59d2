"""TCP and UDP ports of a PX4 instance on the loopback address, computed from its
instance number.
"""

from __future__ import annotations

import socket

from skyarm.links.autopilots.autopilot import LinkError
from skyarm.links.sockets import LOOPBACK, open_datagrams
from skyarm.records.immutable import positional
from skyarm.scenario.scenario_record import ScenarioError

INSTANCES = 10
"""Number of program instances for which PX4's start script has ports."""

ONBOARD_PORT, JOINT_PORT = 14540, 14640
"""UDP ports of instance 0: for PX4's onboard MAVLink, and for the joints of an external
program."""


@positional
class Ports:
    """Sockets for a PX4 instance on the loopback address: the listening simulator port
    and the onboard port.
    """

    instance: int
    listener: socket.socket
    onboard: socket.socket

    @property
    def partner(self) -> tuple[str, int]:
        """Address of PX4's side of the onboard port."""
        return LOOPBACK, 14580 + self.instance


def open_ports(instance: int) -> Ports:
    """Open the ports of a PX4 instance; -1 takes the first instance whose ports are
    free.

    Raises:
        ScenarioError: an instance that PX4 does not have.
        LinkError: the ports are taken.
    """
    if not -1 <= instance < INSTANCES:
        raise ScenarioError(
            f"controller.instance = {instance}: must be from 0 to {INSTANCES - 1}, or"
            " -1 for any"
        )
    reason = ""
    for number in range(INSTANCES) if instance < 0 else (instance,):
        # PX4 adds its instance to each of these numbers
        tcp = socket.socket()
        try:
            # the port of a flight that has just ended may be used at once
            tcp.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            tcp.bind((LOOPBACK, 4560 + number))
            tcp.listen(1)
            # PX4's own port, which an instance of another user may have
            open_datagrams((LOOPBACK, 14580 + number)).close()
            onboard = open_datagrams((LOOPBACK, ONBOARD_PORT + number))
            return Ports(number, tcp, onboard)
        except OSError as error:
            reason = error.strerror or str(error)
            tcp.close()
    first, last = (0, INSTANCES - 1) if instance < 0 else (instance, instance)
    ports = ", ".join(_span(base + first, base + last) for base in (4560, 14540, 14580))
    raise LinkError(
        f"the ports TCP {ports.replace(', ', ', UDP ', 1)} must be free for PX4:"
        f" {reason}"
    )


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first} to {last}"
