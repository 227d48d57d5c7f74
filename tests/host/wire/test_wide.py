"""A sensor with three axes of 24-bit codes, over both carriers; the streams are made by public libraries from
the message set alone (cantools, cobs, zlib)."""

import zlib
from itertools import pairwise
from pathlib import Path

import cantools
import cantools.database.can
import numpy as np
import pytest
from cobs import cobs
from impid_host.samples import DeviceSamples
from impid_host.study.device_csv import read_device_samples, write_device_samples
from impid_host.wire.can import CanDecoder
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.records import Segment, join_segments

DBC: cantools.database.can.Database = cantools.database.load_file(  # type: ignore[assignment]
    Path(__file__).resolve().parents[3] / "protocol" / "impid.dbc"
)
FINE = 1 << 5
FIRST = 0xFFFFFFF8  # the index wraps on the way
BOOT_US = 7_000_000


def pack(message: str, **signals: int) -> bytes:
    return bytes(DBC.encode_message(message, signals, scaling=False))


def rows(count: int, seed: int = 3) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    codes = {name: rng.integers(0, 1 << 24, count) for name in ("ax", "ay", "az")}
    return codes | {name: rng.integers(-(2**31), 2**31, count) for name in ("enc1", "enc2")}


def messages(sample: dict[str, int], index: int) -> tuple[bytes, bytes, bytes]:
    """ACCEL, ENCODER and ACCEL_FINE of one sample."""
    enc1, enc2 = sample["enc1"] % 2**32, sample["enc2"] % 2**32
    accel = pack(
        "ACCEL", ax=sample["ax"] >> 8, ay=sample["ay"] >> 8, index_low16=index % 2**16, flags=FINE,
        enc1_high4=enc1 >> 28, enc2_high4=enc2 >> 28,
    )  # fmt: skip
    encoder = pack("ENCODER", enc1_low28=enc1 % 2**28, enc2_low28=enc2 % 2**28, index_low8=index % 2**8)
    fine = pack(
        "ACCEL_FINE", az_high16=sample["az"] >> 8, ax_low8=sample["ax"] % 256, ay_low8=sample["ay"] % 256,
        az_low8=sample["az"] % 256, index_low16=index % 2**16, reserved=0,
    )  # fmt: skip
    return accel, encoder, fine


def each(table: dict[str, np.ndarray]) -> list[dict[str, int]]:
    return [{name: int(column[i]) for name, column in table.items()} for i in range(len(table["ax"]))]


def serial_frame(records: bytes, kind: int, **header: int) -> bytes:
    fields = {"version": 1, "boot_id": 5, "frame_seq": 0, "flags": 0} | header
    raw = pack("BATCH", kind=kind, **fields) + records
    return bytes(cobs.encode(raw + zlib.crc32(raw).to_bytes(4, "little"))) + b"\0"


def frames(table: dict[str, np.ndarray]) -> list[tuple[int, bytes]]:
    """The CAN frames of a stream, TIME and EPOCH first."""
    identifiers = {
        name: DBC.get_message_by_name(name).frame_id for name in ("ACCEL", "ENCODER", "ACCEL_FINE")
    }
    time = pack("TIME", t_us=BOOT_US, index_low16=FIRST % 2**16)
    epoch = pack("EPOCH", index=FIRST, boot_id=5, version=1, reserved=0)
    out = [
        (DBC.get_message_by_name("TIME").frame_id, time),
        (DBC.get_message_by_name("EPOCH").frame_id, epoch),
    ]
    for i, sample in enumerate(each(table)):
        accel, encoder, fine = messages(sample, (FIRST + i) % 2**32)
        out += [
            (identifiers["ACCEL_FINE"], fine),
            (identifiers["ACCEL"], accel),
            (identifiers["ENCODER"], encoder),
        ]
    return out


def decoded(sent: list[tuple[int, bytes]], pieces: list[int]) -> tuple[tuple[Segment, ...], CanDecoder]:
    """The segments of a bus whose frames arrive in pieces that end there."""
    decoder, segments = CanDecoder(), list[Segment]()
    for start, stop in pairwise([0, *pieces, len(sent)]):
        part = sent[start:stop]
        identifiers = np.array([identifier for identifier, _ in part], dtype=np.uint16)
        words = np.frombuffer(b"".join(data for _, data in part), dtype="<u8")
        segments += decoder.feed(identifiers, words).segments
    return join_segments(segments), decoder


