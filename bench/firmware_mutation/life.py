"""Checks of a board's life: which of its two images a boot takes, how a new one comes in, settings of before."""

import re
import struct
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from impid_host.link.update import read_firmware
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.messages import RESULT

from firmware_mutation.session import Session
from hil_sim.board.elf.errors import PowerCut
from hil_sim.board.elf.flash import Cut
from hil_sim.board.elf.image import flash
from hil_sim.board.elf.memory import Memory
from hil_sim.board.elf.wiring import Wiring

SLOTS, HEADER = (0x10000, 0x20000), 0x200
FLASH_BASE = 0x0800_0000
MARK, UNWRITTEN = 0x31544C53, 0xFFFF_FFFF
AT_MARK, AT_BYTES, AT_TRIED, AT_CONFIRMED = 0, 4, 16, 20
HANG = b"\xfe\xe7"  # an instruction that branches to itself (Armv7-M A7.7.12)
SETTINGS = (0x8000, 0xC000)
LAYOUTS = Path(__file__).resolve().parents[2] / "tests/firmware/test_settings_migration/earlier_layouts.h"


def second_image(image: Path) -> bytes:
    """The same firmware, linked for slot 1."""
    return read_firmware(image.with_name("firmware.impid")).images[1]


def lay(memory: Memory, slot: int, content: bytes, sequence: int) -> None:
    """An image as an update leaves it: whole, and not tried."""
    start = SLOTS[slot]
    header = struct.pack("<4I", MARK, len(content), zlib.crc32(content), sequence)
    memory.flash[start : start + HEADER] = header.ljust(HEADER, b"\xff")
    memory.flash[start + HEADER : start + HEADER + len(content)] = content


def word(memory: Memory, offset: int) -> int:
    return int(struct.unpack_from("<I", memory.flash, offset)[0])


def put(memory: Memory, offset: int, value: int) -> None:
    struct.pack_into("<I", memory.flash, offset, value)


def running(session: Session) -> int:
    """The slot whose vectors the processor uses."""
    return int(session.board.soc.scb.value["VTOR"] >= FLASH_BASE + SLOTS[1])


def restart(session: Session) -> int:
    """The slot that the next boot takes."""
    session.board.soc.request_reset("pin")
    session.reset_cause()
    return running(session)


def tries_a_new_image_once(image: Path, wiring: Wiring) -> None:
    """The newer one runs, and is gone with the next reset unless it was confirmed."""
    memory = flash(image)
    assert word(memory, SLOTS[1] + AT_MARK) == 0, "flashing leaves an update in the other slot"
    lay(memory, 1, second_image(image), 2)
    session = Session(memory, wiring)
    assert running(session) == 1, "the newer image is not taken"
    assert (session.ask("INFO", "UPDATE_PENDING"), session.ask("INFO", "UPDATE_SLOT")) == (1, 0), "on trial"
    assert restart(session) == 0, "on trial for ever"
    assert session.ask("INFO", "UPDATE_PENDING") == 0, "what was flashed is on trial"
    lay(memory, 1, second_image(image), 2)
    session = Session(memory, wiring)
    session.ask("UPDATE_CONFIRM")
    assert session.ask("INFO", "UPDATE_PENDING") == 0, "confirmed, and on trial"
    assert restart(session) == 1, "what was confirmed is gone"
    lay(memory, 0, read_firmware(image.with_name("firmware.impid")).images[0], 3)
    assert restart(session) == 0, "the older image is taken"


def starts_no_damaged_image(image: Path, wiring: Wiring) -> None:
    """Whatever is wrong with the newer image, the other one runs; a failed one only if it is alone."""
    content = second_image(image)
    damages: dict[str, Callable[[Memory], None]] = {
        "its last byte": lambda m: m.flash.__setitem__(SLOTS[1] + HEADER + len(content) - 1, 0x5A),
        "no mark": lambda m: put(m, SLOTS[1] + AT_MARK, 0),
        "no length": lambda m: m.flash.__setitem__(
            slice(SLOTS[1] + AT_BYTES, SLOTS[1] + AT_BYTES + 8), bytes(8)
        ),
        "tried before": lambda m: put(m, SLOTS[1] + AT_TRIED, 0),
    }
    for what, damage in damages.items():
        memory = flash(image)
        lay(memory, 1, content, 2)
        damage(memory)
        assert running(Session(memory, wiring)) == 0, f"starts an image with {what}"
    memory = flash(image)
    lay(memory, 1, content, 2)
    put(memory, SLOTS[1] + AT_TRIED, 0)
    put(memory, SLOTS[0] + AT_MARK, 0)
    assert running(Session(memory, wiring)) == 1, "the only image is not started"


