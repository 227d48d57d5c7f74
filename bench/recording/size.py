"""What an hour of recording takes on the disk, with noisy readings and both joints moving.

`size.py [SECONDS]`: serial frames of ten samples, accelerometer noise of 20 codes about a motion of five sines, encoders
that move by up to some 100 counts a millisecond; statuses and clock exchanges left out (about 5 MB/h).
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from common import save
from decoder_speed import PER_FRAME
from decoder_speed import frames as framed
from impid_host.link.link import Chunk
from impid_host.recording.writer import RecordingWriter
from impid_host.wire.decoder import SerialDecoder


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
    return framed(ax.astype(int), ay.astype(int), *enc)


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
