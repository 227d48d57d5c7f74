"""The simulated day of day.py through the file: board, decoder, recording, and read back from the disk.

`day_file.py [HOURS]`. Pieces of 20 ms, each flushed as the recorder flushes; every thousandth is lost on the way.
What is read back must be what the board had made, sample by sample, across every counter's wrap.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from common import save
from day import FIRST_INDEX, START_US, can_frames, command
from impid_host.link.link import Chunk
from impid_host.recording.reader import read_recording
from impid_host.recording.writer import RecordingWriter
from impid_host.wire.can_frames import CAN_FRAME
from impid_host.wire.carrier import CAN, SERIAL
from impid_host.wire.messages import OPCODE
from impid_host.wire.records import Loss

from hil_sim.board.native import BoardConfig, NativeBoard

PIECE = 20  # ticks
LOST_EVERY = 1000  # pieces
NS = 1_000_000  # in a tick


def write(carrier_name: str, hours: float, out: Path) -> dict[str, int]:
    """Record that many hours of board time; what the board made, and what the decoder stored and lost live."""
    board = NativeBoard(
        BoardConfig(boot_id=9, first_index=FIRST_INDEX, start_us=START_US, serial_bytes_per_ms=0)
    )
    carrier = {"serial": SERIAL, "can": CAN}[carrier_name]
    decoder, took = carrier.decoder(), can_frames if carrier is CAN else NativeBoard.serial_take
    writer = RecordingWriter.create(out, {}, carrier=carrier_name)
    adc = np.full((PIECE, 8, 2), 2048, dtype=np.uint16)
    command(board, carrier_name, 1, OPCODE["START"])
    total, stored, lost = int(hours * 3_600_000), 0, 0
    began_ns = time.monotonic_ns()
    for ticks in range(0, total + PIECE, PIECE):
        if ticks >= total:
            command(board, carrier_name, 2, OPCODE["STOP"])
        counts = np.arange(ticks, ticks + PIECE, dtype=np.int64).astype(np.int32)
        board.run(adc, np.column_stack([counts, -counts]))
        data = took(board)
        if ticks // PIECE % LOST_EVERY == 500 and ticks < total - LOST_EVERY * PIECE:
            continue
        now_ns = began_ns + ticks * NS
        if carrier is CAN:  # frames bear their own arrival
            frames = np.frombuffer(bytearray(data), dtype=CAN_FRAME)
            frames["monotonic_ns"] = now_ns
            data = frames.tobytes()
        writer.received(Chunk(now_ns, now_ns, data))
        decoded = decoder.feed(data)
        for segment in decoded.segments:
            writer.samples(segment, now_ns)
            stored += len(segment)
        for status in decoded.statuses:
            writer.status(status, now_ns)
        lost += sum(event.lost for event in decoded.events if isinstance(event, Loss))
        writer.flush()
    writer.close({"ending": "complete"})
    return {"stored_live": stored, "lost_live": lost}


def run(carrier: str, hours: float) -> dict[str, object]:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "day.mcap"
        began = time.perf_counter(), time.process_time()
        live = write(carrier, hours, out)
        written = time.perf_counter(), time.process_time()
        recording = read_recording(out)
        read = time.perf_counter(), time.process_time()
        size = out.stat().st_size
    (segment,), (ledger,) = recording.segments, recording.ledgers
    s = segment.samples
    tick = (segment.index - segment.index[0]).astype(np.int64) + int(s.enc1[0])
    wrong = np.count_nonzero(s.t_us.astype(np.int64) != START_US + tick * 1000)
    wrong += np.count_nonzero(s.enc1 != tick.astype(np.int32)) + np.count_nonzero(s.enc2 != -s.enc1)
    return {
        "hours": hours,
        "produced": ledger.produced,
        "stored": ledger.stored,
        "lost": ledger.lost,
        "balanced": ledger.balanced,
        "as_live": bool(ledger.stored == live["stored_live"] and ledger.lost_inside == live["lost_live"]),
        "wrong": int(wrong),
        "warnings": len(recording.warnings),
        "gigabytes": round(size / 1e9, 2),
        "wrote_cpu_s": round(written[1] - began[1], 1),
        "read_cpu_s": round(read[1] - written[1], 1),
        "took_s": round(read[0] - began[0], 1),
    }


def main(hours: float = 24.0, *carriers: str) -> None:
    for carrier in carriers or ("serial", "can"):
        save(f"day_file_{carrier}", **run(carrier, hours))


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0, *sys.argv[2:])
