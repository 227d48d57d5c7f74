"""The CAN frames that the C side wrote, against the serial stream of the same session; and frames lost."""

import struct
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from impid_host.samples import FLAG_RESET
from impid_host.wire.can import CanDecoder
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.messages import OPCODE
from impid_host.wire.records import Decoded, Loss, join_segments

DATABASE: Any = cantools.database.load_file(Path(__file__).resolve().parents[3] / "protocol" / "impid.dbc")
GOLDEN = Path(__file__).parents[2] / "protocol" / "golden"
Frame = tuple[int, bytes]
SERIAL = SerialDecoder().feed((GOLDEN / "serial.bin").read_bytes())
TRUTH = {
    int(index): (int(t), int(ax), int(ay), int(e1), int(e2), int(flags))
    for segment in SERIAL.segments
    for index, t, ax, ay, e1, e2, flags in zip(
        segment.index, *(getattr(segment.samples, n) for n in ("t_us", "ax", "ay", "enc1", "enc2", "flags")),
        strict=True,
    )
}  # fmt: skip


def golden() -> list[Frame]:
    data = (GOLDEN / "can.bin").read_bytes()
    return [(struct.unpack_from("<H", data, at)[0], data[at + 3 : at + 11]) for at in range(0, len(data), 11)]


FRAMES = golden()


def feed(decoder: CanDecoder, frames: list[Frame], arrival_ns: np.ndarray | None = None) -> Decoded:
    identifiers = np.array([i for i, _ in frames], dtype=np.uint16)
    return decoder.feed(identifiers, np.frombuffer(b"".join(d for _, d in frames), dtype="<u8"), arrival_ns)


def decode(frames: list[Frame], piece: int = 10**9) -> tuple[CanDecoder, Decoded]:
    decoder = CanDecoder()
    parts = [feed(decoder, frames[at : at + piece]) for at in range(0, len(frames), piece)]
    rest = (
        tuple(x for p in parts for x in getattr(p, n)) for n in ("statuses", "responses", "pongs", "events")
    )
    return decoder, Decoded(join_segments([s for p in parts for s in p.segments]), *rest)


def samples_of(decoded: Decoded) -> dict[int, tuple[int, ...]]:
    out = {}
    for segment in decoded.segments:
        s = segment.samples
        for row, index in enumerate(segment.index.tolist()):
            assert index not in out
            out[index] = tuple(int(getattr(s, n)[row]) for n in ("t_us", "ax", "ay", "enc1", "enc2", "flags"))
    return out


@pytest.mark.parametrize("piece", [1, 2, 3, 50, 10**9])
def test_both_carriers_tell_the_same(piece: int) -> None:
    decoder, decoded = decode(FRAMES, piece)
    assert samples_of(decoded) == TRUTH
    assert decoder.counts.bad_frames == decoder.counts.inconsistent == 0
    assert decoder.counts.lost == sum(e.lost for e in SERIAL.events if isinstance(e, Loss))
    assert decoder.counts.good_frames == len(FRAMES)
    assert decoded.segments[0].boot_id == 0xBEEF


def test_statuses_and_answers() -> None:
    _, decoded = decode(FRAMES)
    own = {"boot_id", "t_us", "next_index", "frames_sent", "accepted", "rejected"}
    for can, serial in zip(decoded.statuses[-3:], SERIAL.statuses[-3:], strict=True):
        assert {k: v for k, v in asdict(can).items() if k not in own} == {
            k: v for k, v in asdict(serial).items() if k not in own
        }
    assert [r.opcode for r in decoded.responses] == [r.opcode for r in SERIAL.responses]
    (can_pong,), (serial_pong,) = decoded.pongs, SERIAL.pongs
    assert abs(can_pong.t2_us - serial_pong.t2_us) < 1000
    assert decoded.responses[-1].value == len(TRUTH) + sum(
        e.lost for e in SERIAL.events if isinstance(e, Loss)
    )


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_lost_frames_cost_their_samples_and_no_other(data: st.DataObject) -> None:
    lost = set(data.draw(st.lists(st.integers(3, len(FRAMES) - 1), max_size=60)))
    decoder, decoded = decode(
        [f for n, f in enumerate(FRAMES) if n not in lost], data.draw(st.integers(1, 400))
    )
    got = samples_of(decoded)
    assert got.items() <= TRUTH.items()
    halves = [n for n in lost if FRAMES[n][0] in (0x110, 0x111)]
    assert len(got) >= len(TRUTH) - len(halves)
    indices = sorted(got)
    assert decoder.counts.lost == indices[-1] - indices[0] + 1 - len(got)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(min_size=8, max_size=8)), max_size=200))
def test_any_frames_at_all_are_survived(frames: list[Frame]) -> None:
    if frames:
        decode(frames, 17)


