"""The rows of the robot's log as the controller sends them while it moves: lines in UDP datagrams."""

import socket
from typing import Any

from hil_sim.errors import SimError
from hil_sim.sensors.torque_log import LogRows

_ROWS_IN_ONE = 10  # so that a datagram passes any network in one piece


class TorqueStream:
    """Sends to one address and waits for nobody: a receiver that is not there costs nothing."""

    def __init__(self, address: str) -> None:
        """Args: address: HOST:PORT.

        Raises:
            SimError: no such place.
        """
        host, _, port = address.rpartition(":")
        try:
            found = socket.getaddrinfo(host.strip("[]") or "127.0.0.1", int(port), type=socket.SOCK_DGRAM)
        except (ValueError, OSError, OverflowError):
            raise SimError(f"--torques-to {address}: give HOST:PORT, as in 127.0.0.1:9870") from None
        family, kind, proto, _, place = found[0]
        self._place: Any = place
        self._socket = socket.socket(family, kind, proto)
        self._socket.setblocking(False)

    def send(self, rows: list[LogRows]) -> None:
        """These rows, some to a datagram: t, theta1, theta2, tau1, tau2."""
        lines = [
            ",".join(f"{value:.9f}" for value in (t, *theta, *tau))
            for part in rows
            for t, theta, tau in zip(
                part.t_s.tolist(), part.theta_rad.tolist(), part.tau_Nm.tolist(), strict=True
            )
        ]
        for begin in range(0, len(lines), _ROWS_IN_ONE):
            try:
                self._socket.sendto("\n".join(lines[begin : begin + _ROWS_IN_ONE]).encode(), self._place)
            except OSError:  # nobody listens, or nobody yet
                return

    def close(self) -> None:
        """Sends no more."""
        self._socket.close()
