"""Writes the seed corpora of the fuzz targets from the golden session, the message set and the log's layout.

usage: python tests/firmware_fuzz/make_seeds.py
"""

import json
import struct
import zlib
from pathlib import Path

import cantools
from cobs import cobs

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
GOLDEN = HERE.parent / "protocol" / "golden"
DATABASE = cantools.database.load_file(ROOT / "protocol" / "impid.dbc")
SERIAL, CAN, RAW, PERIODS, STALL, MISSED, JUMP, ROOM = range(8)
SET, SAVE, BOOT, PREPARE, CUT, DAMAGE = range(6)
SECTOR_WORDS = 150


def frame_seeds() -> dict[str, bytes]:
    """The first golden frame of each kind, coded and its content; a run, a damaged one, one cut."""
    stream = (GOLDEN / "serial.bin").read_bytes()
    frames = [piece + b"\0" for piece in stream.split(b"\0") if piece]
    kinds = [frame["kind"] for frame in json.loads((GOLDEN / "serial.json").read_text())["frames"]]
    first = {kind: frames[kinds.index(kind)] for kind in sorted(set(kinds))}
    plain = {f"kind-{kind}": frame for kind, frame in first.items()}
    plain["run"] = b"".join(frames[:4])
    plain["damaged"] = frames[1][:60] + b"\x55" + frames[1][61:] + frames[0]
    plain["entered-half-way"] = frames[1][90:] + frames[0]
    sealed = {f"content-{kind}": cobs.decode(frame[:-1])[:-4] for kind, frame in first.items()}
    return {name: b"\0" + data for name, data in plain.items()} | {
        name: b"\1" + data for name, data in sealed.items()
    }


def command(request_id: int, opcode: str, item: int = 0, value: int = 0) -> bytes:
    """The payload of COMMAND, then the age of its arrival, 100 us."""
    fields: dict[str, int | str] = {"request_id": request_id, "opcode": opcode, "item": item, "value": value}
    return bytes(DATABASE.encode_message("COMMAND", fields)) + struct.pack("<H", 100)


def on_can(data: bytes, identifier: int = 0x100, length: int = 8) -> bytes:
    return struct.pack("<BHB", CAN, identifier, length) + data


def update_session() -> bytes:
    """A whole image for the slot that does not run, a word twice, words too many; then half of another."""
    words = [0x20004000, 0x08010000 + 512 + 1, *range(6)]
    begin = command(1, "UPDATE_BEGIN", 0, 4 * len(words))
    writes = [command(2 + n, "UPDATE_WRITE", n, word) for n, word in enumerate(words)]
    checksum = zlib.crc32(struct.pack(f"<{len(words)}I", *words))
    beyond = [command(20 + n, "UPDATE_WRITE", len(words) + n, 1) for n in range(2)]
    end = [*beyond, command(40, "UPDATE_END", 0, checksum), command(41, "UPDATE_CONFIRM")]
    again = [command(50, "UPDATE_BEGIN", 0, 64), command(51, "UPDATE_WRITE", 0, 7), command(52, "UPDATE_END")]
    sent = [begin, *writes[:3], command(30, "UPDATE_WRITE", 2, words[2]), *writes[3:], *end, *again]
    return b"".join(bytes([SERIAL]) + data for data in sent)


def command_seeds() -> dict[str, bytes]:
    """Sessions: as the golden one, a self-test, settings, and everything that a carrier does to a board."""
    head = struct.pack("<BI", 15, 2**32 - 16)
    periods = bytes([PERIODS, 200, 7, 0])
    start, stop = command(10, "START"), command(690, "STOP")
    golden = (GOLDEN / "serial.bin").read_bytes()[:200]
    choices = DATABASE.get_message_by_name("COMMAND").get_signal_by_name("opcode").choices
    every = b"".join(
        bytes([SERIAL]) + command(number, str(name), number % 80, 1) for number, name in choices.items()
    )
    return {
        "golden": head
        + periods
        + bytes([SERIAL])
        + start
        + on_can(command(1010, "START"))
        + periods
        + bytes([SERIAL])
        + command(150, "PING")
        + bytes([SERIAL])
        + command(160, "INFO", 7)
        + bytes([STALL, 150, 3, 4])
        + periods
        + bytes([SERIAL])
        + stop,
        "self-test": head
        + bytes([SERIAL])
        + command(1, "SELF_TEST")
        + periods * 2
        + bytes([ROOM, 1])
        + periods,
        "settings": head
        + bytes([SERIAL])
        + command(1, "SET", 33, 250)
        + bytes([SERIAL])
        + command(2, "SAVE")
        + bytes([SERIAL])
        + command(3, "GET", 33)
        + on_can(command(4, "LOG", 64)),
        "every-opcode": head + every,
        "update": head + update_session(),
        "bench": head
        + bytes([SERIAL])
        + command(1, "BENCH", 105, 2 << 16 | 30)
        + bytes([SERIAL])
        + command(2, "BENCH", 105, 1 << 16 | 30)
        + periods
        + b"".join(bytes([SERIAL]) + command(10 + n, "BENCH", n, 5) for n in range(95, 110))
        + on_can(command(3, "BENCH", 101, 5)),
        "carriers": head
        + bytes([RAW, len(golden)])
        + golden
        + bytes([SERIAL])
        + start
        + bytes([MISSED, 3])
        + periods
        + bytes([ROOM, 3])
        + periods
        + bytes([JUMP, 0, 0, 0, 0x7F])
        + on_can(stop, 0x101)
        + on_can(stop, 0x100, 7),
    }


def snapshot(sequence: int, values: list[int]) -> bytes:
    body = struct.pack("<18I", 2, sequence, *values)
    return body + struct.pack("<I", zlib.crc32(body))


def settings_seeds() -> dict[str, bytes]:
    """A blank flash in use until it is full, one cut off in a save, and images: whole, torn, all zero."""
    change = bytes([SET, 6]) + struct.pack("<I", 8192) + bytes([SAVE])
    values = [3, 1000, 32768, 32768, 12233, 12233, 8192, 8192, *range(8)]
    mark = struct.pack("<I", 0x494D5031)
    image = mark + snapshot(1, values) + snapshot(2, [4, *values[1:]])
    sector = 4 * SECTOR_WORDS
    other = (mark + b"\xff" * sector)[:sector]
    return {
        "full": bytes([0, PREPARE]) + change * 12 + bytes([BOOT, PREPARE]) + change,
        "cut": bytes([0, PREPARE]) + change + bytes([CUT, 30]) + change + bytes([BOOT, PREPARE]) + change,
        "image": b"\x01" + image.ljust(sector, b"\xff") + other + change + bytes([BOOT]),
        "torn": b"\x01"
        + image[:-6].ljust(sector, b"\xff")
        + other
        + bytes([PREPARE])
        + change
        + bytes([BOOT]),
        "damaged": bytes([0, PREPARE]) + change * 2 + bytes([DAMAGE, 20, 0, 0x40, BOOT, PREPARE]) + change,
        "zero": b"\x01" + bytes(2 * sector) + bytes([PREPARE]) + change + bytes([BOOT]),
    }


SEEDS = {"frame": frame_seeds, "command": command_seeds, "settings": settings_seeds}


def main() -> None:
    for target, seeds in SEEDS.items():
        folder = HERE / "seeds" / target
        folder.mkdir(parents=True, exist_ok=True)
        for name, data in seeds().items():
            (folder / name).write_bytes(data)


if __name__ == "__main__":
    main()
