"""The bytes that the C side writes, against public libraries, closed forms of the inputs, and themselves."""

import json
import re
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.protocol import framing_reference as reference

GOLDEN = Path(__file__).with_name("golden")
TAPS_HEADER = Path(__file__).resolve().parents[2] / "firmware" / "core" / "impid_decimator_taps.h"
FIRST_INDEX = 2**32 - 16
START_US = 2**32 - 50_000
START_TICK, STOP_TICK, STALL_FROM, STALL_TO, RING = 10, 690, 200, 500, 256


@pytest.fixture(scope="module")
def frames() -> list[reference.Frame]:
    chunks = (GOLDEN / "serial.bin").read_bytes().split(b"\0")
    assert chunks.pop() == b""
    return [reference.decode(chunk) for chunk in chunks]


def samples_of(frames: list[reference.Frame]) -> dict[str, np.ndarray]:
    """Index and time counted on from each header, and the fields of every sample."""
    rows = [
        ((f.header["first_index"] + i) % 2**32, f.header["t0_us"] + 1000 * i, record)
        for f in frames
        if f.header["kind"] == 1
        for i, record in enumerate(f.records)
    ]
    columns = {
        "index": np.array([index for index, _, _ in rows]),
        "t_us": np.array([t for _, t, _ in rows]),
        "enc1": np.array([reference.encoder_count(r["enc1_high4"], r["enc1_low28"]) for *_, r in rows]),
        "enc2": np.array([reference.encoder_count(r["enc2_high4"], r["enc2_low28"]) for *_, r in rows]),
    }
    return columns | {
        name: np.array([r[name] for *_, r in rows])
        for name in ("ax", "ay", "flags", "index_low16", "index_low8")
    }


def delivered_ticks() -> np.ndarray:
    """The ticks whose samples arrive: sampled from 11 to 690, less what the full ring refused, given as the
    tick of the sample's instant, two before it left."""
    sampled = np.arange(START_TICK + 1, STOP_TICK + 1)
    stalled = (sampled >= STALL_FROM) & (sampled < STALL_TO)
    refused = stalled & (sampled >= STALL_FROM + RING)
    # The tick after the stall is pushed before the main loop runs again, onto the full ring.
    refused |= sampled == STALL_TO
    return sampled[~refused] - 2


