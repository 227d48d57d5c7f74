"""Samples a second through the serial decoder; run it to see the figure."""

import time

import numpy as np
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.frame import Header, encode_frame
from impid_host.wire.messages import ACCEL, ENCODER, KIND

SAMPLES = 1_000_000
PER_FRAME = 10


def stream() -> bytes:
    """A clean stream with full-range encoders."""
    rng = np.random.default_rng(0)
    index = np.arange(SAMPLES)
    enc1, enc2 = rng.integers(0, 1 << 32, (2, SAMPLES), dtype=np.uint64)
    ax = rng.integers(0, 1 << 16, SAMPLES)
    accel = ACCEL.pack(ax=ax, ay=ax, index_low16=index, enc1_high4=enc1 >> 28, enc2_high4=enc2 >> 28)
    words = np.stack([accel, ENCODER.pack(enc1_low28=enc1, enc2_low28=enc2, index_low8=index)], axis=1)
    frames = []
    for first in range(0, SAMPLES, PER_FRAME):
        seq = first // PER_FRAME % 65536
        header = Header(KIND["SAMPLES"], PER_FRAME, 7, seq, first_index=first, t0_us=1000 * first)
        frames.append(encode_frame(header, words[first : first + PER_FRAME].tobytes()))
    return b"".join(frames)


def main() -> None:
    """Decode the stream in pieces of several sizes."""
    raw = stream()
    for piece in (4096, 65536, 1 << 20, len(raw)):
        decoder, began = SerialDecoder(), time.perf_counter()
        for at in range(0, len(raw), piece):
            decoder.feed(raw[at : at + piece])
        took = time.perf_counter() - began
        assert decoder.counts.stored == SAMPLES
        print(f"pieces of {piece:9d} bytes: {SAMPLES / took / 1e6:5.2f} million samples/s")


if __name__ == "__main__":
    main()
