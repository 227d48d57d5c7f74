"""The bytes that the C side wrote, as its own parser reads them, against the decoder."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.messages import KIND
from impid_host.wire.records import Decoded, Loss, join_segments

GOLDEN = Path(__file__).parents[2] / "protocol" / "golden"


@pytest.fixture(scope="module")
def raw() -> bytes:
    return (GOLDEN / "serial.bin").read_bytes()


@pytest.fixture(scope="module")
def told() -> list[dict[str, Any]]:
    return json.loads((GOLDEN / "serial.json").read_text())["frames"]


def decode(pieces: list[bytes]) -> tuple[SerialDecoder, Decoded]:
    decoder = SerialDecoder()
    parts = [decoder.feed(piece) for piece in pieces]
    return decoder, Decoded(
        join_segments([s for p in parts for s in p.segments]),
        *(
            tuple(x for p in parts for x in getattr(p, name))
            for name in ("statuses", "responses", "pongs", "events")
        ),
    )


def test_every_sample_is_as_the_board_says(raw: bytes, told: list[dict[str, Any]]) -> None:
    _, decoded = decode([raw])
    assert len(decoded.segments) == 1
    got = decoded.segments[0].samples
    want = [s for frame in told if frame["kind"] == KIND["SAMPLES"] for s in frame["records"]]
    for name in ("ax", "ay", "enc1", "enc2", "flags"):
        assert getattr(got, name).tolist() == [s[name] for s in want], name
    batches = [f for f in told if f["kind"] == KIND["SAMPLES"]]
    t_us = [f["t0_us"] + 1000 * i for f in batches for i in range(len(f["records"]))]
    assert got.t_us.tolist() == t_us
    seq = [(f["first_index"] + i) % 2**32 for f in batches for i in range(len(f["records"]))]
    assert got.seq.tolist() == seq


def test_index_is_unwrapped_and_the_gap_is_counted(raw: bytes, told: list[dict[str, Any]]) -> None:
    """The vectors start 16 samples before 2^32, and one gap lies where the board's main loop stalled."""
    decoder, decoded = decode([raw])
    index = decoded.segments[0].index
    assert index[0] == 2**32 - 16
    assert index[-1] > 2**32
    steps = np.diff(index.astype(np.int64))
    missing = int((steps - 1).sum())
    assert (steps > 1).sum() == 1
    assert decoder.counts.lost == missing == sum(e.lost for e in decoded.events if isinstance(e, Loss))
    assert decoded.statuses[-1].ring_lost == missing
    # The last answer is the one to STOP: it tells how many samples were produced.
    assert decoded.responses[-1].value == len(index) + missing


def test_any_cut_into_pieces_gives_the_same(raw: bytes) -> None:
    _, whole = decode([raw])
    rng = np.random.default_rng(5)
    for mean in (1, 7, 200, 5000):
        cuts = np.unique(rng.integers(0, len(raw), len(raw) // mean))
        _, pieces = decode([bytes(p) for p in np.split(np.frombuffer(raw, dtype=np.uint8), cuts)])
        assert pieces.segments[0].samples.enc1.tolist() == whole.segments[0].samples.enc1.tolist()
        assert (pieces.statuses, pieces.responses, pieces.pongs) == (
            whole.statuses,
            whole.responses,
            whole.pongs,
        )


def test_nothing_is_lost_or_damaged(raw: bytes, told: list[dict[str, Any]]) -> None:
    decoder, decoded = decode([raw])
    counts = decoder.counts
    assert (counts.bad_frames, counts.bytes_discarded, counts.lost_frames, counts.inconsistent) == (
        0,
        0,
        0,
        0,
    )
    assert counts.good_frames == len(told)
    kinds = Counter(frame["kind"] for frame in told)
    assert len(decoded.statuses) == kinds[KIND["STATUS"]]
    assert len(decoded.responses) == kinds[KIND["RESPONSE"]]
    assert len(decoded.pongs) == kinds[KIND["PONG"]]


def test_pong_time_is_extended_to_64_bit(raw: bytes) -> None:
    """The vectors' PING follows tick 150, at 2^32 - 50000 + 150000 us: its low half has wrapped."""
    _, decoded = decode([raw])
    (pong,) = decoded.pongs
    assert 2**32 + 100_000 <= pong.t2_us <= pong.t3_us < 2**32 + 101_000 + 65_536


def test_the_session_of_a_board_without_the_eighth_status_is_read_as_before(raw: bytes) -> None:
    _, today = decode([raw])
    decoder, older = decode([(GOLDEN / "seven_statuses" / "serial.bin").read_bytes()])
    assert (decoder.counts.bad_frames, decoder.counts.inconsistent) == (0, 0)
    assert older.segments[0].samples.ax.tolist() == today.segments[0].samples.ax.tolist()
    assert older.responses == today.responses
    assert [s.line_errors for s in older.statuses] == [None] * len(today.statuses)
    assert [s.line_errors for s in today.statuses] == [0] * len(today.statuses)
    uncounted: dict[str, Any] = dict.fromkeys(("line_errors", "can_overruns", "adc_overruns", "dma_errors"))
    assert older.statuses == tuple(replace(status, **uncounted) for status in today.statuses)
