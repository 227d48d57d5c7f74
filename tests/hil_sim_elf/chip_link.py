"""The host's client on an emulated board in the same process, whose time goes on only while the host waits."""

from collections.abc import Callable

import numpy as np
from impid_host.errors import LinkError
from impid_host.link.link import Chunk
from impid_host.wire.can_frames import pack_frame, unpack_frames
from impid_host.wire.carrier import CAN, SERIAL, Carrier
from numpy.typing import NDArray

from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.errors import PowerCut

Codes = NDArray[np.uint16]


def at_rest(ticks: int) -> Codes:
    """Both axes at half their range, (ticks, 8, 2)."""
    return np.full((ticks, 8, 2), 2048, np.uint16)


class ChipLink:
    """A link to the emulated board.

    Args:
        codes: what the converters see in so many ticks.
        ppm: how much faster the chip's clock is than the one that stamps.
    """

    name = "chip"

    def __init__(
        self,
        board: ElfBoard,
        carrier: Carrier = SERIAL,
        codes: Callable[[int], Codes] = at_rest,
        ppm: float = 0.0,
    ) -> None:
        self.board, self.carrier, self.codes, self.ppm = board, carrier, codes, ppm
        self.boots = True  # a reset ends in a boot
        self.powered = True

    def now(self) -> float:
        """Seconds of the clock that stamps."""
        return self.board.soc.schedule.seconds() / (1 + self.ppm * 1e-6)

    def _chunk(self, data: bytes) -> Chunk:
        stamp = round(self.now() * 1e9)
        return Chunk(stamp, stamp, data)

    def _run(self, ticks: int) -> None:
        try:
            self.board.run(self.codes(ticks), np.zeros((ticks, 2), np.int32))
        except PowerCut:
            self.powered = False
        if not self.powered:
            raise LinkError("chip: the port is gone")
        if self.board.reset_requested and self.boots:
            self.board.reboot()

    def send(self, data: bytes) -> Chunk:
        chunk = self._chunk(data)
        if self.carrier is CAN:
            for frame in unpack_frames(data):
                self.board.can_receive(int(frame["identifier"]), bytes(frame["data"]), self.board.now_us)
        else:
            self.board.serial_receive(data, self.board.now_us)
        return chunk

    def receive(self, timeout_s: float) -> Chunk | None:
        for _ in range(max(1, min(200, int(timeout_s * 1e3)))):
            self._run(1)
            if self.carrier is CAN:
                data = b"".join(
                    pack_frame(0, number, bytes(payload)) for number, payload in self.board.can_take()
                )
            else:
                data = self.board.serial_take()
            if data:
                return self._chunk(data)
        return None

    def close(self) -> None:
        pass