def sample(index: int, flags: int = 0) -> list[Frame]:
    accel, encoder = DATABASE.get_message_by_name("ACCEL"), DATABASE.get_message_by_name("ENCODER")
    high = {"ax": 1, "ay": 2, "index_low16": index & 0xFFFF, "flags": flags, "enc1_high4": 0, "enc2_high4": 0}
    low = {"enc1_low28": index, "enc2_low28": 0, "index_low8": index & 0xFF}
    return [(accel.frame_id, accel.encode(high)), (encoder.frame_id, encoder.encode(low))]


def date(index: int, t_us: int, boot_id: int) -> list[Frame]:
    time, epoch = DATABASE.get_message_by_name("TIME"), DATABASE.get_message_by_name("EPOCH")
    body = {"index": index, "boot_id": boot_id, "version": 1, "reserved": 0}
    return [
        (time.frame_id, time.encode({"t_us": t_us, "index_low16": index & 0xFFFF})),
        (epoch.frame_id, epoch.encode(body)),
    ]


@pytest.mark.parametrize("piece", [1, 2, 5, 10**9])
def test_a_boot_whose_date_was_lost_is_not_spliced_onto_the_one_before(piece: int) -> None:
    first = date(0, 5000, 1) + [f for i in range(5) for f in sample(i)]
    undated = [f for i in range(3) for f in sample(5 + i, FLAG_RESET if i == 0 else 0)]
    second = date(8, 90_000, 2) + [f for i in range(8, 12) for f in sample(i)]
    decoder, decoded = decode(first + undated + second, piece)
    assert [(s.boot_id, s.index.tolist()) for s in decoded.segments] == [
        (1, [0, 1, 2, 3, 4]),
        (2, [8, 9, 10, 11]),
    ]
    assert decoder.counts.inconsistent == 3
    assert decoded.segments[1].samples.t_us.tolist() == [90_000, 91_000, 92_000, 93_000]


@pytest.mark.parametrize("piece", [1, 3, 10**9])
def test_a_start_needs_a_date_of_its_own(piece: int) -> None:
    response = DATABASE.get_message_by_name("RESPONSE")
    answer = {"request_id": 1, "opcode": OPCODE["START"], "result": 0, "value": 0}
    first = date(0, 5000, 1) + [f for i in range(5) for f in sample(i)]
    again = [(response.frame_id, response.encode(answer)), *sample(5), *date(6, 700_000, 1), *sample(6)]
    decoder, decoded = decode(first + again, piece)
    assert [s.index.tolist() for s in decoded.segments] == [[0, 1, 2, 3, 4], [6]]
    assert decoder.counts.inconsistent == 1


def test_what_the_board_says_belongs_to_the_sample_before_it_however_the_stream_is_cut() -> None:
    """A reader feeds a megabyte at a time, a recorder every few milliseconds: both must tell the same."""
    wholes = decode(FRAMES)[1]
    for piece in (1, 7, 100):
        cut = decode(FRAMES, piece)[1]
        assert cut.statuses == wholes.statuses
        assert cut.responses == wholes.responses
        assert cut.pongs == wholes.pongs
    times = [status.t_us for status in wholes.statuses]
    assert len(set(times)) > 2
    assert times == sorted(times)


def test_half_samples_are_never_paired_across() -> None:
    """ENCODER of sample 1 and ACCEL of sample 2 are lost: what stays does not fit together."""
    frames = date(0, 0, 1) + sample(0) + sample(1)[:1] + sample(2)[1:] + sample(3)
    decoder, decoded = decode(frames)
    assert decoded.segments[0].index.tolist() == [0, 3]
    assert (decoder.counts.bad_frames, decoder.counts.lost) == (2, 2)


@pytest.mark.parametrize("piece", [1, 2, 3, 100])
@pytest.mark.parametrize(("gone", "stored"), [(0, [0, 1, 2, 3, 4]), (256, [0, 259, 260])])
def test_halves_that_arrive_far_apart(piece: int, gone: int, stored: list[int]) -> None:
    """The program that reads stands still for 0.5 s between two halves; or 256 samples are lost there, after
    which the second half that comes has the index bits of the one that is missing."""
    late = [*sample(2 + gone)[1:], *sample(3 + gone), *sample(4 + gone)]
    frames = date(0, 0, 1) + sample(0) + sample(1) + sample(2)[:1] + late
    if gone:
        frames[4:6] = []  # nothing but the torn pair in front
    came_ns = np.cumsum([500_000_000 if n == len(frames) - len(late) else 1 for n in range(len(frames))])
    decoder = CanDecoder()
    got = []
    for at in range(0, len(frames), piece):
        decoded = feed(decoder, frames[at : at + piece], came_ns[at : at + piece])
        got += [int(index) for segment in decoded.segments for index in segment.index]
    assert got == stored
    assert decoder.counts.bad_frames == (2 if gone else 0)
