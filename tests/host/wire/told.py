"""All that a decoder says of one piece, in plain values: what two decoders are compared by."""

from dataclasses import fields
from typing import Any


def told(part: Any, counts: object) -> list[object]:
    """Statuses, answers, events and segments of a piece, and what is counted so far."""
    out: list[object] = [(list(part.statuses), part.responses, part.pongs, part.events, counts)]
    for segment in part.segments:
        columns = [getattr(segment.samples, f.name) for f in fields(segment.samples)]
        out.append((segment.boot_id, segment.run, segment.index.tobytes()))
        out.append([None if c is None else (c.dtype.str, c.tobytes()) for c in columns])
    return out
