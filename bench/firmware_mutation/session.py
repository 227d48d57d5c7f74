"""An emulated board with a host's half of the conversation."""

import struct
from pathlib import Path

import numpy as np
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.frame import encode_command
from impid_host.wire.records import BoardStatus

from hil_sim.board import layout
from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.memory import Memory
from hil_sim.board.elf.wiring import Wiring
from hil_sim.board.native import BoardConfig

UID = (0x11, 0x22, 0x33)
COMMAND_ID = 0x100


def code(signal: str, name: str, message: str = "COMMAND") -> int:
    """The number of a choice of the message set."""
    return layout.code(message, signal, name)


class Session:
    """A board that has booted; it rests at 0 g and 0 counts unless told otherwise."""

    def __init__(self, image: Path | Memory, wiring: Wiring, hse_present: bool = True) -> None:
        self.board = ElfBoard(image, BoardConfig(uid=UID), hse_present, wiring)
        self._request = 0

    def run(self, ticks: int, faults: np.ndarray | None = None) -> None:
        """Ticks at rest."""
        quiet = np.full((ticks, 8, 2), 2048, np.uint16)
        self.board.run(quiet, np.zeros((ticks, 2), np.int32), faults)

    def command(self, opcode: str, item: str | int = 0, value: int = 0) -> bytes:
        """The bytes of the next command."""
        self._request += 1
        number = code("item", item) if isinstance(item, str) else item
        return encode_command(self._request, code("opcode", opcode), number, value)

    def ask(self, opcode: str, item: str | int = 0, value: int = 0) -> int:
        """Sends a command over the serial line. Returns the value of its answer, which must be OK."""
        frame = self.command(opcode, item, value)
        self.board.serial_take()
        self.board.serial_receive(frame, self.board.now_us + 50)
        self.run(10)
        answers = SerialDecoder().feed(self.board.serial_take()).responses
        values = [int(a.value) for a in answers if a.request_id == self._request and a.result == 0]
        assert len(values) == 1, f"{opcode} {item} is not answered with OK"
        return values[0]

    def can_command(self, opcode: str) -> bytes:
        """The payload of the next command, for CAN."""
        self._request += 1
        return struct.pack("<HBBI", self._request, code("opcode", opcode), 0, 0)

    def send_on_can(self, opcode: str) -> None:
        """Sends a command over CAN."""
        self.board.can_receive(COMMAND_ID, self.can_command(opcode), self.board.now_us + 50)

    def status(self) -> BoardStatus:
        """The board's next STATUS, which comes every 100 ms."""
        self.board.serial_take()
        self.run(110)
        statuses = SerialDecoder().feed(self.board.serial_take()).statuses
        assert statuses, "no STATUS"
        return statuses[-1]

    def reset_cause(self) -> int:
        """Of the last reset, as the board has it; waits for the reset first."""
        for _ in range(100):
            if self.board.reset_requested:
                break
            self.run(50)
        assert self.board.reset_requested, "no reset"
        self.board.serial_take()
        self.board.reboot()
        self.run(5)
        return self.ask("INFO", "RESET_CAUSE")
