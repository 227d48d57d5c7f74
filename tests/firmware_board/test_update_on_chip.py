"""A firmware update on the emulated chip, by the host's own client, and what can go wrong on the way."""

import base64
import json
import struct
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path

import pytest
from impid_host.errors import LinkError
from impid_host.link.client import BoardClient
from impid_host.link.update import FirmwareFile, read_firmware, update
from impid_host.wire.carrier import CAN, SERIAL, Carrier

from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.flash import Cut
from tests.hil_sim_elf.chip_link import ChipLink

ROOT = Path(__file__).resolve().parents[2]
BUILT = ROOT / ".pio" / "build" / "nucleo_f446re"
SLOTS = (0x10000, 0x20000)
# An instruction that branches to itself (Armv7-M A7.7.12).
HANG = b"\xfe\xe7"


@pytest.fixture(scope="module", autouse=True)
def built() -> None:
    subprocess.run(["scripts/pio.sh", "run", "--silent", "-e", "nucleo_f446re"], cwd=ROOT, check=True)


@pytest.fixture
def firmware() -> FirmwareFile:
    return read_firmware(BUILT / "firmware.impid")


def client(board: ElfBoard, carrier: Carrier = SERIAL) -> BoardClient:
    return BoardClient(ChipLink(board, carrier))


def slot_of(board: ElfBoard) -> int:
    """The slot whose image runs: where the processor takes its vectors from."""
    return 0 if board.soc.scb.value["VTOR"] < 0x08020000 else 1


def nothing(_done: int, _total: int) -> None:
    pass


def with_image(firmware: FirmwareFile, slot: int, image: bytes) -> FirmwareFile:
    images = tuple(image if n == slot else old for n, old in enumerate(firmware.images))
    return replace(firmware, images=images)


def hanging(image: bytes) -> bytes:
    """The same image, but it hangs from its first instruction on."""
    (start,) = struct.unpack_from("<I", image, 4)
    at = start - 1 - 0x08020200
    return image[:at] + HANG + image[at + 2 :]


def test_an_update_goes_to_the_other_slot_and_stays(firmware: FirmwareFile) -> None:
    board = ElfBoard(BUILT / "firmware.elf")
    host = client(board)
    host.store({"ACCEL_X_ZERO": 32123})
    before = host.settings()["boot_count"]
    heard: list[int] = []
    now = update(host, firmware, lambda done, _total: heard.append(done))
    assert heard[-1] == len(firmware.images[1])
    assert (now.update_slot, now.update_pending) == (0, 0)
    assert slot_of(board) == 1
    host.restart()
    assert slot_of(board) == 1, "for good"
    settings = host.settings()
    assert (settings["accel_x_zero"], settings["boot_count"]) == (32123, before + 2), "settings stay"


def lay(board: ElfBoard, image: bytes) -> None:
    """The image in the second slot as an update leaves it: newer than what runs, and not tried."""
    header = struct.pack("<4I", 0x31544C53, len(image), zlib.crc32(image), 2)
    flash = board.soc.memory.flash
    flash[SLOTS[1] : SLOTS[1] + 0x200] = header.ljust(0x200, b"\xff")
    flash[SLOTS[1] + 0x200 : SLOTS[1] + 0x200 + len(image)] = image


def test_an_image_that_nobody_confirms_is_gone_with_the_next_reset(firmware: FirmwareFile) -> None:
    board = ElfBoard(BUILT / "firmware.elf")
    host = client(board)
    boots = host.settings()["boot_count"]
    lay(board, firmware.images[1])
    host.restart()
    assert slot_of(board) == 1
    assert host.info().update_pending == 1
    with pytest.raises(LinkError, match="on trial"):
        update(host, firmware, nothing)
    host.restart()
    assert slot_of(board) == 0
    assert host.settings()["boot_count"] == boots + 2


def stage(host: BoardClient, firmware: FirmwareFile) -> None:
    """All of an update but the restart."""

    class Stop(Exception):
        pass

    def stop() -> tuple[int, int]:
        raise Stop

    restart, host.restart = host.restart, stop  # type: ignore[method-assign]
    with pytest.raises(Stop):
        update(host, firmware, nothing)
    host.restart = restart  # type: ignore[method-assign]


