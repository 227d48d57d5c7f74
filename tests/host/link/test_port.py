"""Ports that are there, that are not, and that go away."""

import os
import pty
import socket
import time
import tty
from pathlib import Path

import pytest
from impid_host.errors import LinkError
from impid_host.link.client import BoardClient
from impid_host.link.port import SerialLink


def collect(link: SerialLink, count: int) -> bytes:
    data = b""
    deadline = time.monotonic() + 5
    while len(data) < count and time.monotonic() < deadline:
        chunk = link.receive(0.1)
        data += chunk.data if chunk else b""
    return data


def test_a_terminal_carries_every_byte_value_both_ways() -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    everything = bytes(range(256)) * 4
    with SerialLink.open(os.ttyname(slave)) as link:
        before = time.monotonic_ns()
        os.write(master, everything)
        assert collect(link, len(everything)) == everything
        sent = link.send(everything)
        assert before < sent.monotonic_ns <= time.monotonic_ns()
        assert os.read(master, 4096) == everything
    os.close(master)
    os.close(slave)


def test_a_socket_is_read_in_pieces_not_byte_by_byte() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        SerialLink.open(f"socket://127.0.0.1:{server.getsockname()[1]}") as link,
    ):
        peer, _ = server.accept()
        peer.sendall(b"x" * 1000)
        time.sleep(0.1)
        chunk = link.receive(1.0)
        assert chunk is not None
        assert len(chunk.data) == 1000
        peer.close()
        with pytest.raises(LinkError, match="the port is gone"):
            link.receive(2.0)


def test_what_came_before_the_end_is_not_lost() -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    with SerialLink.open(os.ttyname(slave)) as link:
        os.write(master, b"last words")
        time.sleep(0.2)
        os.close(slave)
        os.close(master)
        assert collect(link, 10) == b"last words"
        for _ in range(2):
            with pytest.raises(LinkError, match="check the cable"):
                link.receive(2.0)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("/dev/no-such-port", "no such port; ports on this machine"),
        ("socket://127.0.0.1:1", "refused"),
        ("nonsense://x", "check the address"),
        ("/dev/null", "cannot be opened as a serial port"),
    ],
)
def test_ports_that_cannot_be_opened(url: str, words: str) -> None:
    with pytest.raises(LinkError, match=words) as caught:
        SerialLink.open(url)
    assert str(caught.value).startswith(url)
    assert "\n" not in str(caught.value)


def test_permission_denied_names_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: object, **__: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("serial.serialposix.os.open", denied)
    with pytest.raises(LinkError, match="permission denied; join the group"):
        SerialLink.open("/dev/ttyACM0")


def test_a_port_in_use(tmp_path: Path) -> None:
    master, slave = pty.openpty()
    with SerialLink.open(os.ttyname(slave)), pytest.raises(LinkError, match="in use by another program"):
        SerialLink.open(os.ttyname(slave))
    os.close(master)
    os.close(slave)


def test_a_port_that_answers_nothing() -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    with SerialLink.open(os.ttyname(slave)) as link:
        with pytest.raises(
            LinkError, match="no answer to INFO after 4 tries; check that this is the board's port"
        ):
            BoardClient(link).info()
        asked, deadline = b"", time.monotonic() + 5
        while len([f for f in asked.split(b"\0") if f]) < 4 and time.monotonic() < deadline:
            asked += os.read(master, 4096)
    frames = [frame for frame in asked.split(b"\0") if frame]
    assert len(frames) == 4
    assert len(set(frames)) == 1  # repeats carry the same request id
    os.close(master)
    os.close(slave)
