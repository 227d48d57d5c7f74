"""Recordings damaged on purpose: a clear error or true samples, in little time and memory."""

import struct
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from impid_host.errors import InputError
from impid_host.recording.reader import read_recording
from impid_host.wire.decoder import SerialDecoder

from tests.host.recording.test_recording_file import GOLDEN, write_golden

TRUTH = {
    int(index): int(count)
    for segment in SerialDecoder().feed(GOLDEN.read_bytes()).segments
    for index, count in zip(segment.index, segment.samples.enc1, strict=True)
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hostile") / "whole.mcap"
    write_golden(path)
    return path


@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_damage_gives_true_samples_or_one_clear_line(whole: Path, data: st.DataObject) -> None:
    content = bytearray(whole.read_bytes())
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(content) - 1))
        piece = data.draw(st.binary(max_size=12))
        if data.draw(st.booleans()):
            content[at : at + len(piece)] = piece
        else:
            content[at : at + data.draw(st.integers(0, 4000))] = piece
    damaged = whole.with_name("damaged.mcap")
    damaged.write_bytes(content)
    try:
        recording = read_recording(damaged)
    except InputError as error:
        assert "\n" not in str(error)
        return
    for segment in recording.segments:
        for index, count in zip(segment.index.tolist(), segment.samples.enc1.tolist(), strict=True):
            assert TRUTH[index] == count


def test_a_chunk_that_swells_does_not_fill_the_memory(whole: Path, tmp_path: Path) -> None:
    """200 MB of zeros in a few kB, put in as a chunk that says that it holds 100 bytes."""
    content = whole.read_bytes()
    bomb = zstandard.ZstdCompressor(level=19, write_content_size=True)
    body = struct.pack("<QQQI", 0, 0, 100, zlib.crc32(b"")) + struct.pack("<I", 4) + b"zstd"
    swollen = bytes(bomb.compress(bytes(200 << 20)))
    body += struct.pack("<Q", len(swollen)) + swollen
    record = b"\x06" + struct.pack("<Q", len(body)) + body
    first = content.index(b"\x06", 300)
    path = tmp_path / "bomb.mcap"
    path.write_bytes(content[:first] + record + content[first:])
    assert len(swollen) < 1 << 16
    tracemalloc.start()
    read_recording(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100 << 20


def test_cut_everywhere_in_its_last_pieces(whole: Path, tmp_path: Path) -> None:
    content = whole.read_bytes()
    rng = np.random.default_rng(3)
    for length in rng.integers(9, len(content), 80).tolist():
        path = tmp_path / "cut.mcap"
        path.write_bytes(content[:length])
        try:
            read_recording(path)
        except InputError as error:
            assert "is not an MCAP file" in str(error)