def test_an_image_that_hangs_is_reset_by_the_watchdog_and_the_old_one_runs_again(
    firmware: FirmwareFile,
) -> None:
    board = ElfBoard(BUILT / "firmware.elf")
    link = ChipLink(board)
    host = BoardClient(link)
    lay(board, hanging(firmware.images[1]))
    link.boots = False
    host.request("RESET")
    link.receive(0.0)
    assert board.reset_requested
    board.soc.in_reset = False
    board.soc.run_for(6.0)  # the new image hangs, until the watchdog resets the chip once more
    assert board.reset_requested
    assert board.soc.schedule.seconds() > 4.0
    board.reboot()
    assert slot_of(board) == 0
    assert client(board).info().update_pending == 0


def test_the_bus_carries_an_update_as_well(firmware: FirmwareFile) -> None:
    """All but the restart, of an image that is only long enough to be accepted."""
    board = ElfBoard(BUILT / "firmware.elf")
    stage(client(board, CAN), with_image(firmware, 1, short_image(firmware, 300)))
    flash = bytes(board.soc.memory.flash)
    assert flash[SLOTS[1] + 0x200 :][:1200] == short_image(firmware, 300)
    assert struct.unpack_from("<4I", flash, SLOTS[1])[::3] == (0x31544C53, 2)


def short_image(firmware: FirmwareFile, words: int) -> bytes:
    """Its first words, starting within themselves."""
    image = firmware.images[1][: 4 * words]
    return image[:4] + struct.pack("<I", 0x08020200 + 0x101) + image[8:]


def test_an_image_for_another_board_or_another_slot_is_refused(firmware: FirmwareFile) -> None:
    board = ElfBoard(BUILT / "firmware.elf")
    host = client(board)
    with pytest.raises(LinkError, match="the board is of another kind"):
        update(host, replace(firmware, board="custom_f446re"), nothing)
    short = firmware.images[0][:512]
    with pytest.raises(LinkError, match="UPDATE_END"):
        update(host, with_image(firmware, 1, short), nothing)
    host.restart()
    assert slot_of(board) == 0


@pytest.mark.parametrize(
    ("operations", "bytes_kept"), [(0, 2), (1, 700), (2, 1), (70, 3), (129, 0), (130, 2), (133, 3)]
)
def test_a_power_cut_leaves_a_board_that_boots(
    firmware: FirmwareFile, operations: int, bytes_kept: int
) -> None:
    """The mark is cleared, the slot erased, 128 words and four words of header are written."""
    board = ElfBoard(BUILT / "firmware.elf")
    host = client(board)
    board.soc.flash.cut = Cut(operations, bytes_kept)
    with pytest.raises(LinkError, match="the port is gone"):
        stage(host, with_image(firmware, 1, short_image(firmware, 128)))
    board.soc.flash.cut = None
    again = ElfBoard(board.soc.memory)
    assert slot_of(again) == 0
    assert client(again).info().update_slot == 1


def test_a_probe_that_flashes_voids_the_update_in_the_other_slot() -> None:
    """What the linked file lays over the second slot's header leaves nothing that is newer than itself."""
    board = ElfBoard(BUILT / "firmware.elf")
    flash = bytes(board.soc.memory.flash)
    assert flash[SLOTS[1] : SLOTS[1] + 4] == b"\0\0\0\0"


def test_files_that_are_no_firmware_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "firmware.impid"
    good = json.loads((BUILT / "firmware.impid").read_text())
    image = good["images"][0]
    damaged = base64.b64encode(b"\0\0\0\0").decode()
    cases: list[tuple[str, str]] = [
        ("", "no firmware"),
        ("[1]", "no firmware"),
        ('{"a": 1}', "no firmware"),
        (json.dumps(good | {"impid_firmware": 2}), "later format"),
        (json.dumps({"impid_firmware": 1}), "incomplete"),
        (json.dumps(good | {"images": [image | {"data": damaged}]}), "slot 0 is damaged"),
        (json.dumps(good | {"images": [image | {"data": "?"}]}), "incomplete"),
    ]
    for text, message in cases:
        path.write_text(text)
        with pytest.raises(Exception, match=message):
            read_firmware(path)
    with pytest.raises(Exception, match="cannot be read"):
        read_firmware(tmp_path / "none")
    path.write_text(json.dumps(good))
    assert zlib.crc32(read_firmware(path).images[0]) == image["crc32"]
