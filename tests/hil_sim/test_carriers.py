"""Terminals, TCP and buses: bytes both ways, losses counted, a cable that goes and comes back."""

import os
import select
import socket
from typing import Any

import can
import pytest
import serial

from hil_sim.carriers.backlog import CAPACITY_BYTES
from hil_sim.carriers.bus import BusCarrier
from hil_sim.carriers.pty import PtyCarrier
from hil_sim.carriers.tcp import TcpCarrier
from hil_sim.errors import SimError


@pytest.fixture(params=["pty", "tcp"])
def carrier(request, tmp_path):
    carrier = PtyCarrier(tmp_path / "tty") if request.param == "pty" else TcpCarrier()
    yield carrier
    carrier.close()


def open_client(carrier, tmp_path):
    link = tmp_path / "tty"
    return serial.serial_for_url(str(link) if link.is_symlink() else carrier.address, 921600, timeout=0.2)


def await_client(carrier):
    for _ in range(100):
        carrier.receive(0.01)
        if carrier.connected:
            return
    raise AssertionError("no client seen")


def test_bytes_pass_unchanged_both_ways(carrier, tmp_path):
    everything = bytes(range(256))
    assert not carrier.connected
    carrier.send(b"to nobody")
    with open_client(carrier, tmp_path) as client:
        client.write(everything)
        got = b""
        while len(got) < 256:
            got += carrier.receive(1.0)
        assert got == everything
        assert carrier.connected
        carrier.send(everything)
        assert client.read(256) == everything
    for _ in range(10):
        carrier.receive(0.01)
    assert not carrier.connected
    assert carrier.dropped == 0


def test_what_a_client_does_not_read_is_counted_to_the_byte(carrier, tmp_path):
    with open_client(carrier, tmp_path) as client:
        await_client(carrier)
        piece = bytes(range(250)) * 40
        sent = 0
        while carrier.dropped == 0:
            carrier.send(piece)
            sent += len(piece)
        for _ in range(5):
            carrier.send(piece)
            sent += len(piece)
        got = 0
        while select.select([client.fileno()], [], [], 0.2)[0]:
            got += len(os.read(client.fileno(), 65536))
            carrier.receive(0.0)
        assert got > CAPACITY_BYTES
        assert got + carrier.dropped == sent


def test_a_pulled_cable_ends_the_connection_and_comes_back_at_the_same_address(carrier, tmp_path):
    address = str(tmp_path / "tty") if isinstance(carrier, PtyCarrier) else carrier.address
    client = open_client(carrier, tmp_path)
    await_client(carrier)
    carrier.pull()
    assert not carrier.connected
    with pytest.raises((OSError, serial.SerialException)):
        for _ in range(3):
            client.read(1)
            client.write(b"x")
    client.close()
    with pytest.raises((OSError, serial.SerialException)):
        serial.serial_for_url(address, 921600)
    assert carrier.receive(0.0) == b""
    carrier.send(b"lost")
    carrier.plug()
    with serial.serial_for_url(address, 921600, timeout=0.2) as again:
        again.write(b"hello")
        await_client(carrier)
        carrier.send(b"world")
        assert again.read(5) == b"world"


def test_a_second_tcp_client_is_turned_away():
    carrier = TcpCarrier()
    host, port = carrier.address.removeprefix("socket://").split(":")
    with socket.create_connection((host, int(port))) as first:
        await_client(carrier)
        with socket.create_connection((host, int(port))) as second:
            carrier.receive(0.1)
            assert second.recv(1) == b""
        carrier.send(b"still here")
        assert first.recv(100) == b"still here"
    carrier.close()


def test_a_port_in_use_is_refused():
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(SimError, match="choose another --address"),
    ):
        TcpCarrier("127.0.0.1", taken.getsockname()[1])


def test_udp_multicast_carries_frames_both_ways():
    carrier = BusCarrier("udp_multicast", "239.74.163.2", port=43191)
    assert not carrier.connected
    config: dict[str, Any] = carrier.config
    with can.Bus(**config) as host:
        host.send(can.Message(arbitration_id=0x100, data=b"12345678", is_extended_id=False))
        host.send(can.Message(arbitration_id=0x100, data=b"other", is_extended_id=True))
        assert carrier.receive(2.0) == [(0x100, b"12345678")]
        assert carrier.connected
        carrier.send([(0x110, b"abc"), (0x111, b"")])
        got = [host.recv(2.0) for _ in range(4)]  # its own two first: multicast echoes
        assert [(m.arbitration_id, bytes(m.data)) for m in got[2:]] == [(0x110, b"abc"), (0x111, b"")]
        assert carrier.receive(0.1) == []  # the carrier does not hear itself
        carrier.pull()
        carrier.send([(0x110, b"lost")])
        assert carrier.receive(0.0) == []
        assert host.recv(0.2) is None
        carrier.plug()
        carrier.send([(0x110, b"back")])
        assert bytes(host.recv(2.0).data) == b"back"
    carrier.close()


@pytest.mark.parametrize(
    ("interface", "channel", "remedy"),
    [("socketcan", "nocan9", "ip link add"), ("udp_multicast", "192.0.2.1", "multicast group")],
)
def test_a_bus_that_is_not_there_is_refused_with_what_to_do(interface, channel, remedy):
    with pytest.raises(SimError, match=remedy) as refusal:
        BusCarrier(interface, channel)
    assert str(refusal.value).startswith(f"{channel}: no {interface} here")
    assert "\n" not in str(refusal.value)