def same(
    samples: DeviceSamples, table: dict[str, np.ndarray], keep: np.ndarray | slice = slice(None)
) -> None:
    for name, column in table.items():
        assert getattr(samples, name).tolist() == column[keep].tolist(), name
    assert set(samples.flags.tolist()) <= {0}  # that the codes are wide is not the reader's business


def test_serial_records_of_24_bytes() -> None:
    table = rows(30)
    wire = b""
    for first in range(0, 30, 10):
        records = b"".join(
            b"".join(messages(s, FIRST + first + i)) for i, s in enumerate(each(table)[first : first + 10])
        )
        index = (FIRST + first) % 2**32
        wire += serial_frame(
            records, 5, count=10, first_index=index, t0_us=BOOT_US + 1000 * first, frame_seq=first // 10
        )
    got = SerialDecoder().feed(wire)
    (segment,) = join_segments(list(got.segments))
    same(segment.samples, table)
    assert segment.samples.t_us.tolist() == [BOOT_US + 1000 * i for i in range(30)]
    assert segment.samples.ax.dtype == np.uint32


def test_a_narrow_board_after_a_wide_one_on_the_same_line() -> None:
    """Another firmware after an update: a run of its own, with codes of its own."""
    table = rows(4)
    wide = b"".join(b"".join(messages(s, i)) for i, s in enumerate(each(table)))
    narrow = b"".join(
        pack("ACCEL", ax=100 + i, ay=200, index_low16=i, flags=0, enc1_high4=0, enc2_high4=0)
        + pack("ENCODER", enc1_low28=i, enc2_low28=0, index_low8=i)
        for i in range(3)
    )
    wire = serial_frame(wide, 5, count=4, first_index=0, t0_us=0)
    wire += serial_frame(narrow, 1, count=3, first_index=0, t0_us=9000, boot_id=6, frame_seq=1)
    first, second = SerialDecoder().feed(wire).segments
    same(first.samples, table)
    assert second.samples.az is None
    assert second.samples.ax.tolist() == [100, 101, 102]
    assert second.samples.ax.dtype == np.uint16


@pytest.mark.parametrize("seed", range(6))
def test_can_frames_in_any_pieces(seed: int) -> None:
    table = rows(40)
    sent = frames(table)
    cuts = sorted(np.random.default_rng(seed).choice(len(sent), 25, replace=False).tolist())
    (segment,), decoder = decoded(sent, cuts)
    same(segment.samples, table)
    assert (decoder.counts.bad_frames, decoder.counts.good_frames) == (0, len(sent))


def test_every_frame_alone() -> None:
    table = rows(12)
    sent = frames(table)
    (segment,), _ = decoded(sent, list(range(1, len(sent))))
    same(segment.samples, table)


@pytest.mark.parametrize("which", ["ACCEL_FINE", "ACCEL", "ENCODER"])
def test_a_lost_frame_costs_its_sample_and_no_other(which: str) -> None:
    table = rows(20)
    sent = frames(table)
    lost = 2 + 3 * 7 + {"ACCEL_FINE": 0, "ACCEL": 1, "ENCODER": 2}[which]
    (segment,), decoder = decoded(sent[:lost] + sent[lost + 1 :], [])
    keep = np.arange(20) != 7
    same(segment.samples, table, keep)
    assert decoder.counts.lost == 1
    assert decoder.counts.bad_frames == (2 if which == "ACCEL_FINE" else 1)


def test_the_first_fine_frame_lost() -> None:
    """Nothing wide has been seen yet: the sample still says that it lacks something."""
    table = rows(5)
    sent = frames(table)
    (segment,), _ = decoded(sent[:2] + sent[3:], [])
    same(segment.samples, table, slice(1, None))


def test_a_study_keeps_the_third_axis(tmp_path: Path) -> None:
    table = rows(6)
    (segment,), _ = decoded(frames(table), [])
    write_device_samples(segment.samples, tmp_path / "device.csv")
    assert (tmp_path / "device.csv").read_text().splitlines()[0].split(",") == [
        "t_us", "seq", "ax", "ay", "enc1", "enc2", "flags", "az",
    ]  # fmt: skip
    back = read_device_samples(tmp_path / "device.csv")
    assert isinstance(back, DeviceSamples)
    same(back, table)