def outlives_an_image_that_hangs(image: Path, wiring: Wiring) -> None:
    """The watchdog runs from the loader on."""
    content = second_image(image)
    (start,) = struct.unpack_from("<I", content, 4)
    at = start - 1 - (FLASH_BASE + SLOTS[1] + HEADER)
    session = Session(image, wiring)
    lay(session.board.soc.memory, 1, content[:at] + HANG + content[at + 2 :], 2)
    session.board.soc.request_reset("pin")
    session.run(5)
    session.board.soc.in_reset = False
    session.board.soc.run_for(6.0)
    assert session.board.reset_requested, "an image that hangs is not reset"
    session.reset_cause()
    assert running(session) == 0, "an image that hangs is started again"


def answer(session: Session, opcode: str, item: int = 0, value: int = 0) -> str:
    """The result of a command, by name; waits for an erase."""
    frame = session.command(opcode, item, value)
    session.board.serial_take()
    session.board.serial_receive(frame, session.board.now_us + 50)
    decoder = SerialDecoder()
    for _ in range(250):
        session.run(10)
        for told in decoder.feed(session.board.serial_take()).responses:
            return next(name for name, number in RESULT.items() if number == told.result)
    return "no answer"


def takes_an_update(image: Path, wiring: Wiring) -> None:
    """Word by word into the other slot, and nothing of it counts before all of it is right."""
    session = Session(image, wiring)
    memory = session.board.soc.memory
    slot_0 = bytes(memory.flash[SLOTS[0] : SLOTS[1]])
    words = [
        0x2000_4000,
        FLASH_BASE + SLOTS[1] + HEADER + 0x101,
        *(0x9E37_79B1 * n % 2**32 for n in range(300)),
    ]
    content = struct.pack(f"<{len(words)}I", *words)

    def expect(result: str, opcode: str, item: int = 0, value: int = 0) -> None:
        told = answer(session, opcode, item, value)
        assert told == result, f"{opcode} {item}: {told} for {result}"

    session.ask("START")
    expect("BUSY", "UPDATE_BEGIN", 0, len(content))
    session.ask("STOP")
    for length in (0, 6, 64 * 1024 - HEADER + 4):
        expect("BAD_VALUE", "UPDATE_BEGIN", 0, length)
    expect("BAD_ITEM", "UPDATE_WRITE", 0, 1)
    for wrong in (True, False):  # first an image that is linked for the slot that runs
        sent = [words[0], FLASH_BASE + SLOTS[0] + HEADER + 0x101, *words[2:]] if wrong else words
        expect("OK", "UPDATE_BEGIN", 0, len(content))
        erased = memory.flash[SLOTS[1] : SLOTS[1] + HEADER + len(content)]
        assert set(bytes(erased)) == {0xFF}, "the slot is not erased"
        for number, value in enumerate(sent):
            if number in (5, 258):
                expect("BAD_ITEM", "UPDATE_WRITE", number + 1 & 0xFF, value)
                expect("OK", "UPDATE_WRITE", number - 1 & 0xFF, sent[number - 1])
                so_far = struct.pack(f"<{number}I", *sent[:number])
                expect("BAD_ITEM", "UPDATE_END", 0, zlib.crc32(so_far))
            session.ask("UPDATE_WRITE", number & 0xFF, value)
        expect("BAD_ITEM", "UPDATE_WRITE", len(words) & 0xFF, 7)
        checksum = zlib.crc32(struct.pack(f"<{len(sent)}I", *sent))
        expect("BAD_VALUE", "UPDATE_END", 0, checksum ^ 1)
        expect("BAD_VALUE" if wrong else "OK", "UPDATE_END", 0, checksum)
        assert (word(memory, SLOTS[1]) == MARK) is not wrong, "marked"
    expect("OK", "UPDATE_END", 0, zlib.crc32(content))
    header = struct.unpack_from("<6I", memory.flash, SLOTS[1])
    assert header == (MARK, len(content), zlib.crc32(content), 2, UNWRITTEN, UNWRITTEN), "header"
    assert bytes(memory.flash[SLOTS[1] + HEADER :][: len(content)]) == content, "image"
    assert bytes(memory.flash[SLOTS[0] : SLOTS[1]]) == slot_0, "the slot that runs was touched"


def loses_power_at_the_end_of_an_update(image: Path, wiring: Wiring) -> None:
    """An update counts from the last word of its header on, and not before."""
    words = [0x2000_4000, FLASH_BASE + SLOTS[1] + HEADER + 0x21, *range(20)]
    for written in range(4):
        session = Session(image, wiring)
        assert answer(session, "UPDATE_BEGIN", 0, 4 * len(words)) == "OK", "UPDATE_BEGIN"
        for number, value in enumerate(words):
            session.ask("UPDATE_WRITE", number, value)
        session.board.soc.flash.cut = Cut(written, 0)
        with suppress(PowerCut):
            answer(session, "UPDATE_END", 0, zlib.crc32(struct.pack(f"<{len(words)}I", *words)))
        session.board.soc.flash.cut = None
        assert running(Session(session.board.soc.memory, wiring)) == 0, f"{written} words of a header count"


