"""The board's connector: what a carrier brings to the board, and what the board sends back through it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from hil_sim.board import layout
from hil_sim.board.protocol import Board
from hil_sim.board.wire import FrameReader, accepts_start, sample_kinds
from hil_sim.carriers.protocol import Cable, CanCarrier, CanFrame, Carrier
from hil_sim.faults.bus import FaultyBus
from hil_sim.faults.line import FaultyLine

Parcel = bytes | CanFrame
DELIMITER = b"\x00"
CAN_FRAMES_PER_MS = 7  # 1 Mbit/s, full frames of 8 bytes with stuffing


@dataclass(frozen=True)
class Sent:
    """What left the board: how many samples, and whether it said that it accepts START."""

    samples: int
    started: bool


class Attachment(Protocol):
    """One carrier, plugged into the board."""

    @property
    def cable(self) -> Cable:
        """What can be pulled, with all faults in it."""

    @property
    def line(self) -> FaultyLine | None:
        """The serial line; on CAN the one behind the adapter, if it has one."""

    @property
    def bus(self) -> FaultyBus | None:
        """The CAN bus, if there is one."""

    def ready(self) -> dict[str, Any]:
        """How a client connects, for the ready line."""

    def receive(self, timeout_s: float) -> list[Parcel]:
        """Waits for the client, at most timeout_s; one parcel per frame."""

    def transit_us(self, parcel: Parcel) -> int:
        """How long the parcel is on the wire to the board."""

    def deliver(self, board: Board, parcel: Parcel, t_us: int) -> None:
        """The parcel's last bit arrives at board time t_us."""

    def hand_out(self, board: Board) -> Sent:
        """Takes what the board has sent and hands it to the client."""

    def board_restarted(self) -> None:
        """What the board was sending ended in the middle."""


class SerialAttachment:
    """Implements `Attachment` for serial bytes."""

    def __init__(self, carrier: Carrier, bytes_per_ms: int, clock_us: Callable[[], int]) -> None:
        """`clock_us` shows board time."""
        self.line = FaultyLine(carrier, clock_us)
        self.bus = None
        self._bytes_per_ms = bytes_per_ms
        self._reader = FrameReader()

    @property
    def cable(self) -> Cable:
        """What can be pulled."""
        return self.line

    def ready(self) -> dict[str, Any]:
        """How a client connects."""
        return {"port": self.line.address, "can": None, "can_config": None}

    def receive(self, timeout_s: float) -> list[Parcel]:
        """One parcel per frame, so that each has its own time of arrival."""
        *whole, rest = self.line.receive(timeout_s).split(DELIMITER)
        return [*(piece + DELIMITER for piece in whole), *([rest] if rest else [])]

    def transit_us(self, parcel: Parcel) -> int:
        """Ten bits a byte."""
        return 1000 * len(parcel) // self._bytes_per_ms

    def deliver(self, board: Board, parcel: Parcel, t_us: int) -> None:
        """The last byte arrives at board time t_us."""
        assert isinstance(parcel, bytes)
        board.serial_receive(parcel, t_us)

    def hand_out(self, board: Board) -> Sent:
        """From the board to the line."""
        board.can_take()  # no bus is attached
        data = board.serial_take()
        if not data:
            return Sent(0, started=False)
        frames = self._reader.feed(data)
        self.line.send(data)
        return Sent(
            sum(frame.count for frame in frames if frame.kind in sample_kinds()),
            started=any(accepts_start(frame) for frame in frames),
        )

    def board_restarted(self) -> None:
        """The frame under way has no end."""
        self._reader = FrameReader()


class CanAttachment:
    """Implements `Attachment` for CAN frames."""

    def __init__(
        self, carrier: CanCarrier, clock_us: Callable[[], int], line: FaultyLine | None = None
    ) -> None:
        """`clock_us` shows board time; `line` is the one that lies behind the carrier, if any."""
        self.bus = FaultyBus(carrier, clock_us)
        self.line = line
        database = layout.database()
        self._encoder = database.get_message_by_name("ENCODER").frame_id
        self._response = database.get_message_by_name("RESPONSE").frame_id
        self._start = layout.code("RESPONSE", "opcode", "START")
        self._ok = layout.code("RESPONSE", "result", "OK")

    @property
    def cable(self) -> Cable:
        """What can be pulled."""
        return self.bus

    def ready(self) -> dict[str, Any]:
        """How a client connects; can_config holds the arguments of python-can's `Bus`."""
        config = self.bus.config
        return {"port": None, "can": f"{config['interface']}:{config['channel']}", "can_config": config}

    def receive(self, timeout_s: float) -> list[Parcel]:
        """One parcel per frame."""
        return list(self.bus.receive(timeout_s))

    def transit_us(self, _parcel: Parcel) -> int:
        """A full frame."""
        return 1000 // CAN_FRAMES_PER_MS

    def deliver(self, board: Board, parcel: Parcel, t_us: int) -> None:
        """The frame ends at board time t_us."""
        assert isinstance(parcel, tuple)
        board.can_receive(*parcel, t_us)

    def hand_out(self, board: Board) -> Sent:
        """From the board to the bus."""
        board.serial_take()  # no serial line is attached
        frames = board.can_take()
        if not frames:
            return Sent(0, started=False)
        self.bus.send(frames)
        return Sent(
            sum(number == self._encoder for number, _ in frames),
            started=any(number == self._response and self._accepts(data) for number, data in frames),
        )

    def board_restarted(self) -> None:
        """A frame is whole or not at all."""

    def _accepts(self, data: bytes) -> bool:
        answer = layout.unpack("RESPONSE", np.frombuffer(data, dtype=np.uint8).reshape(1, 8))
        return bool(answer["opcode"][0] == self._start and answer["result"][0] == self._ok)
