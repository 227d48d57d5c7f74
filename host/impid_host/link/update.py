"""A new firmware for the board, over the link that it already has.

The board runs from one of two slots and takes the update into the other; each slot needs its own image,
since the code is linked for where it lies. The board tries the new image once, after the next reset. It stays
only if it is then told to. Otherwise the reset after that brings the one before back: an image that does not
come up, or that cannot be talked to, costs a power cycle and no more.
"""

import base64
import binascii
import json
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from impid_host.errors import InputError, LinkError
from impid_host.link.board_info import BoardInfo
from impid_host.link.client import BoardClient
from impid_host.wire.messages import RESULT, RESULT_NAME

_FORMAT = 1
_NO_SLOTS = 2
# Words asked for at once: the board's line holds seven commands while it is busy.
_WINDOW = 4
_STALLED_ROUNDS = 20
# The board stands still while it erases, for up to two seconds.
_ERASE_TRIES = 12
_REMEDY = "give the firmware.impid that `pio run` has written beside firmware.elf"


@dataclass(frozen=True, slots=True)
class FirmwareFile:
    """What `pio run` makes for a board of one kind.

    Attributes:
        board: name of the kind of board, its folder in firmware/boards.
        commit: first eight digits of the commit's hash; None if the build did not know.
        modified: the sources differed from that commit.
        images: one for each slot.
    """

    board: str
    commit: str | None
    modified: bool
    images: tuple[bytes, ...]

    @property
    def board_id(self) -> int:
        """As INFO BOARD_ID: CRC-32 of the board's name."""
        return zlib.crc32(self.board.encode())


def read_firmware(path: Path) -> FirmwareFile:
    """Read an update file.

    Raises:
        InputError: it cannot be read, is none, or is damaged.
    """
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the name") from None
    except ValueError:
        raise InputError(path, "is no firmware for an update", _REMEDY) from None
    if not isinstance(told, dict) or "impid_firmware" not in told:
        raise InputError(path, "is no firmware for an update", _REMEDY)
    if told["impid_firmware"] != _FORMAT:
        raise InputError(path, "is of a later format", "update impid-host")
    try:
        images = tuple(
            _image(path, entry) for entry in sorted(told["images"], key=lambda entry: entry["slot"])
        )
        return FirmwareFile(str(told["board"]), told["commit"], bool(told["modified"]), images)
    except (KeyError, TypeError, binascii.Error):
        raise InputError(path, "is incomplete", _REMEDY) from None


def _image(path: Path, entry: dict[str, Any]) -> bytes:
    data = base64.b64decode(entry["data"], validate=True)
    if zlib.crc32(data) != entry["crc32"] or len(data) % 4 or not data:
        raise InputError(path, f"the image for slot {entry['slot']} is damaged", _REMEDY)
    return data


def update(client: BoardClient, firmware: FirmwareFile, progress: Callable[[int, int], None]) -> BoardInfo:
    """Send it, restart the board, and keep it if it answers; `progress` hears bytes sent and bytes in all.

    Raises:
        LinkError: another kind of board, one without slots, a refusal, no answer, or the board came back with
            the firmware that it had.
    """
    slot = _slot_for(client, firmware)
    image = firmware.images[slot]
    client.request("UPDATE_BEGIN", value=len(image), tries=_ERASE_TRIES)
    _send_words(client, [word for (word,) in struct.iter_unpack("<I", image)], progress)
    client.request("UPDATE_END", value=zlib.crc32(image))
    client.restart()
    now = client.info()
    if now.update_slot == slot:
        raise LinkError(
            f"{client.name}: the board came back with the firmware that it had: the new one did not start; "
            "nothing is lost, and the old one records as before"
        )
    client.request("UPDATE_CONFIRM")
    return client.info()


def _slot_for(client: BoardClient, firmware: FirmwareFile) -> int:
    board = client.info()
    if board.update_slot is None or board.update_slot == _NO_SLOTS:
        raise LinkError(
            f"{client.name}: the firmware of this board takes no updates; flash it through its probe: "
            "pio run -t upload"
        )
    if board.board_id != firmware.board_id:
        raise LinkError(
            f"{client.name}: this firmware is for {firmware.board}, and the board is of another kind; "
            "its pins differ: build the firmware of the board"
        )
    if board.update_pending:
        # Else the update would be written over the one firmware that is known to work.
        raise LinkError(
            f"{client.name}: the running firmware is on trial; reset the board, and it goes back to the one"
            " before"
        )
    if board.update_slot >= len(firmware.images):
        raise LinkError(f"{client.name}: the file has no image for slot {board.update_slot}; build it anew")
    return board.update_slot


def _send_words(client: BoardClient, words: list[int], progress: Callable[[int, int], None]) -> None:
    at = stalled = 0
    while at < len(words):
        asked = [((at + i) & 0xFF, word) for i, word in enumerate(words[at : at + _WINDOW])]
        answers = client.request_together("UPDATE_WRITE", asked)
        for answer in answers:
            # BAD_ITEM: a command before this one was lost; the board's own count says where to go on.
            if answer.result not in (RESULT["OK"], RESULT["BAD_ITEM"]):
                reason = RESULT_NAME.get(answer.result, str(answer.result))
                raise LinkError(f"{client.name}: the board refuses UPDATE_WRITE ({reason}); begin again")
        reached = max(answer.value for answer in answers)
        stalled = stalled + 1 if reached <= at else 0
        if stalled == _STALLED_ROUNDS or reached > at + _WINDOW:
            raise LinkError(f"{client.name}: the update does not go on; begin again")
        at = max(at, reached)
        progress(4 * at, 4 * len(words))
