"""Damage of every kind: nothing wrong is accepted, nothing raises, and the next whole frame is taken."""

import struct
import zlib
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.deframer import Deframer
from impid_host.wire.frame import LARGEST_FRAME_BYTES

DATABASE: Any = cantools.database.load_file(Path(__file__).resolve().parents[3] / "protocol" / "impid.dbc")
BATCH = DATABASE.get_message_by_name("BATCH")
ACCEL = DATABASE.get_message_by_name("ACCEL")
ENCODER = DATABASE.get_message_by_name("ENCODER")
PER_FRAME = 3


def samples_frame(number: int, boot_id: int = 9) -> bytes:
    """Frame `number` of a stream, made by cantools, zlib and cobs alone; encoder 1 counts ten a sample."""
    first = number * PER_FRAME
    records = b""
    for index in range(first, first + PER_FRAME):
        records += ACCEL.encode(
            {"ax": index, "ay": 0, "index_low16": index, "flags": 0, "enc1_high4": 0, "enc2_high4": 15}
        )
        records += ENCODER.encode(
            {"enc1_low28": index * 10, "enc2_low28": 2**28 - 1, "index_low8": index % 256}
        )
    header = {
        "kind": 1,
        "version": 1,
        "boot_id": boot_id,
        "frame_seq": number,
        "count": PER_FRAME,
        "flags": 0,
    }
    raw = BATCH.encode(header | {"first_index": first, "t0_us": 5000 + 1000 * first}) + records
    return cobs.encode(raw + struct.pack("<I", zlib.crc32(raw))) + b"\0"


FRAMES = [samples_frame(n) for n in range(12)]


def accepted(stream: bytes) -> tuple[list[int], SerialDecoder]:
    """Indices accepted, each checked against the truth of its sample."""
    decoder = SerialDecoder()
    decoded = decoder.feed(stream)
    index: list[int] = []
    for segment in decoded.segments:
        s = segment.samples
        assert s.ax.tolist() == segment.index.tolist()
        assert s.enc1.tolist() == [10 * i for i in segment.index.tolist()]
        assert set(s.enc2.tolist()) == {-1}
        assert s.t_us.tolist() == [5000 + 1000 * i for i in segment.index.tolist()]
        index += segment.index.tolist()
    return index, decoder


def test_every_single_bit_flip() -> None:
    """All bits of a frame and its delimiter: the frame is refused, its neighbours behind are taken."""
    stream = FRAMES[0] + FRAMES[1] + FRAMES[2] + FRAMES[3]
    begin, end = len(FRAMES[0]), len(FRAMES[0]) + len(FRAMES[1])
    for bit in range(8 * begin, 8 * end):
        damaged = bytearray(stream)
        damaged[bit // 8] ^= 1 << bit % 8
        index, decoder = accepted(bytes(damaged))
        # A damaged delimiter glues the frame to the next one, and both are lost.
        behind = range(9, 12) if bit // 8 == end - 1 else range(6, 12)
        assert index == [0, 1, 2, *behind], f"bit {bit}"
        assert decoder.counts.bad_frames >= 1
        assert decoder.counts.lost == behind[0] - 3
        assert decoder.counts.lost_frames == (behind[0] - 3) // PER_FRAME


def test_every_double_bit_flip_near_the_head() -> None:
    """All pairs within the first 12 bytes, where the COBS code byte and the header's lengths are."""
    stream = bytearray(FRAMES[1] + FRAMES[2])
    for a in range(96):
        for b in range(a):
            damaged = bytearray(stream)
            damaged[a // 8] ^= 1 << a % 8
            damaged[b // 8] ^= 1 << b % 8
            assert accepted(bytes(damaged))[0] == [6, 7, 8], (a, b)


@settings(max_examples=400, deadline=None)
@given(data=st.data())
def test_random_damage(data: st.DataObject) -> None:
    """Bits flipped, bytes inserted and removed, stretches spliced in; then two clean frames."""
    stream = bytearray(b"".join(FRAMES[:8]))
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(stream) - 1))
        match data.draw(st.sampled_from(["flip", "insert", "remove", "splice"])):
            case "flip":
                stream[at] ^= 1 << data.draw(st.integers(0, 7))
            case "insert":
                stream[at:at] = data.draw(st.binary(min_size=1, max_size=40))
            case "remove":
                del stream[at : at + data.draw(st.integers(1, 60))]
                stream = stream or bytearray(b"\0")
            case "splice":
                source = data.draw(st.integers(0, len(stream) - 1))
                stream[at:at] = stream[source : source + data.draw(st.integers(1, 120))]
    index, _ = accepted(bytes(stream) + b"\0" + FRAMES[10] + FRAMES[11])
    assert index[-6:] == list(range(30, 36))
    assert len(set(index)) == len(index)
    assert index == sorted(index)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=3000))
