"""Shifts and masks against cantools itself."""

from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from cobs import cobs
from impid_host.wire.frame import Header, encode_command, encode_frame
from impid_host.wire.messages import HEADER, KIND, OPCODE, MessageLayout, choices

DATABASE: Any = cantools.database.load_file(Path(__file__).resolve().parents[3] / "protocol" / "impid.dbc")
EIGHT_BYTES = [m.name for m in DATABASE.messages if m.length == 8]


@pytest.mark.parametrize("name", EIGHT_BYTES)
def test_unpack_is_what_cantools_decodes(name: str) -> None:
    message = DATABASE.get_message_by_name(name)
    rng = np.random.default_rng(3)
    data = [bytes(8), b"\xff" * 8, *(rng.bytes(8) for _ in range(200))]
    words = np.frombuffer(b"".join(data), dtype="<u8")
    got = MessageLayout.of(name).unpack(words)
    for row, payload in enumerate(data):
        want = message.decode(payload, decode_choices=False)
        assert {signal: int(values[row]) for signal, values in got.items()} == want


@pytest.mark.parametrize("name", EIGHT_BYTES)
def test_pack_is_what_cantools_encodes(name: str) -> None:
    message = DATABASE.get_message_by_name(name)
    rng = np.random.default_rng(4)
    for _ in range(50):
        values = {s.name: int(rng.integers(0, 1 << s.length, dtype=np.uint64)) for s in message.signals}
        word = MessageLayout.of(name).pack(**values)
        assert word.astype("<u8").tobytes() == message.encode(values)


def test_header_dtype_is_the_dbc_message() -> None:
    message = DATABASE.get_message_by_name("BATCH")
    values = {"kind": 1, "version": 1, "boot_id": 0xBEEF, "frame_seq": 65535, "count": 10, "flags": 3}
    values |= {"first_index": 2**32 - 7, "t0_us": 2**63 + 11}
    payload = Header(**values).to_bytes()
    assert payload == message.encode(values)
    assert {n: int(np.frombuffer(payload, HEADER)[0][n]) for n in HEADER.names} == values


def test_names_of_values_are_those_of_the_dbc() -> None:
    for message in DATABASE.messages:
        for signal in message.signals:
            named = {str(name): number for number, name in (signal.choices or {}).items()}
            assert choices(message.name, signal.name) == named


def test_a_message_that_is_no_word_is_refused() -> None:
    with pytest.raises(ValueError, match="BATCH is 20 bytes long"):
        MessageLayout.of("BATCH")


def test_command_frame_by_hand() -> None:
    """Written out from the format: header of 20 bytes, record of 8, CRC-32 of both, COBS, zero."""
    raw = cobs.decode(encode_command(0x1234, OPCODE["START"], 5, 0xAABBCCDD)[:-1])
    assert raw[:20] == bytes([16, 1, 0, 0, 0, 0, 1, 0]) + bytes(12)
    assert raw[20:28] == bytes([0x34, 0x12, 2, 5, 0xDD, 0xCC, 0xBB, 0xAA])
    assert len(raw) == 32


def test_records_must_fit_the_header() -> None:
    with pytest.raises(ValueError, match="not 2 records"):
        encode_frame(Header(kind=KIND["SAMPLES"], count=2), bytes(31))