def told_by_earlier_firmware(item: int) -> int:
    """As tests/firmware/test_settings_migration has it."""
    return 500 if item == 1 else 32100 + item if item < 4 else 12000 + item if item < 6 else 1000 + item


def left_behind(layout: int) -> tuple[list[bytes], int]:
    """Both sectors as firmware of that layout left them, and its boots."""
    text = LAYOUTS.read_text(encoding="utf-8")
    sectors = []
    for sector in (0, 1):
        body = re.search(rf"layout_{layout}_sector_{sector}\[\] = {{(.*?)}};", text, re.DOTALL)
        assert body is not None
        words = [int(w, 16) for w in re.findall(r"0x([0-9A-F]+)u", body[1])]
        sectors.append(struct.pack(f"<{len(words)}I", *words))
    boots = re.search(rf"LAYOUT_{layout}_BOOTS (\d+)u", text)
    assert boots is not None
    return sectors, int(boots[1])


def keeps_settings_of_earlier_firmware(image: Path, wiring: Wiring) -> None:
    """Values and boot count of every layout, before and after a save of this one; new values get defaults."""
    for layout, held in ((1, 8), (2, 16)):
        memory = flash(image)
        sectors, boots = left_behind(layout)
        for start, content in zip(SETTINGS, sectors, strict=True):
            memory.flash[start : start + len(content)] = content
        session = Session(memory, wiring)
        for boot in (1, 2, 3):
            values = [session.ask("GET", 32 + item) for item in range(21)]
            assert values[0] == boots + boot, f"layout {layout}: boot {values[0]}"
            assert values[1:held] == [told_by_earlier_firmware(item) for item in range(1, held)], "values"
            assert values[16:21] == [0, 0, 1, 1, 1], "defaults"
            if held == 8:
                assert values[8:16] == [0] * 8, "defaults"
            restart(session)


def snapshot(sequence: int, values: list[int], held: int) -> bytes:
    """Of layout 3: number of values above the layout, room for 45, checksum."""
    words = [3 | held << 16, sequence, *values, *[UNWRITTEN] * (45 - len(values))]
    body = struct.pack("<47I", *words)
    return body + struct.pack("<I", zlib.crc32(body))


def newest(memory: Memory) -> list[int]:
    """The values of the newest whole snapshot of layout 3."""
    found: list[tuple[int, list[int]]] = [(0, [])]
    for start in SETTINGS:
        for place in range(85):
            content = bytes(memory.flash[start + 4 + 192 * place :][:192])
            words = struct.unpack("<48I", content)
            if words[0] & 0xFFFF == 3 and zlib.crc32(content[:188]) == words[47]:
                found.append((words[1], list(words[2 : 2 + (words[0] >> 16)])))
    return max(found)[1]


def keeps_settings_of_other_firmware(image: Path, wiring: Wiring) -> None:
    """Of a later one: values that this one does not know. Of an earlier one: defaults for what it lacked."""
    known = [5, 250, 32001, 32002, 12001, 12002, 77, 78, *range(100, 108), 1, 1, 0, 0, 0]
    memory = flash(image)
    content = struct.pack("<I", 0x494D5031) + snapshot(9, [*known, 4711, 4712, 4713], 24)
    memory.flash[SETTINGS[1] : SETTINGS[1] + len(content)] = content
    session = Session(memory, wiring)
    assert session.ask("GET", "ENCODER_1_CPR") == 77, "values"
    session.ask("SET", "ENCODER_1_CPR", 99)
    session.ask("SAVE")
    assert newest(memory) == [6, *known[1:6], 99, *known[7:], 4711, 4712, 4713], "a later firmware's values"
    memory = flash(image)
    content = struct.pack("<I", 0x494D5031) + snapshot(9, known[:16], 16)
    memory.flash[SETTINGS[0] : SETTINGS[0] + len(content)] = content
    session = Session(memory, wiring)
    values = [session.ask("GET", 32 + item) for item in range(21)]
    assert values == [6, *known[1:16], 0, 0, 1, 1, 1], "defaults"


LIFE = (
    tries_a_new_image_once,
    starts_no_damaged_image,
    outlives_an_image_that_hangs,
    takes_an_update,
    loses_power_at_the_end_of_an_update,
    keeps_settings_of_earlier_firmware,
    keeps_settings_of_other_firmware,
)
