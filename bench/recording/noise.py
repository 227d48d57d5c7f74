"""10^8 damaged bytes through the decoder, and commands as damaged through the board's parser.

Every frame of a stream is damaged with even odds by one of: flipped bits, bytes put in, bytes taken out, its
tail cut off and spliced to the next. Whatever the decoder accepts must be a sample that the board sent.
Frames that no damage touched must all be accepted: the reader is back in step within one frame.
"""

import sys
import time

import numpy as np
from common import save
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.frame import encode_command
from impid_host.wire.messages import ITEM, OPCODE

from hil_sim.board.native import BoardConfig, NativeBoard

PIECE = 2000  # ticks
COMMANDS = 2000


def damage(rng: np.random.Generator, frame: bytearray, kind: int) -> bytearray:
    """One frame, its delimiter included, after an accident."""
    at = int(rng.integers(0, len(frame)))
    if kind == 0:
        for _ in range(int(rng.integers(1, 4))):
            frame[int(rng.integers(0, len(frame)))] ^= 1 << int(rng.integers(0, 8))
    elif kind == 1:
        frame[at:at] = rng.bytes(int(rng.integers(1, 6)))
    elif kind == 2:
        del frame[at : at + int(rng.integers(1, 6))]
    else:
        del frame[at:]
    return frame


def decoder_part(total: int) -> dict[str, int | float]:
    rng = np.random.default_rng(5)
    board, decoder = NativeBoard(BoardConfig(boot_id=9, serial_bytes_per_ms=0)), SerialDecoder()
    board.serial_receive(b"\0" + encode_command(1, OPCODE["START"]), board.now_us)
    adc = np.full((PIECE, 8, 2), 2048, dtype=np.uint16)
    fed = damaged = untouched = accepted = wrong = ticks = 0
    spoilt = False  # the frame before has lost its delimiter
    began = time.perf_counter()
    while fed < total:
        counts = np.arange(ticks, ticks + PIECE, dtype=np.int64).astype(np.int32)
        board.run(adc, np.column_stack([counts, -counts]))
        ticks += PIECE
        stream = bytearray()
        for frame in board.serial_take().split(b"\0")[:-1]:
            piece = bytearray(frame + b"\0")
            if rng.random() < 0.5:
                piece = damage(rng, piece, int(rng.integers(0, 4)))
                damaged += 1
                spoilt = not piece.endswith(b"\0")
            else:
                untouched += not spoilt
                spoilt = False
            stream += piece
        fed += len(stream)
        for segment in decoder.feed(bytes(stream)).segments:
            s = segment.samples
            accepted += len(s)
            tick = s.enc1.astype(np.int64)
            wrong += int(
                np.count_nonzero(
                    (s.t_us.astype(np.int64) != tick * 1000)
                    | (s.enc2 != -s.enc1)
                    | (np.diff(segment.index.astype(np.int64), prepend=int(segment.index[0]) - 1) < 1)
                )
            )
    counts_ = decoder.counts
    return {
        "bytes": fed,
        "frames_damaged": damaged,
        "frames_untouched": untouched,
        "frames_accepted": counts_.good_frames,
        "untouched_but_refused": max(0, untouched - counts_.good_frames),
        "samples_accepted": accepted,
        "wrong": wrong,
        "took_s": round(time.perf_counter() - began, 1),
    }


def parser_part(total: int) -> dict[str, int | float]:
    """Commands as damaged, in pieces of 2000: what is answered must have been asked, and all that was whole is.

    Every command begins with a delimiter, as the host sends it, so a damaged one cannot take the next along.
    """
    rng = np.random.default_rng(6)
    board, decoder = NativeBoard(BoardConfig(boot_id=9, serial_bytes_per_ms=0)), SerialDecoder()
    adc, still = np.full((1, 8, 2), 2048, dtype=np.uint16), np.zeros((1, 2), dtype=np.int32)
    intact = [b"\0" + encode_command(number, OPCODE["INFO"], ITEM["BOOT_ID"]) for number in range(1 << 16)]
    fed = number = asked = answered = foreign = unanswered = undone = 0
    began = time.perf_counter()
    while fed < total:
        pieces, whole = [], []
        damaged = rng.random(COMMANDS) < 0.75
        for spoil in damaged.tolist():
            number = (number + 1) % (1 << 16)
            if spoil:
                pieces.append(bytes(damage(rng, bytearray(intact[number]), int(rng.integers(0, 4)))))
            else:
                pieces.append(intact[number])
                whole.append(number)
        stream = b"".join(pieces)
        fed += len(stream)
        asked += len(whole)
        board.serial_receive(stream, board.now_us)
        board.run(adc, still)
        answers = list(decoder.feed(board.serial_take()).responses)
        answered += len(answers)
        ours = {(number - n) % (1 << 16) for n in range(COMMANDS + 1)}  # one may end with the next piece
        told = [r.request_id for r in answers]
        foreign += sum(
            r.opcode != OPCODE["INFO"] or r.result != 0 or r.value != 9 or r.request_id not in ours
            for r in answers
        )
        missing = set(whole) - set(told)
        unanswered += len(missing)
        undone += len(told) - (len(whole) - len(missing))
    return {
        "bytes": fed,
        "intact_commands": asked,
        "answers": answered,
        "unanswered": unanswered,
        "of_damage_undone": undone,
        "foreign_answers": foreign,
        "bad_frames_of_the_board": decoder.counts.bad_frames,
        "took_s": round(time.perf_counter() - began, 1),
    }


def main(total: int = 100_000_000) -> None:
    save("noise", decoder=decoder_part(total), parser=parser_part(total))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
