"""The shipping binary in the emulator: speed against real time, instructions per 1 kHz tick.

    .venv/bin/python bench/elf_speed.py [firmware.elf] [seconds]

Build the binary first (`make firmware`). One line per carrier: streaming over the serial line, then over CAN.
"""

import sys
import time
from pathlib import Path

import numpy as np

from hil_sim.board import layout
from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.budget import TickCounter
from hil_sim.board.wire import FrameReader, accepts_start, command

ROOT = Path(__file__).resolve().parents[1]
DEFAULT = ROOT / ".pio" / "build" / "nucleo_f446re" / "firmware.elf"
BLOCK = 100


def readings(ticks: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Noise on both axes, an encoder that turns."""
    adc = rng.integers(1500, 2600, (ticks, 8, 2), dtype=np.uint16)
    return adc, np.cumsum(rng.integers(-40, 41, (ticks, 2)), axis=0).astype(np.int32)


def speed(binary: Path, carrier: str, seconds: float) -> tuple[float, float, object]:
    """Streams for so many simulated seconds, then counts instructions for a tenth of that.

    Returns:
        Times real time by the wall, by processor time, and the count.
    """
    rng = np.random.default_rng(2)
    board = ElfBoard(binary)
    counter = TickCounter(board)
    counter.run(*readings(BLOCK, rng))
    if carrier == "serial":
        board.serial_receive(command(1, "START"), board.now_us)
    else:
        start = {"request_id": 1, "opcode": layout.code("COMMAND", "opcode", "START"), "item": 0, "value": 0}
        board.can_receive(
            0x100, layout.database().encode_message("COMMAND", start, scaling=False), board.now_us
        )
    counter.run(*readings(BLOCK, rng))
    reader = FrameReader()
    answered = any(accepts_start(frame) for frame in reader.feed(board.serial_take()))
    if not answered and not board.can_take():
        raise SystemExit(f"{binary}: START over {carrier} was not answered")
    counter.stop()
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(round(seconds * 1000 / BLOCK)):
        board.run(*readings(BLOCK, rng))
        board.serial_take()
        board.can_take()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    counter.start()
    for _ in range(round(seconds * 100 / BLOCK)):
        counter.run(*readings(BLOCK, rng))
    return seconds / wall, seconds / cpu, counter.result()


if __name__ == "__main__":
    image = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT
    length = float(sys.argv[2]) if len(sys.argv) > 2 else 20.0
    for name in ("serial", "can"):
        by_wall, by_processor, count = speed(image, name, length)
        print(f"{name}: {by_wall:.2f} x real time ({by_processor:.2f} x by processor time); {count}")