def adc_codes(ticks: int) -> np.ndarray:
    """Conversions of both axes, shape (8 * ticks, 2): the formulas of vectors.c."""
    n = np.arange(8 * ticks)
    x = 500 + (n * n) % 2**32 % 3001
    y = np.where(n // 8 == 120, 4095, 3900 - (5 * n) % 3701)
    return np.stack([x, y], axis=1)


def test_c_side_still_writes_the_committed_bytes(vectors: Path, tmp_path: Path) -> None:
    subprocess.run([str(vectors), "write", str(tmp_path)], check=True)
    written = sorted(path.name for path in tmp_path.iterdir())
    assert written == ["can.bin", "serial.bin", "serial.json"]
    for name in written:
        assert (tmp_path / name).read_bytes() == (GOLDEN / name).read_bytes(), name


def test_c_parser_and_public_libraries_agree(frames: list[reference.Frame]) -> None:
    expected = json.loads((GOLDEN / "serial.json").read_text())
    assert (expected["damaged"], expected["foreign"]) == (0, 0)
    assert len(expected["frames"]) == len(frames)
    for theirs, frame in zip(expected["frames"], frames, strict=True):
        for name in ("kind", "version", "boot_id", "frame_seq", "flags", "first_index", "t0_us"):
            assert theirs[name] == frame.header[name], name
        assert len(theirs["records"]) == frame.header["count"]
        if frame.header["kind"] != 1:
            continue
        for record, fields in zip(theirs["records"], frame.records, strict=True):
            assert record["enc1"] == reference.encoder_count(fields["enc1_high4"], fields["enc1_low28"])
            assert record["enc2"] == reference.encoder_count(fields["enc2_high4"], fields["enc2_low28"])
            assert [record[k] for k in ("ax", "ay", "flags")] == [fields[k] for k in ("ax", "ay", "flags")]


def test_frames_are_numbered_without_a_gap(frames: list[reference.Frame]) -> None:
    assert [frame.header["frame_seq"] for frame in frames] == list(range(len(frames)))
    assert {frame.header["boot_id"] for frame in frames} == {0xBEEF}


def test_samples_carry_index_time_and_encoders_of_their_instant(frames: list[reference.Frame]) -> None:
    samples = samples_of(frames)
    ticks = delivered_ticks()
    np.testing.assert_array_equal(samples["t_us"], START_US + 1000 * ticks)
    np.testing.assert_array_equal(samples["index"], (FIRST_INDEX + ticks - ticks[0]) % 2**32)
    np.testing.assert_array_equal(samples["enc1"], (1000003 * ticks) % 2**32 - 2**31)
    np.testing.assert_array_equal(samples["enc2"], -7 * ticks)
    np.testing.assert_array_equal(samples["index_low16"], samples["index"] % 2**16)
    np.testing.assert_array_equal(samples["index_low8"], samples["index"] % 2**8)


def test_acceleration_is_the_filtered_input(frames: list[reference.Frame]) -> None:
    samples = samples_of(frames)
    taps = [int(t) for t in re.findall(r"-?\d+", TAPS_HEADER.read_text().split("TAP_VALUES")[1])]
    assert len(taps) == 28
    codes = adc_codes(STOP_TICK + 1)
    last = 8 * (delivered_ticks() + 2) + 7  # the last conversion of the tick at which the sample left
    for axis, name in enumerate(("ax", "ay")):
        filtered = np.convolve(codes[:, axis], taps)[last] / 2**16 * 16
        np.testing.assert_array_equal(samples[name], np.clip(np.floor(filtered + 0.5), 0, 65535))


def test_flags_tell_the_faults_of_their_instant(frames: list[reference.Frame]) -> None:
    samples = samples_of(frames)
    ticks = delivered_ticks()
    flags = dict(zip(ticks.tolist(), samples["flags"].tolist(), strict=True))
    at_a_rail = (adc_codes(STOP_TICK + 1) == 4095).any(axis=1)
    windows = {t: at_a_rail[8 * (t + 2) + 7 - 27 : 8 * (t + 2) + 8].any() for t in flags}
    expected = {t: int(saturated) for t, saturated in windows.items()}
    for tick, bit in ((60, 1), (80, 2), (int(ticks[0]), 3), (70, 4)):
        expected[tick] |= 1 << bit
    assert flags == expected
    assert sum(expected.values()) > 30  # the session does contain them


def test_what_is_lost_is_counted_and_announced(frames: list[reference.Frame]) -> None:
    lost = STALL_TO - (STALL_FROM + RING) + 1
    status = [f.records[0] for f in frames if f.header["kind"] == 2][-1]
    assert status["ring_lost"] == lost
    samples = samples_of(frames)
    assert len(samples["index"]) + lost == STOP_TICK - START_TICK
    stop = [f.records[0] for f in frames if f.header["kind"] == 3][-1]
    assert (stop["opcode"], stop["value"]) == (3, STOP_TICK - START_TICK)
    batches = [f for f in frames if f.header["kind"] == 1]
    gaps = [
        (b.header["first_index"] - a.header["first_index"] - a.header["count"]) % 2**32
        for a, b in pairwise(batches)
    ]
    assert [gap for gap in gaps if gap] == [lost]
    assert [b.header["flags"] for b in batches[1:]] == [int(gap > 0) for gap in gaps]


def test_answers(frames: list[reference.Frame]) -> None:
    answers = [tuple(f.records[0].values()) for f in frames if f.header["kind"] == 3]
    assert answers == [
        (10, 2, 0, FIRST_INDEX),
        (160, 1, 0, 2006),
        (170, 99, 1, 0),
        (690, 3, 0, STOP_TICK - START_TICK),
    ]
    (pong,) = [f.records[0] for f in frames if f.header["kind"] == 4]
    assert pong == {"request_id": 150, "hold_us": 0, "t2_us": (START_US + 150_000 + 123) % 2**32}


def test_status_comes_ten_times_a_second(frames: list[reference.Frame]) -> None:
    times = [f.header["t0_us"] - START_US for f in frames if f.header["kind"] == 2]
    assert times == [100_000, 200_000 + 300_000, 600_000]  # none while the main loop stalls, no burst after


def test_can_carries_the_same_samples(frames: list[reference.Frame]) -> None:
    data = (GOLDEN / "can.bin").read_bytes()
    assert len(data) % 11 == 0
    names = {message.frame_id: message.name for message in reference.DBC.messages}
    stream = [data[i : i + 11] for i in range(0, len(data), 11)]
    rows, clocks, pending, when = list[Any](), list[Any](), dict[Any, Any](), dict[Any, Any]()
    for frame in stream:
        name = names[int.from_bytes(frame[:2], "little")]
        assert frame[2] == 8
        fields = reference.unpack(name, frame[3:])
        if name == "TIME":
            when = fields
        elif name == "EPOCH":
            clocks.append((len(rows), fields["index"], when["t_us"]))
            assert fields["index"] % 2**16 == when["index_low16"]
            assert (fields["boot_id"], fields["version"]) == (0xBEEF, 1)
        elif name == "ACCEL":
            pending = fields
        elif name == "ENCODER":
            assert fields["index_low8"] == pending["index_low16"] % 256
            rows.append(pending | fields)
    samples = samples_of(frames)
    for name in ("ax", "ay", "index_low16"):
        np.testing.assert_array_equal([row[name] for row in rows], samples[name])
    np.testing.assert_array_equal(
        [reference.encoder_count(r["enc1_high4"], r["enc1_low28"]) for r in rows], samples["enc1"]
    )
    assert [row for row, _, _ in clocks] == list(range(0, len(rows), 100))
    for row, index, t_us in clocks:
        assert (index, t_us) == (samples["index"][row], samples["t_us"][row])
