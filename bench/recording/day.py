"""24 simulated hours over both carriers, in virtual time, with every counter's wrap inside.

The board starts 30 minutes before its 32-bit sample index and the low half of its clock wrap; frame_seq and
the index bits of CAN wrap all the time. Every thousandth piece of the stream is lost on the way. Encoder 1
counts ticks, so that every sample says itself what its time and index must be.
"""

import sys
import time

import numpy as np
from common import save
from impid_host.wire.can_frames import CAN_FRAME
from impid_host.wire.carrier import CAN, SERIAL
from impid_host.wire.messages import OPCODE
from impid_host.wire.records import Loss

from hil_sim._native import ffi, lib
from hil_sim.board.native import BoardConfig, NativeBoard

BEFORE_WRAP = 30 * 60 * 1000
FIRST_INDEX = 2**32 - BEFORE_WRAP
START_US = 2**32 - BEFORE_WRAP * 1000
PIECE = 100  # ticks
LOST_EVERY = 1000  # pieces
_RAW = np.dtype(
    {"names": ["id", "dlc", "data"], "formats": ["<u2", "u1", "V8"], "offsets": [0, 2, 3], "itemsize": 12}
)


def run(carrier_name: str, hours: float) -> dict[str, object]:
    board = NativeBoard(
        BoardConfig(boot_id=9, first_index=FIRST_INDEX, start_us=START_US, serial_bytes_per_ms=0)
    )
    carrier = {"serial": SERIAL, "can": CAN}[carrier_name]
    decoder = carrier.decoder()
    adc = np.full((PIECE, 8, 2), 2048, dtype=np.uint16)
    took = can_frames if carrier is CAN else NativeBoard.serial_take
    command(board, carrier_name, 1, OPCODE["START"])
    ticks = stored = wrong = lost = pieces = 0
    total = int(hours * 3600 * 1000)
    began = time.perf_counter()
    produced, runs = None, set[int]()
    while produced is None:
        if ticks < total:
            counts = np.arange(ticks, ticks + PIECE, dtype=np.int64).astype(np.int32)
            board.run(adc, np.column_stack([counts, -counts]))
            ticks += PIECE
        else:
            command(board, carrier_name, 2, OPCODE["STOP"])
            board.run(adc, np.zeros((PIECE, 2), dtype=np.int32))
        data = took(board)
        pieces += 1
        if pieces % LOST_EVERY == 500 and ticks < total - LOST_EVERY * PIECE:
            continue
        decoded = decoder.feed(data)
        for segment in decoded.segments:
            s = segment.samples
            runs.add(segment.run)
            tick = s.enc1.astype(np.int64)
            wrong += int(np.count_nonzero(s.t_us.astype(np.int64) != START_US + tick * 1000))
            wrong += int(np.count_nonzero(s.enc2 != -s.enc1))
            wrong += int(np.count_nonzero(np.diff(segment.index.astype(np.int64)) != np.diff(tick)))
            stored += len(segment)
        lost += sum(event.lost for event in decoded.events if isinstance(event, Loss))
        for response in decoded.responses:
            if response.opcode == OPCODE["STOP"]:
                produced = response.value
    return {
        "hours": hours,
        "produced": produced,
        "stored": stored,
        "lost": lost,
        "balanced": produced == stored + lost,
        "wrong": wrong,
        "runs": len(runs),
        "took_s": round(time.perf_counter() - began, 1),
    }


def command(board: NativeBoard, carrier: str, request_id: int, opcode: int) -> None:
    if carrier == "serial":
        board.serial_receive(b"\0" + SERIAL.encode_command(request_id, opcode, 0, 0), board.now_us)
    else:
        frame = np.frombuffer(CAN.encode_command(request_id, opcode, 0, 0), dtype=CAN_FRAME)[0]
        board.can_receive(int(frame["identifier"]), frame["data"].tobytes(), board.now_us)


def can_frames(board: NativeBoard) -> bytes:
    parts = []
    while count := lib.impid_board_can_take(board._board, board._frames, 256):
        assert ffi.sizeof(board._frames[0]) == _RAW.itemsize
        raw = np.frombuffer(ffi.buffer(board._frames, count * _RAW.itemsize), dtype=_RAW)
        packed = np.zeros(count, dtype=CAN_FRAME)
        packed["identifier"], packed["dlc"], packed["data"] = raw["id"], raw["dlc"], raw["data"]
        parts.append(packed.tobytes())
    return b"".join(parts)


def main(hours: float = 24.0) -> None:
    save("day", serial=run("serial", hours), can=run("can", hours))


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
