"""The robot's torques as they come: rows of robot.csv in UDP datagrams.

A controller sends each row when it has it and waits for nobody; what is lost on the way is counted by the
stamps. A line is `t,theta1,..,thetan,tau1,..,taun` as in robot.csv; what stands behind is not read.
"""

import socket
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.errors import LinkError
from impid_host.signals.arrays import Floats

_LARGEST = 65536
_DATAGRAMS_AT_ONCE = 500
_RESTART_S = 1.0  # a clock that goes back by more has begun anew
MOST_ROWS = 1000  # that are worked out at once; what has waited behind more is too old to be shown


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows of the robot's log: t, s, (N,), increasing; theta, tau (N, n)."""

    t: Floats
    theta: Floats
    tau: Floats

    def __len__(self) -> int:
        return len(self.t)

    def part(self, which: slice) -> "Rows":
        """Some of them."""
        return Rows(self.t[which], self.theta[which], self.tau[which])

    @classmethod
    def joined(cls, parts: Sequence["Rows"]) -> "Rows":
        """All of them, in their order."""
        return cls(*(np.concatenate([getattr(part, k) for part in parts]) for k in ("t", "theta", "tau")))


@dataclass(slots=True)
class Counts:
    """What came of the robot's rows.

    Attributes:
        rows: taken; missing: by the stamps, between the first and the last.
        unreadable: lines that are no row.
        restarts: how often the robot's clock has begun anew.
    """

    rows: int = 0
    missing: int = 0
    unreadable: int = 0
    restarts: int = 0


class TorqueReader:
    """From datagrams to rows in order, with a count of what is missing."""

    def __init__(self, joints: int) -> None:
        self.counts = Counts()
        self._joints = joints
        self._last = -np.inf
        self._period = np.inf

    def read(self, datagrams: list[bytes]) -> Rows | None:
        """The rows in these; None where there is none.

        A row that is not later than the one before is left out; a header is passed over.
        """
        table = [row for data in datagrams for line in data.splitlines() if (row := self._row(line))]
        if not table:
            return None
        if len(table) > MOST_ROWS:
            table = table[-MOST_ROWS:]
        values = np.array(table)
        t = values[:, 0]
        if t[0] < self._last - _RESTART_S:
            self.counts.restarts += 1
            self._last = -np.inf
        later = t > np.maximum.accumulate(np.concatenate([[self._last], t[:-1]]))
        if not later.any():
            return None
        values = values[later]
        self._count(values[:, 0])
        n = self._joints
        return Rows(values[:, 0], values[:, 1 : 1 + n], values[:, 1 + n :])

    def _row(self, line: bytes) -> list[float] | None:
        wanted = 1 + 2 * self._joints
        cells = line.split(b",")
        try:
            row = [float(cell) for cell in cells[:wanted]]
        except ValueError:
            row = []
        if len(row) == wanted and np.isfinite(row).all():
            return row
        # A controller that speaks of its columns first, or an empty line at the end of one, is no mistake.
        self.counts.unreadable += bool(line.strip()) and not line.lstrip().startswith(b"t,")
        return None

    def _count(self, t: Floats) -> None:
        steps = np.diff(t, prepend=self._last if np.isfinite(self._last) else t[0])
        positive = steps[steps > 0]
        if len(positive):
            self._period = min(self._period, float(np.median(positive)))
        if np.isfinite(self._period):
            self.counts.missing += int(np.maximum(np.round(steps / self._period) - 1, 0).sum())
        self.counts.rows += len(t)
        self._last = float(t[-1])


def open_port(host: str, port: int) -> socket.socket:
    """A UDP port that receives; port 0: any that is free.

    Raises:
        LinkError: it cannot be had.
    """
    try:
        family, kind, proto, _, place = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        own = socket.socket(family, kind, proto)
        own.bind(place)
    except (OSError, OverflowError) as error:
        raise LinkError(
            f"no torques can be received at {host}:{port} ({error}); choose another --torques"
        ) from None
    return own


def received(own: socket.socket, timeout_s: float) -> list[bytes]:
    """What has come, within a bound; waits for the first."""
    own.settimeout(timeout_s)
    found: list[bytes] = []
    try:
        while len(found) < _DATAGRAMS_AT_ONCE:
            found.append(own.recv(_LARGEST))
            own.settimeout(0.0)
    except (TimeoutError, BlockingIOError):
        pass
    return found
