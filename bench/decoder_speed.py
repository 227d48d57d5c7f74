"""Samples a second through the serial decoder, in C and in Python, beside a plain loop; run it to see the figures.

Processor time of one thread, the best of three.
"""

import struct
import time
import zlib
from collections.abc import Callable
from functools import partial

import numpy as np
from cobs import cobs
from impid_host.wire import native
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.deframer import Deframer
from impid_host.wire.frame import Header, encode_frame
from impid_host.wire.messages import ACCEL, ENCODER, KIND
from numpy.typing import NDArray

SAMPLES = 1_000_000
PER_FRAME = 10
PIECES = (4096, 65536, 1 << 20)


def stream() -> bytes:
    """A clean stream with full-range encoders."""
    rng = np.random.default_rng(0)
    enc1, enc2 = rng.integers(0, 1 << 32, (2, SAMPLES), dtype=np.uint64)
    ax = rng.integers(0, 1 << 16, SAMPLES)
    return b"".join(frames(ax, ax, enc1, enc2))


def frames(
    ax: NDArray[np.int64], ay: NDArray[np.int64], enc1: NDArray[np.uint64], enc2: NDArray[np.uint64]
) -> list[bytes]:
    """Codes and counters, (N,), of a board from its first sample on, in frames of ten."""
    index = np.arange(len(ax))
    accel = ACCEL.pack(ax=ax, ay=ay, index_low16=index, enc1_high4=enc1 >> 28, enc2_high4=enc2 >> 28)
    words = np.stack([accel, ENCODER.pack(enc1_low28=enc1, enc2_low28=enc2, index_low8=index)], axis=1)
    out = []
    for first in range(0, len(index), PER_FRAME):
        seq = first // PER_FRAME % 65536
        header = Header(KIND["SAMPLES"], PER_FRAME, 7, seq, first_index=first, t0_us=1000 * first)
        out.append(encode_frame(header, words[first : first + PER_FRAME].tobytes()))
    return out


def loop(raw: bytes) -> int:
    """Frame by frame, sample by sample, as one writes it first."""
    samples = []
    for piece in raw.split(b"\0"):
        if not piece:
            continue
        frame = cobs.decode(piece)
        (checksum,) = struct.unpack_from("<I", frame, len(frame) - 4)
        if zlib.crc32(frame[:-4]) != checksum:
            continue
        count = frame[6]
        for n in range(count):
            accel, encoder = struct.unpack_from("<QQ", frame, 20 + 16 * n)
            samples.append(
                (accel & 0xFFFF, accel >> 16 & 0xFFFF, encoder & 0xFFFFFFF, encoder >> 28 & 0xFFFFFFF)
            )
    return len(samples)


def decode(raw: bytes, piece: int, *, in_c: bool) -> int:
    """The decoder of the package, in pieces of that size."""
    decoder = SerialDecoder(Deframer(native=in_c))
    for at in range(0, len(raw), piece):
        decoder.feed(raw[at : at + piece])
    return decoder.counts.stored


def best_s(work: Callable[[], int], times: int = 3) -> float:
    """Processor time of the quickest."""
    taken = []
    for _ in range(times):
        began = time.process_time()
        assert work() == SAMPLES
        taken.append(time.process_time() - began)
    return min(taken)


def main() -> None:
    """Decode the stream in pieces of several sizes."""
    raw = stream()
    alone = best_s(lambda: loop(raw), 1)
    print(f"plain loop: {SAMPLES / alone / 1e6:.2f} million samples/s")
    for in_c in (True, False) if native.available else (False,):
        for piece in PIECES:
            took = best_s(partial(decode, raw, piece, in_c=in_c))
            way = "C" if in_c else "Python"
            print(
                f"{way}, pieces of {piece:7d} bytes: {SAMPLES / took / 1e6:5.2f} million samples/s, {alone / took:.1f} x"
            )


if __name__ == "__main__":
    main()
