"""The hot loop of the CAN decoder in C, see `native`."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import FLAG_RESET
from impid_host.wire.messages import (
    ACCEL,
    ACCEL_FINE,
    ENCODER,
    EPOCH,
    FLAG_FINE,
    OPCODE,
    PROTOCOL_VERSION,
    RESPONSE,
    SAMPLE_PERIOD_US,
    TIME,
    MessageLayout,
)
from impid_host.wire.native import FLAGS_KEPT, SAMPLES, available, columns_of, ffi, lib, new_block

PAIR_NS = 200_000_000
_STANDARD = 1 << 11


class Followed(NamedTuple):
    """Frames that go on exactly where the bus stands.

    Attributes:
        samples: columns by the names of `DeviceSamples`, each (N,).
        numbers: their index, 64 bit, (N,).
        at: where in the piece the ACCEL of each stood, -1: in the one before; (N,).
        others: where frames of other identifiers stood, (K,).
        bus: an `impid_bus`, as it stands now.
    """

    samples: dict[str, NDArray[Any]]
    numbers: NDArray[np.uint64]
    at: NDArray[np.int64]
    others: NDArray[np.int64]
    bus: Any


def follow(frames: NDArray[np.void], **bus: int) -> Followed | None:
    """Samples of CAN_FRAMEs (N,), where all halves are there and nothing is new; else None.

    `bus` is where it stands, by the names of `impid_bus`.
    """
    count = len(frames)
    rows, block = new_block(count // 2 + 1)
    at, others = np.empty(rows, np.int64), np.empty(count, np.int64)
    state = ffi.new("impid_bus *", bus)
    made = lib.impid_follow_can(
        _LAYOUT,
        SAMPLES,
        ffi.from_buffer("impid_can_frame[]", frames),
        count,
        FLAGS_KEPT,
        state,
        ffi.from_buffer("uint8_t[]", block),
        rows,
        ffi.from_buffer("int64_t[]", at),
        ffi.from_buffer("int64_t[]", others),
    )
    if made < 0:
        return None
    columns = columns_of(block, rows, made)
    numbers = columns.pop("index")
    return Followed(columns, numbers, at[:made], others[: state.others], state)


def _signal(layout: MessageLayout, name: str) -> dict[str, int]:
    return dict(zip(("shift", "mask"), layout.fields[name], strict=True))


if available:
    _LAYOUT = ffi.new(
        "impid_can_layout *",
        {
            "standard": _STANDARD,
            "accel": ACCEL.frame_id,
            "encoder": ENCODER.frame_id,
            "fine": ACCEL_FINE.frame_id,
            "time": TIME.frame_id,
            "epoch": EPOCH.frame_id,
            "response": RESPONSE.frame_id,
            "start": OPCODE["START"],
            "version": PROTOCOL_VERSION,
            "period_us": SAMPLE_PERIOD_US,
            "flag_fine": FLAG_FINE,
            "flag_reset": FLAG_RESET,
            "apart_ns": PAIR_NS,
            "time_us": _signal(TIME, "t_us"),
            "time_index": _signal(TIME, "index_low16"),
            "epoch_index": _signal(EPOCH, "index"),
            "epoch_boot": _signal(EPOCH, "boot_id"),
            "epoch_version": _signal(EPOCH, "version"),
            "opcode": _signal(RESPONSE, "opcode"),
        },
    )
