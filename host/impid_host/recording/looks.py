"""Samples, statuses and clock exchanges as messages for looking.

A message of `/samples` holds up to twenty samples that follow each other: the first as plain numbers,
which is what plots show, 50 times a second; the rest as steps from one to the next. Row i has index
`index + i` and stamp `t_us + 1000 i`. Twenty, because PlotJuggler and Foxglove plot no lists over time: ten
would take 10 MB more an hour, a message a sample some 50 (`bench/recording/size.py`).
"""

from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from impid_host.clock.device import ClockExchange
from impid_host.recording.channels import CLOCK_FIELDS, SAMPLE_FIELDS, STATUS_FIELDS, STEP_FIELDS
from impid_host.recording.protobuf import SINT32, number, packed, varint, varints, zigzag
from impid_host.wire.records import BoardStatus, Segment

PER_MESSAGE = 20
_SIGNALS = ("ax", "ay", "az", "enc1", "enc2")


def sample_messages(segment: Segment) -> list[tuple[int, bytes]]:
    """Messages of a run's samples: the row (from 0) of the first sample of each, and the message."""
    starts = _cuts(segment.index)
    stops = np.append(starts[1:], len(segment))
    columns = []
    for name in _SIGNALS:
        values = getattr(segment.samples, name)
        if values is not None:
            columns.append((name, *varints(_steps(values.astype(np.int64), starts, name))))
    head = number(SAMPLE_FIELDS["boot_id"].number, segment.boot_id)
    head += number(SAMPLE_FIELDS["run"].number, segment.run)
    index, t_us, flags = segment.index, segment.samples.t_us, segment.samples.flags
    at = SAMPLE_FIELDS["index"].number, SAMPLE_FIELDS["t_us"].number, SAMPLE_FIELDS["flags"].number
    messages = []
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
        parts = [head, number(at[0], int(index[start])), number(at[1], int(t_us[start]))]
        for name, blob, ends in columns:
            first, rest, end = ends[start], ends[start + 1], ends[stop]
            parts.append(varint(SAMPLE_FIELDS[name].number << 3) + blob[first:rest])
            parts.append(packed(STEP_FIELDS[f"{name}_steps"].number, blob[rest:end]))
        told = flags[start:stop]
        parts.append(number(at[2], int(told[0])))
        if (told != told[0]).any():
            parts.append(packed(STEP_FIELDS["flags_rest"].number, varints(told[1:].astype(np.uint64))[0]))
        messages.append((start, b"".join(parts)))
    return messages


def status_message(status: BoardStatus) -> bytes:
    """A status; counters that the board does not have are left out, as zeros are."""
    return b"".join(number(STATUS_FIELDS[name].number, value or 0) for name, value in asdict(status).items())


def clock_message(exchange: ClockExchange, boot_id: int) -> bytes:
    """A clock exchange."""
    values = asdict(exchange) | {"boot_id": boot_id}
    return b"".join(number(field.number, values[name]) for name, field in CLOCK_FIELDS.items())


def _cuts(index: NDArray[np.uint64]) -> NDArray[np.intp]:
    """Rows at which a message begins: after a gap, and every twenty."""
    gaps = np.flatnonzero(np.diff(index) != 1) + 1
    first = np.concatenate([[0], gaps])
    stop = np.append(gaps, len(index))
    return np.concatenate([np.arange(a, b, PER_MESSAGE) for a, b in zip(first, stop, strict=True)])


def _steps(values: NDArray[np.int64], starts: NDArray[np.intp], name: str) -> NDArray[np.uint64]:
    """Values at the starts, and between them steps, as their varints hold them."""
    # A counter of 32 bits that wraps makes a small step.
    steps = np.diff(values, prepend=0).astype(np.int32).astype(np.int64)
    out = zigzag(steps)
    signed = SAMPLE_FIELDS[name].type == SINT32
    out[starts] = zigzag(values[starts]) if signed else values[starts].view(np.uint64)
    return out
