"""The mean reading of a board at rest."""

import time

import numpy as np
from numpy.typing import NDArray

from impid_host.clock.device import ClockExchange
from impid_host.errors import LinkError
from impid_host.link.client import BoardClient
from impid_host.link.link import Chunk
from impid_host.samples import FLAG_SATURATED
from impid_host.wire.messages import SAMPLE_PERIOD_US
from impid_host.wire.records import Decoded

# A hand that shakes or a board that swings shows far above the accelerometer's own noise of about 1 mg rms.
# In codes of 16 bits, and in codes of 24.
_RESTLESS_CODES = 400.0
_RESTLESS_CODES_WIDE = 256 * _RESTLESS_CODES
_PATIENCE_S = 2.0


class _Codes:
    def __init__(self) -> None:
        self.parts: list[NDArray[np.float64]] = []
        self.saturated = False
        self.wide = False

    @property
    def count(self) -> int:
        return sum(map(len, self.parts))

    def received(self, chunk: Chunk, decoded: Decoded) -> None:  # noqa: ARG002
        for segment in decoded.segments:
            s = segment.samples
            self.parts.append(np.column_stack([s.ax, s.ay]).astype(np.float64))
            self.wide |= s.az is not None
            self.saturated |= bool((s.flags & FLAG_SATURATED).any())

    def sent(self, chunk: Chunk) -> None: ...
    def exchanged(self, exchange: ClockExchange, boot_id: int) -> None: ...


def mean_codes(client: BoardClient, seconds: float) -> NDArray[np.float64]:
    """Mean codes of both axes over that time, (2,).

    Raises:
        LinkError: the board does not stream, is not at rest, or its reading is at a rail.
    """
    codes = _Codes()
    before, client.listener = client.listener, codes
    wanted = int(seconds * 1e6 / SAMPLE_PERIOD_US)
    try:
        client.start()
        deadline = time.monotonic() + seconds + _PATIENCE_S
        while codes.count < wanted and time.monotonic() < deadline:
            client.pump(0.05)
        client.stop()
    finally:
        client.listener = before
    if codes.count < wanted:
        raise LinkError(f"{client.name}: {codes.count} of {wanted} samples came in time; check the cable")
    if codes.saturated:
        raise LinkError(
            f"{client.name}: the reading is at a rail; check the accelerometer's supply and wiring"
        )
    readings = np.concatenate(codes.parts)
    if readings.std(axis=0).max() > (_RESTLESS_CODES_WIDE if codes.wide else _RESTLESS_CODES):
        raise LinkError(f"{client.name}: the board is not at rest; put it down firmly and repeat")
    mean: NDArray[np.float64] = readings.mean(axis=0)
    return mean
