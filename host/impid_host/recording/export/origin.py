"""`recording.json` in a trial's folder: which recording its samples are from, and which board made it."""

import hashlib
import json
from pathlib import Path
from typing import Any

from impid_host.errors import InputError
from impid_host.recording.overview import overview
from impid_host.recording.reader import Recording

NAME = "recording.json"
_KEPT = ("carrier", "recorded_at", "host", "board")


def write_origin(recording: Recording, place: Path) -> None:
    """Write `recording.json` into the trial folder `place`.

    Raises:
        InputError: the file cannot be written.
    """
    told = overview(recording)
    with recording.path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    document = {"file": recording.path.name, "sha256": digest, **{key: told[key] for key in _KEPT}}
    try:
        (place / NAME).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(
            place / NAME, f"cannot be written ({error.strerror})", "check permissions and space"
        ) from None


def read_origin(place: Path) -> dict[str, Any]:
    """What `write_origin` wrote into a trial's folder; empty where it did not, or where it is damaged."""
    try:
        document = json.loads((place / NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return document if isinstance(document, dict) else {}


def board_words(origin: dict[str, Any]) -> str:
    """The board of a recording in a line: its number and its firmware's build; "" where nothing is known."""
    board = origin.get("board")
    if not isinstance(board, dict) or not board:
        return ""
    uid = "-".join(f"{int(board.get(f'uid_{n}', 0)):08x}" for n in range(3))
    return f"{uid}, firmware {board.get('firmware', board.get('firmware_version', 'not known'))}"
