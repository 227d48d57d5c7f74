"""The native board keeps settings as the shipping binary does: same commands, same answers, byte for byte."""

from pathlib import Path

import numpy as np

from hil_sim.board import layout
from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.native import BoardConfig, NativeBoard
from hil_sim.board.wire import FrameReader, command

BOOT_COUNT, CAN_KBPS, X_PER_G, CPR_1, AFTER_LAST = 32, 33, 36, 38, 40
FIRST_LOG_WORD, AFTER_LOG = 64, 75
REQUESTS = [
    *(("GET", item, 0) for item in range(BOOT_COUNT - 1, AFTER_LAST + 1)),
    ("SET", BOOT_COUNT, 7),
    ("SET", CAN_KBPS, 500),
    ("SET", CAN_KBPS, 333),
    ("SET", X_PER_G, 999),
    ("SET", X_PER_G, 12000),
    ("SET", CPR_1, 0xFFFFFFFF),
    ("SET", AFTER_LAST, 1),
    ("SAVE", 0, 0),
    *(("GET", item, 0) for item in range(BOOT_COUNT, AFTER_LAST)),
    *(("LOG", item, 0) for item in range(FIRST_LOG_WORD - 1, AFTER_LOG + 1)),
]


def test_settings_and_log_are_answered_alike(firmware: Path) -> None:
    binary = ElfBoard(firmware)
    native = NativeBoard(BoardConfig(start_us=binary.next_tick_us))
    response = layout.code("BATCH", "kind", "RESPONSE")
    answers: list[list[bytes]] = []
    for board in (native, binary):
        reader, got = FrameReader(), []
        for number, (opcode, item, value) in enumerate(REQUESTS, start=1):
            board.run(np.full((5, 8, 2), 2048, np.uint16), np.zeros((5, 2), np.int32))
            board.serial_receive(command(number, opcode, item=item, value=value), board.now_us)
            got += [frame.records for frame in reader.feed(board.serial_take()) if frame.kind == response]
        board.run(np.full((5, 8, 2), 2048, np.uint16), np.zeros((5, 2), np.int32))
        got += [frame.records for frame in reader.feed(board.serial_take()) if frame.kind == response]
        answers.append(got)
    assert len(answers[0]) == len(REQUESTS)
    assert answers[0] == answers[1]
    results = {record[3] for record in answers[0]}
    assert {layout.code("RESPONSE", "result", name) for name in ("OK", "BAD_ITEM", "BAD_VALUE")} == results
