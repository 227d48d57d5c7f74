"""The same recording over CAN: through an SLCAN adapter on a terminal, and over a multicast bus."""

import socket
import time
from pathlib import Path

import can
import numpy as np
import pytest
from impid_host.errors import LinkError
from impid_host.link.address import Address
from impid_host.link.can_bus import CanLink, parse_address
from impid_host.link.client import BoardClient
from impid_host.wire.can_frames import unpack_frames
from impid_host.wire.messages import choices

from tests.host.recording.boards import CanBoard, SlcanBoard
from tests.host.recording.test_reconnect import Session, names, one_boot_is_one_clock


@pytest.fixture
def slcan():
    board = SlcanBoard()
    yield board
    board.close()


@pytest.fixture
def bus_name() -> str:
    """A port of its own: the system gives a socket what was sent to any group that somebody has joined."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        return f"udp_multicast:239.74.163.2,port={free.getsockname()[1]}"


def test_a_recording_over_an_slcan_adapter(slcan: SlcanBoard, out: Path) -> None:
    outcome, recording = Session(Address(can=f"slcan:{slcan.port}"), out).run(2.0)
    assert outcome.ending == "complete"
    assert recording.carrier == "can"
    assert recording.warnings == ()
    (ledger,) = recording.ledgers
    assert (ledger.balanced, ledger.lost, ledger.lost_before, ledger.lost_after) == (True, 0, 0, 0)
    assert ledger.produced is not None
    assert ledger.produced >= 2000
    one_boot_is_one_clock(recording)
    assert len(recording.exchanges[77]) > 10
    assert outcome.status is not None
    assert outcome.status.state == choices("STATUS_HEALTH", "state")["IDLE"]


def test_full_range_encoders_cross_the_bus(out: Path, bus_name: str) -> None:
    board = CanBoard(_bus(bus_name))
    board.ticks = 2**31 - 700  # wraps within the first second
    try:
        outcome, recording = Session(Address(can=bus_name), out).run(1.5)
    finally:
        board.close()
    (ledger,) = recording.ledgers
    assert (outcome.ending, ledger.balanced) == ("complete", True)
    s = recording.segments[0].samples
    assert np.array_equal(np.diff(s.enc1.view(np.uint32)), np.diff(s.t_us) // 1000)
    assert s.enc1.min() < 0 < s.enc1.max()


def test_a_reset_on_the_bus(out: Path, bus_name: str) -> None:
    board = CanBoard(_bus(bus_name))
    try:
        outcome, recording = Session(Address(can=bus_name), out).at(1.0, board.reset).run(2.5)
    finally:
        board.close()
    assert outcome.ending == "complete"
    assert [segment.boot_id for segment in recording.segments] == [77, 78]
    assert "boot" in names(recording)
    one_boot_is_one_clock(recording)
    assert recording.ledgers[1].balanced
    # No exchange of the new boot is booked on the old one, though the answer itself does not say which it is.
    for boot_id, exchanges in recording.exchanges.items():
        ahead = [each.t2_us - each.t1_ns / 1000 for each in exchanges]
        assert np.ptp(ahead) < 500_000, boot_id


def test_the_bus_is_cut_for_a_while(out: Path, bus_name: str) -> None:
    """Bus-off, or the plug of the bus: the adapter stays, nothing comes and nothing gets through."""
    board = CanBoard(_bus(bus_name))
    back = []

    def cut() -> None:
        board.connected = False
        time.sleep(0.6)
        board.connected = True
        back.append(time.monotonic())

    try:
        outcome, recording = Session(Address(can=bus_name), out).at(0.8, cut).run(2.5)
    finally:
        board.close()
    (ledger,) = recording.ledgers
    assert (outcome.ending, ledger.balanced) == ("complete", True)
    assert ledger.lost > 500
    one_boot_is_one_clock(recording)


def test_raw_frames_are_kept_with_their_stamps(slcan: SlcanBoard) -> None:
    with CanLink.open(f"slcan:{slcan.port}") as link:
        client = BoardClient(link)
        before = time.monotonic_ns()
        assert client.info().sample_rate_hz == 1000
        chunk = None
        while chunk is None:
            chunk = link.receive(1.0)
        frames = unpack_frames(chunk.data)
        assert len(frames) >= 1
        assert all(before < int(stamp) <= chunk.monotonic_ns for stamp in frames["monotonic_ns"])


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("slcan:/dev/no-such", "cannot be opened as a CAN bus"),
        ("nonsense:0", "cannot be opened as a CAN bus"),
        ("socketcan:no-such-can", "cannot be opened as a CAN bus"),
    ],
)
def test_buses_that_are_not_there(address: str, words: str) -> None:
    with pytest.raises(LinkError, match=words) as caught:
        CanLink.open(address)
    assert "\n" not in str(caught.value)


def test_addresses() -> None:
    assert parse_address("socketcan:can0") == ("socketcan", "can0", {"bitrate": 1_000_000})
    assert parse_address("kvaser:0@500000") == ("kvaser", "0", {"bitrate": 500_000})
    assert parse_address("udp_multicast:ff15:7079::1")[1] == "ff15:7079::1"
    assert parse_address("slcan:/dev/ttyACM0@250000,rtscts=true,timeout=0.5") == (
        "slcan",
        "/dev/ttyACM0",
        {"bitrate": 250_000, "sleep_after_open": 0.05, "rtscts": True, "timeout": 0.5},
    )
    assert parse_address("neovi") == ("neovi", None, {})


def _bus(address: str) -> can.BusABC:
    interface, channel, options = parse_address(address)
    return can.Bus(interface=interface, channel=channel, **options)
