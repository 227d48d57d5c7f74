"""Windows of long recordings, against the whole: both formats' files, cut off and damaged ones."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from impid_host.cli.export import command as export
from impid_host.clock.device import ClockExchange
from impid_host.link.link import Chunk
from impid_host.recording.reader import read_recording, sample_pieces, survey
from impid_host.recording.records import Window
from impid_host.recording.writer import RecordingWriter
from impid_host.wire.can_frames import pack_frame
from impid_host.wire.carrier import CAN, SERIAL, Carrier
from impid_host.wire.messages import OPCODE

from hil_sim.board.native import BoardConfig, NativeBoard
from tests.host.recording.first_format import FirstFormatWriter

SECONDS = 40
NAMES = ("t_us", "seq", "ax", "ay", "enc1", "enc2", "flags")
BEFORE_WRAP = 20_000  # the 32-bit index wraps half-way


def write(path: Path, carrier: Carrier, make=RecordingWriter.create) -> None:
    """A board's stream in pieces of 20 ms; one second in ten is lost on the way."""
    config = BoardConfig(boot_id=9, first_index=2**32 - BEFORE_WRAP, serial_bytes_per_ms=0)
    board, decoder = NativeBoard(config), carrier.decoder()
    writer = make(path, {"impid.host": {"version": "0", "speed": "1.0"}}, carrier=carrier.name)
    rng = np.random.default_rng(3)
    command = carrier.encode_command(1, OPCODE["START"], 0, 0)
    if carrier is CAN:
        board.can_receive(int.from_bytes(command[8:12], "little"), command[16:24], board.now_us)
    else:
        board.serial_receive(command, board.now_us)
    for piece in range(SECONDS * 50):
        adc = rng.integers(1900, 2200, (20, 8, 2)).astype(np.uint16)
        counts = np.arange(piece * 20, piece * 20 + 20, dtype=np.int32)
        board.run(adc, np.column_stack([counts, -counts]))
        now_ns = 10**9 + piece * 20_000_000
        data = taken(board, carrier, now_ns)
        if piece % 500 >= 450:
            continue
        chunk = Chunk(now_ns, now_ns + 5, data)
        writer.received(chunk)
        decoded = decoder.feed(data)
        for segment in decoded.segments:
            writer.samples(segment, now_ns)
        for status in decoded.statuses:
            writer.status(status, now_ns)
        if piece % 5 == 0:
            writer.exchange(ClockExchange(now_ns - 9, piece, piece + 1, now_ns), 9)
        writer.flush()
    writer.close({"ending": "complete"})


def taken(board: NativeBoard, carrier: Carrier, now_ns: int) -> bytes:
    if carrier is CAN:
        return b"".join(pack_frame(now_ns, identifier, data) for identifier, data in board.can_take())
    return board.serial_take()


@pytest.fixture(scope="module", params=["serial", "can"])
def recorded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("windows") / f"{request.param}.mcap"
    write(path, {"serial": SERIAL, "can": CAN}[request.param])
    return path


def test_any_window_is_that_part_of_the_whole(recorded: Path) -> None:
    whole = read_recording(recorded)
    (truth,) = whole.segments
    assert int(truth.index[-1]) > 2**32  # the wrap is inside
    rng = np.random.default_rng(4)
    for start_s in [0.0, 8.7, 19.9, 20.1, *rng.uniform(0, SECONDS - 5, 12)]:
        window = Window(float(start_s), float(start_s + rng.uniform(0.5, 5)))
        recording = read_recording(recorded, window)
        (part,) = recording.segments
        rows = np.searchsorted(truth.index, part.index)
        assert np.array_equal(truth.index[rows], part.index)
        assert np.array_equal(rows, np.arange(rows[0], rows[-1] + 1))  # nothing inside is missing
        for name in NAMES:
            assert np.array_equal(getattr(truth.samples, name)[rows], getattr(part.samples, name))
        # Board and PC run side by side; 0.1 s is a chunk, 0.03 s a batch and a piece.
        host_s = (part.samples.t_us.astype(float) - float(truth.samples.t_us[0])) * 1e-6
        inside = host_s[(host_s % 10 < 8.9) & (host_s % 10 > 0.1)]
        if len(inside):
            assert window.start_s - 0.03 <= host_s[0]
            assert inside[-1] <= window.stop_s + 0.13
            if window.start_s % 10 < 8.8:
                assert host_s[0] <= window.start_s + 0.13
        assert recording.runs[0].run == 0
        assert all(ledger.balanced is not False for ledger in recording.ledgers)


def test_a_window_of_a_file_that_was_cut_off(recorded: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    content = recorded.read_bytes()
    cut.write_bytes(content[: len(content) // 2])
    assert any("cut off" in warning for warning in read_recording(cut).warnings)
    mine, theirs = (read_recording(path, Window(5, 6)) for path in (cut, recorded))
    assert mine.warnings == ()
    assert np.array_equal(mine.segments[0].index, theirs.segments[0].index)
    assert len(mine.segments[0]) > 900


def test_a_window_of_the_first_format(tmp_path: Path) -> None:
    path = tmp_path / "old.mcap"
    write(path, SERIAL, FirstFormatWriter)
    (truth,), (part,) = read_recording(path).segments, read_recording(path, Window(12, 14)).segments
    rows = np.searchsorted(truth.samples.t_us, part.samples.t_us)
    assert np.array_equal(truth.samples.ax[rows], part.samples.ax)
    assert 1900 < len(part) < 3000


def test_pieces_and_survey_add_up_to_the_whole(recorded: Path) -> None:
    whole, told = read_recording(recorded), survey(recorded)
    (truth,) = whole.segments
    pieces = list(sample_pieces(recorded))
    assert np.array_equal(np.concatenate([piece.index for piece in pieces]), truth.index)
    assert (told.segments, told.runs, told.ledgers, told.counts) == (
        (),
        whole.runs,
        whole.ledgers,
        whole.counts,
    )
    assert told.statuses == whole.statuses[-1:]
    assert told.exchanges == whole.exchanges
    assert len(told.exchanges[9]) == SECONDS * 10 * 9 // 10


def test_export_of_a_window(recorded: Path, tmp_path: Path) -> None:
    out = tmp_path / "part.parquet"
    result = CliRunner().invoke(
        export, [str(recorded), "--out", str(out), "--window", "3:5"], catch_exceptions=False
    )
    assert result.exit_code == 0, result.output
    (part,) = read_recording(recorded, Window(3, 5)).segments
    table = pq.read_table(out)
    assert table["index"].to_numpy().tolist() == part.index.tolist()
    assert table["ax"].to_numpy().tolist() == part.samples.ax.tolist()


@pytest.mark.parametrize("window", ["5", "5:3", "a:b", ":", "-1:4", "2:2"])
def test_windows_that_are_none(recorded: Path, tmp_path: Path, window: str) -> None:
    asked = [str(recorded), "--out", str(tmp_path / "x.parquet"), "--window", window]
    result = CliRunner().invoke(export, asked)
    if window == ":":
        assert result.exit_code == 0
        return
    assert result.exit_code == 2
    assert "give two times in seconds" in result.output
