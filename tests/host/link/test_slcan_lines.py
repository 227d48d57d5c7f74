"""Lines of an SLCAN adapter (Lawicel's protocol: t iii n dd.., ended by CR), whole and damaged."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from impid_host.link.slcan_lines import CheckedLines, well_formed

GOOD = [b"t11080011223344556677\r", b"t10021A2b\r", b"T0000011010F\r", b"r1238\r", b"t1000\r"]


class Port:
    """Gives its bytes in pieces of any size."""

    def __init__(self, pieces: list[bytes]) -> None:
        self.pieces = pieces

    @property
    def in_waiting(self) -> int:
        return len(self.pieces[0]) if self.pieces else 0

    def read(self, size: int) -> bytes:
        return self.pieces.pop(0) if self.pieces else b""


def read_all(stream: bytes, cut: int) -> bytes:
    lines, got = CheckedLines(Port([stream[at : at + cut] for at in range(0, len(stream), cut)])), b""
    for _ in range(len(stream) + 1):
        got += lines.read(1 << 16)
    return got


@pytest.mark.parametrize("line", [*GOOD, b"\r", b"z\r", b"V1013\r", b"\a"])
def test_what_an_adapter_says_is_passed_on(line: bytes) -> None:
    assert well_formed(line)


@pytest.mark.parametrize("line", GOOD)
def test_a_byte_more_or_less_is_seen(line: bytes) -> None:
    for at in range(1, len(line) - 1):
        longer, shorter = line[:at] + line[at : at + 1] + line[at:], line[:at] + line[at + 1 :]
        for damaged in (longer, shorter):
            assert damaged == line or not well_formed(damaged) or int_length(damaged) == digits(damaged)


def digits(line: bytes) -> int:
    """Data digits of a line that reads as a frame, by hand."""
    return len(line) - 1 - (5 if line[:1] in b"tr" else 10)


def int_length(line: bytes) -> int:
    """Data digits that its length digit announces."""
    return 0 if line[:1] in b"rR" else 2 * int(line[4:5] if line[:1] == b"t" else line[9:10])


@given(st.lists(st.sampled_from([*GOOD, b"\r", b"z\r"]), max_size=20), st.integers(1, 30))
def test_cut_into_any_pieces_the_lines_are_the_same(lines: list[bytes], cut: int) -> None:
    assert read_all(b"".join(lines), cut) == b"".join(lines)


@given(st.binary(max_size=200), st.integers(1, 30))
def test_of_any_bytes_only_whole_frames_remain(noise: bytes, cut: int) -> None:
    for line in re.findall(rb"[^\r\a]*[\r\a]", read_all(noise, cut)):
        assert line[:1] not in (b"t", b"T", b"r", b"R") or re.fullmatch(rb"[tTrR][0-9A-Fa-f]+\r", line)