def test_noise_yields_nothing(noise: bytes) -> None:
    deframer = Deframer()
    assert len(deframer.feed(noise + b"\0")) == 0
    assert deframer.counts.bytes_discarded == len(noise.replace(b"\0", b""))


def test_frames_that_lie_about_themselves_are_refused() -> None:
    """Right CRC, wrong content: unknown kind, other version, count that does not fit the length."""
    raw = cobs.decode(FRAMES[0][:-1])[:-4]
    for at, value in ((0, 200), (1, 2), (6, 4), (6, 2)):
        wrong = bytearray(raw)
        wrong[at] = value
        frame = cobs.encode(bytes(wrong) + struct.pack("<I", zlib.crc32(wrong))) + b"\0"
        index, decoder = accepted(b"\0" + frame + FRAMES[1])
        assert index == [3, 4, 5]
        assert decoder.counts.bad_frames == 1


def test_samples_that_contradict_their_header_are_refused() -> None:
    raw = bytearray(cobs.decode(FRAMES[0][:-1])[:-4])
    raw[20 + 4] ^= 1  # index_low16 of the first record
    frame = cobs.encode(bytes(raw) + struct.pack("<I", zlib.crc32(raw))) + b"\0"
    index, decoder = accepted(frame + FRAMES[1])
    assert index == [3, 4, 5]
    assert decoder.counts.inconsistent == 1


def test_memory_is_bounded_without_delimiters() -> None:
    deframer = Deframer()
    for _ in range(50):
        deframer.feed(b"\x01" * 4096)
    assert len(deframer._pending) <= LARGEST_FRAME_BYTES
    assert len(deframer.feed(b"\0" + FRAMES[0])) == 1
    assert deframer.counts.bytes_discarded == 50 * 4096


def test_listening_in_mid_frame_is_no_damage() -> None:
    deframer = Deframer()
    assert len(deframer.feed(FRAMES[0][20:] + FRAMES[1])) == 1
    assert deframer.counts.bad_frames == 0
    assert deframer.counts.bytes_discarded == len(FRAMES[0]) - 21


@pytest.mark.parametrize("repeated", [1, 3])
def test_an_echo_is_not_counted_twice(repeated: int) -> None:
    stream = b"".join(FRAMES[:6]) + b"".join(FRAMES[6 - repeated : 6]) + FRAMES[6]
    index, decoder = accepted(stream)
    assert index == list(range(21))
    assert decoder.counts.stale_groups == repeated
    assert (decoder.counts.lost, decoder.counts.lost_frames) == (0, 0)


def test_boots_are_never_spliced() -> None:
    """The second boot starts its index and time anew, here ahead of the first's."""
    stream = b"".join(FRAMES[:3]) + samples_frame(7, boot_id=10) + samples_frame(8, boot_id=10)
    decoded = SerialDecoder().feed(stream)
    assert [(s.boot_id, s.run, s.index.tolist()) for s in decoded.segments] == [
        (9, 0, list(range(9))),
        (10, 1, list(range(21, 27))),
    ]
    assert np.array_equal(decoded.segments[1].samples.t_us, 5000 + 1000 * np.arange(21, 27))
