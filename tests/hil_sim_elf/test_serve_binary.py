"""`impid-sim serve --elf` runs the chip, not the native core, and refuses what the chip cannot be told."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import serial
import tomli_w

from hil_sim.board import layout
from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.wire import FrameReader, command
from hil_sim.scenarios.load import SHIPPED

SERVE = [sys.executable, "-c", "from hil_sim.cli import main; main()", "serve"]


def test_the_status_is_that_of_the_chip(firmware: Path) -> None:
    serve = subprocess.Popen(
        [*SERVE, "first-light", "--speed", "0.5", "--elf", str(firmware)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert serve.stdout is not None
        port = json.loads(serve.stdout.readline())["port"]
        reader, statuses = FrameReader(), []
        with serial.Serial(port, 921600, timeout=0.05) as line:
            for _ in range(200):
                kind = layout.code("BATCH", "kind", "STATUS")
                statuses += [frame for frame in reader.feed(line.read(4096)) if frame.kind == kind]
                if statuses:
                    break
    finally:
        serve.terminate()
        serve.wait(timeout=20)
    health = np.frombuffer(statuses[0].records[40:48], np.uint8).reshape(1, 8)
    source = layout.unpack("STATUS_HEALTH", health)["clock_source"][0]
    assert source == layout.code("STATUS_HEALTH", "clock_source", "HSE")


def test_resets_from_outside_are_refused_with_one_line(firmware: Path, tmp_path: Path) -> None:
    content = tomllib.loads((SHIPPED / "first-light.toml").read_text(encoding="utf-8"))
    content["faults"] = [{"kind": "brown_out", "at_s": 1.0, "duration_s": 0.5}]
    path = tmp_path / "brown.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    done = subprocess.run(
        [*SERVE, str(path), "--elf", str(firmware)], capture_output=True, text=True, check=False, timeout=180
    )
    assert done.returncode == 1
    assert (
        done.stderr == "impid-sim: fault brown_out: the emulated chip has no such input; leave --elf away\n"
    )


def test_the_answer_to_reset_is_on_the_wire_before_the_chip_resets(firmware: Path) -> None:
    board = ElfBoard(firmware)
    rest = np.full((20, 8, 2), 2048, dtype=np.uint16), np.zeros((20, 2), dtype=np.int32)
    board.run(*rest)
    board.serial_receive(command(5, "RESET"), board.now_us)
    board.run(*rest)
    assert board.reset_requested
    kinds = [frame.kind for frame in FrameReader().feed(board.serial_take())]
    assert layout.code("BATCH", "kind", "RESPONSE") in kinds
