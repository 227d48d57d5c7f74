"""Raw CAN frames to the log formats of the trade, by python-can."""

from pathlib import Path

import can

from impid_host.recording.reader import read_raw_can
from impid_host.recording.records import Window
from impid_host.wire.can_frames import ERROR, EXTENDED, REMOTE

_ID_MASK = (1 << 29) - 1


def write_can_log(source: Path, path: Path, window: Window | None = None) -> None:
    """Every frame that came in, with its arrival; .asc or .blf by the name of the file.

    Raises:
        InputError: it was recorded over a serial line, where there are no CAN frames.
    """
    with can.Logger(str(path)) as log:
        frames = ((f, offset) for piece, offset in read_raw_can(source, window) for f in piece)
        for frame, wall_minus_monotonic_ns in frames:
            identifier = int(frame["identifier"])
            message = can.Message(
                timestamp=(int(frame["monotonic_ns"]) + wall_minus_monotonic_ns) * 1e-9,
                arbitration_id=identifier & _ID_MASK,
                is_extended_id=bool(identifier & EXTENDED),
                is_remote_frame=bool(identifier & REMOTE),
                is_error_frame=bool(identifier & ERROR),
                dlc=int(frame["dlc"]),
                data=frame["data"].tobytes()[: frame["dlc"]],
                channel=0,
            )
            log.on_message_received(message)
