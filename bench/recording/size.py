"""What an hour of recording takes on the disk, with noisy readings and both joints moving.

`size.py [SECONDS]`: serial frames of ten samples, accelerometer noise of 20 codes about a motion of five sines, encoders
that move by up to some 100 counts a millisecond; statuses and clock exchanges left out (about 5 MB/h).
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from common import save
from impid_host.link.link import Chunk
from impid_host.recording.writer import RecordingWriter
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.frame import Header, encode_frame
from impid_host.wire.messages import ACCEL, ENCODER, KIND

PER_FRAME = 10


def frames(seconds: int) -> list[bytes]:
    rng = np.random.default_rng(0)
    index = np.arange(seconds * 1000)
    t_s = index * 1e-3
    motion = sum(
        np.sin(2 * np.pi * f * t_s + p)
        for f, p in zip([0.3, 0.7, 1.3, 2.9, 5.1], rng.uniform(0, 6, 5), strict=True)
    )
    ax, ay = (32768 + gain * motion + rng.normal(0, 20, len(index)) for gain in (2000, -1500))
    enc = [
        np.asarray(gain * motion).astype(np.int32).view(np.uint32).astype(np.uint64) for gain in (8000, -5000)
    ]
    accel = ACCEL.pack(
        ax=ax.astype(int),
        ay=ay.astype(int),
        index_low16=index,
        enc1_high4=enc[0] >> 28,
        enc2_high4=enc[1] >> 28,
    )
    words = np.stack([accel, ENCODER.pack(enc1_low28=enc[0], enc2_low28=enc[1], index_low8=index)], axis=1)
    out = []
    for first in range(0, len(index), PER_FRAME):
        header = Header(
            KIND["SAMPLES"], PER_FRAME, 7, first // PER_FRAME % 65536, first_index=first, t0_us=1000 * first
        )
        out.append(encode_frame(header, words[first : first + PER_FRAME].tobytes()))
    return out


def main(seconds: int = 60) -> None:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "size.mcap"
        writer, decoder = RecordingWriter.create(out, {}), SerialDecoder()
        for number, frame in enumerate(frames(seconds)):
            chunk = Chunk(10**9 + number * PER_FRAME * 10**6, 0, frame)
            writer.received(chunk)
            for segment in decoder.feed(frame).segments:
                writer.samples(segment, chunk.monotonic_ns)
            if number % 2:
                writer.flush()
        writer.close({"ending": "complete"})
        megabytes_an_hour = out.stat().st_size / 1e6 * 3600 / seconds
    save("size", seconds=seconds, megabytes_an_hour=round(megabytes_an_hour, 1))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
