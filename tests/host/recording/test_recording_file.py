"""The file itself: read by the mcap library alone, cut off anywhere, damaged, or not ours at all."""

import os
import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impid_host.clock.device import ClockExchange
from impid_host.errors import InputError
from impid_host.link.link import Chunk
from impid_host.recording.appender import Appender
from impid_host.recording.reader import read_recording
from impid_host.recording.transposed import restore
from impid_host.recording.writer import RecordingWriter
from impid_host.wire.can_frames import pack_frame
from impid_host.wire.carrier import CAN, SERIAL, Carrier
from impid_host.wire.decoder import SerialDecoder
from mcap.reader import make_reader
from mcap.writer import Writer

from tests.host.recording.first_format import FirstFormatWriter
from tests.host.recording.with_protobuf import messages, sample_rows

Make = Callable[..., Any]
GOLDEN = Path(__file__).parents[2] / "protocol" / "golden" / "serial.bin"
EXCHANGE = ClockExchange(t1_ns=5_000_000_000, t2_us=123, t3_us=130, t4_ns=5_000_400_000)


def write_golden(path: Path, pieces: int = 40, make: Make = RecordingWriter.create) -> None:
    """The golden stream as a recording, one chunk of the file for each piece of it."""
    raw = GOLDEN.read_bytes()
    write(path, raw, SERIAL, -(-len(raw) // pieces), make)


def write_golden_can(path: Path, make: Make = RecordingWriter.create) -> None:
    """The golden frames as a recording."""
    stored = GOLDEN.with_name("can.bin").read_bytes()
    frames = [stored[at : at + 11] for at in range(0, len(stored), 11)]
    raw = b"".join(pack_frame(n, int.from_bytes(f[:2], "little"), f[3:]) for n, f in enumerate(frames))
    write(path, raw, CAN, len(frames) // 40 * 24, make)


def write(path: Path, raw: bytes, carrier: Carrier, size: int, make: Make) -> None:
    """A stream in pieces of that size, each 100 ms behind the one before."""
    writer = make(path, {"impid.host": {"version": "0", "speed": "1.0"}}, carrier=carrier.name)
    decoder = carrier.decoder()
    for number, at in enumerate(range(0, len(raw), size)):
        chunk = Chunk(monotonic_ns=10**9 + number * 10**8, wall_ns=1, data=raw[at : at + size])
        writer.received(chunk)
        decoded = decoder.feed(chunk.data)
        for segment in decoded.segments:
            writer.samples(segment, chunk.monotonic_ns)
        for status in decoded.statuses:
            writer.status(status, chunk.monotonic_ns)
        writer.flush()
    writer.exchange(EXCHANGE, 0xBEEF)
    writer.event("stop", reason="end")
    writer.close({"ending": "complete"})


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    write_golden(tmp_path / "whole.mcap")
    return tmp_path / "whole.mcap"


def test_the_libraries_of_others_read_it(whole: Path) -> None:
    """As Foxglove and PlotJuggler do: index at the end, and a schema for each channel."""
    want = SerialDecoder().feed(GOLDEN.read_bytes()).segments
    with whole.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "impid-recording/2"
        summary = reader.get_summary()
    assert summary is not None
    raw, told, counts = b"", list[Any](), Counter[str]()
    for topic, _, message in messages(whole):
        counts[topic] += 1
        if topic == "/wire":
            raw += restore(message.rx_rows, message.rx_bytes, "serial").tobytes()
        elif topic == "/samples":
            told += sample_rows(message)
    assert raw == GOLDEN.read_bytes()
    assert summary.statistics is not None
    by_number = summary.statistics.channel_message_counts
    assert {summary.channels[number].topic: count for number, count in by_number.items()} == counts
    assert {"/wire", "/events", "/samples", "/status", "/clock"} == set(counts)
    names = ("t_us", "ax", "ay", "enc1", "enc2", "flags")
    columns = [np.concatenate([w.index for w in want])]
    columns += [np.concatenate([getattr(w.samples, name) for w in want]) for name in names]
    assert told == list(zip(*(column.tolist() for column in columns), strict=True))


def test_statuses_and_clock_as_others_read_them(whole: Path) -> None:
    want = SerialDecoder().feed(GOLDEN.read_bytes()).statuses
    told = [message for _, _, message in messages(whole, "/status")]
    assert len(told) == len(want) == 3
    for status, message in zip(want, told, strict=True):
        assert {name: getattr(message, name) for name in asdict(status)} == asdict(status)
    ((_, _, clock),) = messages(whole, "/clock")
    assert (clock.boot_id, clock.t1_ns, clock.t2_us, clock.t3_us, clock.t4_ns) == (
        0xBEEF,
        *asdict(EXCHANGE).values(),
    )


def test_plot_times_are_spaced_like_board_times(whole: Path) -> None:
    times = [(log_ns, message.t_us) for _, log_ns, message in messages(whole, "/samples")]
    log, board = np.array(times).T
    assert np.array_equal(np.diff(log), np.diff(board) * 1000)
    assert np.median(np.diff(board)) == 20_000  # 50 points a second


@pytest.mark.parametrize("carrier", ["serial", "can"])
def test_a_recording_of_the_first_format_reads_the_same(tmp_path: Path, carrier: str) -> None:
    """The same stream through today's writer and through that of the first format."""
    read = []
    for name, make in (("new", RecordingWriter.create), ("old", FirstFormatWriter)):
        path = tmp_path / f"{name}.mcap"
        if carrier == "serial":
            write_golden(path, make=make)
        else:
            write_golden_can(path, make=make)
        read.append(read_recording(path))
    new, old = read
    assert (new.carrier, old.carrier) == (carrier, carrier)
    assert sum(map(len, old.segments)) > 500
    for mine, theirs in zip(new.segments, old.segments, strict=True):
        assert np.array_equal(mine.index, theirs.index)
        for name in ("t_us", "seq", "ax", "ay", "enc1", "enc2", "flags"):
            assert np.array_equal(getattr(mine.samples, name), getattr(theirs.samples, name))
    assert (new.counts, new.statuses, new.responses, new.exchanges) == (
        old.counts,
        old.statuses,
        old.responses,
        old.exchanges,
    )
    assert [(e.name, e.detail) for e in old.events] == [("stop", {"reason": "end"})]
    assert (old.ledgers, old.warnings, old.metadata) == (new.ledgers, (), new.metadata)


def test_reading_back(whole: Path) -> None:
    recording = read_recording(whole)
    assert recording.warnings == ()
    assert recording.exchanges == {0xBEEF: [EXCHANGE]}
    assert recording.metadata["impid.summary"] == {"ending": "complete"}
    assert [(e.name, e.detail) for e in recording.events] == [("stop", {"reason": "end"})]
    (ledger,) = recording.ledgers
    assert (ledger.lost_before, ledger.lost_after, ledger.balanced) == (0, 0, True)
    assert ledger.produced == 680
    assert ledger.lost_inside > 0


def test_cut_off_anywhere_it_opens_with_what_is_whole(whole: Path, tmp_path: Path) -> None:
    """Samples grow with the length and are a prefix of the truth; the warning says what is missing."""
    data, full = whole.read_bytes(), read_recording(whole).segments[0].samples
    before = 0
    rng = np.random.default_rng(2)
    cut = tmp_path / "cut.mcap"
    for length in sorted([*rng.integers(200, len(data) - 1, 60).tolist(), len(data) - 1]):
        cut.write_bytes(data[:length])
        recording = read_recording(cut)
        got = (
            np.concatenate([s.samples.enc1 for s in recording.segments])
            if recording.segments
            else np.zeros(0)
        )
        assert len(got) >= before
        assert np.array_equal(got, full.enc1[: len(got)])
        before = len(got)
    assert before == len(full)
    cut.write_bytes(data[: len(data) // 2])
    warning = read_recording(cut).warnings[0]
    assert "was cut off" in warning
    assert f"of its {len(data) // 2} bytes are an incomplete record" in warning


def test_a_damaged_chunk_is_skipped_and_named(whole: Path) -> None:
    with whole.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[len(summary.chunk_indexes) // 3]
    data = bytearray(whole.read_bytes())
    data[chunk.chunk_start_offset + chunk.chunk_length - 20] ^= 0x10
    whole.write_bytes(data)
    recording = read_recording(whole)
    assert any("is damaged and is skipped" in warning for warning in recording.warnings)
    truth = SerialDecoder().feed(GOLDEN.read_bytes()).segments
    where = {int(i): int(e) for s in truth for i, e in zip(s.index, s.samples.enc1, strict=True)}
    got = [(int(i), int(e)) for s in recording.segments for i, e in zip(s.index, s.samples.enc1, strict=True)]
    assert 300 < len(got) < len(where)
    assert all(where[i] == e for i, e in got)


def test_files_that_are_not_recordings(tmp_path: Path) -> None:
    for name, content in (("empty", b""), ("text", b"t,theta1\n0,1\n"), ("zeros", bytes(1000))):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match="is not an MCAP file"):
            read_recording(tmp_path / name)
    with (tmp_path / "other.mcap").open("wb") as file:
        other = Writer(file)
        other.start(profile="ros2")
        other.finish()
    with pytest.raises(InputError, match="not a recording of impid"):
        read_recording(tmp_path / "other.mcap")
    with pytest.raises(InputError, match="cannot be read"):
        read_recording(tmp_path / "missing.mcap")


def test_a_recording_is_never_overwritten(whole: Path) -> None:
    before = whole.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        RecordingWriter.create(whole, {})
    assert whole.read_bytes() == before


def test_a_folder_that_does_not_exist(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="mkdir -p"):
        RecordingWriter.create(tmp_path / "no" / "x.mcap", {})


def test_a_full_disk_leaves_what_was_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The write that hits the limit goes half through; the file is cut back to the piece before."""
    real, room = os.write, [20_000]

    def limited(descriptor: int, data: bytes) -> int:
        if room[0] <= 0:
            raise OSError(28, "No space left on device")
        written = real(descriptor, data[: room[0]])
        room[0] -= written
        return written

    monkeypatch.setattr("impid_host.recording.appender.os.write", limited)
    path = tmp_path / "full.mcap"
    with pytest.raises(InputError, match="No space left on device"):
        write_golden(path)
    monkeypatch.undo()
    recording = read_recording(path)
    assert "0 of its" in recording.warnings[0]
    assert sum(map(len, recording.segments)) > 50


def test_the_appender_writes_only_whole_flushes(tmp_path: Path) -> None:
    file = Appender.create(tmp_path / "x")
    file.write(b"one")
    assert (tmp_path / "x").read_bytes() == b""
    file.flush()
    file.write(b"two")
    file.close()
    assert (tmp_path / "x").read_bytes() == b"one"


def test_damaged_lengths_cost_their_chunk_and_no_other(whole: Path) -> None:
    """The length of a chunk, then of an index record between chunks, becomes nonsense."""
    with whole.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    chunks, data = summary.chunk_indexes, whole.read_bytes()
    full = sum(map(len, read_recording(whole).segments))
    for number, length in ((3, 1 << 62), (len(chunks) // 2, 17), (len(chunks) - 3, 1 << 20)):
        at = chunks[number].chunk_start_offset
        damaged = bytearray(data)
        damaged[at + 1 : at + 9] = length.to_bytes(8, "little")
        whole.write_bytes(damaged)
        recording = read_recording(whole)
        assert "damaged and are skipped" in recording.warnings[0]
        # The chunk, and at its edges the two batches of ten that began before it or ended behind it.
        lost = full // len(chunks) + 20
        assert full - lost <= sum(map(len, recording.segments)) < full
        assert not any("was cut off" in warning for warning in recording.warnings)


def test_a_disk_that_syncs_slowly_delays_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entered = threading.Event()
    release = threading.Event()

    def slow(descriptor: int) -> None:
        entered.set()
        release.wait(10)

    file = Appender.create(tmp_path / "x")
    monkeypatch.setattr("impid_host.recording.appender.os.fsync", slow)
    file.sync_soon()
    assert entered.wait(5)
    file.write(b"while the disk is busy")
    file.flush()
    assert (tmp_path / "x").read_bytes() == b"while the disk is busy"
    release.set()
    file.close()
