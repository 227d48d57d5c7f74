"""The decoder in C against the one in Python, byte for byte: clean, damaged, random and cut into pieces
of any size."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from impid_host.wire import native
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.deframer import Deframer
from impid_host.wire.frame import LARGEST_FRAME_BYTES, Header, encode_frame
from impid_host.wire.messages import ACCEL, ENCODER, KIND, RECORD_BYTES

from tests.host.wire.told import told

GOLDEN = Path(__file__).parents[2] / "protocol" / "golden"
RNG = np.random.default_rng(17)


def frame(number: int, kind: str = "SAMPLES", boot_id: int = 5) -> bytes:
    count = int(RNG.integers(1, 12))
    index = 1000 * number + np.arange(count)
    enc1, enc2 = RNG.integers(0, 1 << 32, (2, count), dtype=np.uint64)
    low16 = index + int(RNG.random() < 0.1)  # now and then it contradicts the header
    ax, flags = RNG.integers(0, 1 << 16, count), RNG.integers(0, 32, count)
    accel = ACCEL.pack(ax=ax, ay=ax ^ 77, index_low16=low16, flags=flags, enc1_high4=enc1 >> 28)
    encoder = ENCODER.pack(enc1_low28=enc1, enc2_low28=enc2, index_low8=index)
    records = np.stack([accel, encoder], axis=1).tobytes()
    if kind != "SAMPLES":
        records = RNG.bytes(count * RECORD_BYTES[KIND[kind]][0])
    header = Header(
        KIND[kind], count, boot_id, number % 65536, first_index=1000 * number, t0_us=10**6 * number
    )
    return encode_frame(header, records)


@lru_cache
def streams() -> list[bytes]:
    kinds = ["SAMPLES"] * 6 + ["STATUS", "RESPONSE", "PONG", "SAMPLES_WIDE"]
    whole = b"".join(frame(n, kinds[int(RNG.integers(len(kinds)))], 5 + n // 90) for n in range(200))
    noise = RNG.bytes(20_000)
    damaged = bytearray(whole)
    for at in RNG.integers(0, len(whole) - 20, 60).tolist():
        match at % 4:
            case 0:
                damaged[at] ^= 1 << (at % 8)
            case 1:
                del damaged[at : at + 3]
            case 2:
                damaged[at:at] = RNG.bytes(5)
            case _:
                damaged[at] = 0
    long = b"\0" + bytes([7]) * (3 * LARGEST_FRAME_BYTES) + whole[: len(whole) // 3]
    blocks = (bytes([255]) + bytes(RNG.integers(1, 256, 254).astype(np.uint8)) for _ in range(4))
    full = b"".join(blocks) + b"\0"
    return [
        GOLDEN.joinpath("serial.bin").read_bytes(),
        whole,
        bytes(damaged),
        noise,
        noise.replace(b"\0", b"\1"),
        whole[7:] + noise + whole,
        long,
        full + b"\0\0" + whole[:3000] + b"\1\0\2\0",
    ]


def decoded(data: bytes, pieces: list[int], *, in_c: bool) -> list[object]:
    decoder, out = SerialDecoder(Deframer(native=in_c)), list[object]()
    at = 0
    for size in pieces:
        part = decoder.feed(data[at : at + size])
        at += size
        out += told(part, decoder.counts)
    return out


@pytest.mark.parametrize("number", range(8))
@pytest.mark.parametrize("largest", [1, 7, 190, 5000, 10**9])
def test_both_decode_alike(number: int, largest: int) -> None:
    assert native.available, "build it: IMPID_SIM=1 python setup.py build_ext --inplace"
    data = streams()[number]
    data = data[:3000] if largest == 1 else data
    pieces: list[int] = []
    while sum(pieces) < len(data):
        pieces.append(int(RNG.integers(1, min(largest, len(data)) + 1)))
    mine, theirs = (decoded(data, pieces, in_c=in_c) for in_c in (True, False))
    assert mine == theirs


def test_the_streams_hold_what_they_should() -> None:
    """Enough good frames, damaged ones and contradictions that alike means something."""
    decoder = SerialDecoder(Deframer(native=True))
    decoder.feed(streams()[2])
    counts = decoder.counts
    assert counts.good_frames > 100
    assert counts.bad_frames > 30
    assert counts.inconsistent > 5
    assert counts.stored > 300
