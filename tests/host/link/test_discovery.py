"""`--port auto` and the speed of the line, with a pseudo-terminal where the ST-LINK would be."""

from dataclasses import dataclass

import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.errors import LinkError
from impid_host.link.address import AUTO, Address
from impid_host.link.client import BoardClient
from impid_host.link.discovery import BAUDS, find_port
from impid_host.link.port import SerialLink
from serial.tools import list_ports

from tests.host.recording.boards import PtyBoard

ST_LINK_V2_1 = (0x0483, 0x374B)  # as lsusb shows a Nucleo-F446RE
ARDUINO = (0x2341, 0x0043)


@dataclass
class Port:
    """What pyserial tells of a port."""

    device: str
    vid: int | None = None
    pid: int | None = None


def board_at(device: str, identity: tuple[int, int] = ST_LINK_V2_1) -> Port:
    return Port(device, *identity)


def test_the_one_board_is_found_among_other_ports() -> None:
    present = [Port("/dev/ttyS0"), board_at("/dev/ttyACM1", ARDUINO), board_at("/dev/ttyACM0")]
    assert find_port(present) == "/dev/ttyACM0"


@pytest.mark.parametrize(
    ("present", "words"),
    [
        ([], "no board was found by its USB id .* ports on this machine: none"),
        (
            [board_at("/dev/ttyACM1", ARDUINO)],
            "ports on this machine: /dev/ttyACM1; .* name the port with --port",
        ),
        (
            [board_at("/dev/ttyACM3"), board_at("/dev/ttyACM0")],
            "several .*: /dev/ttyACM0, /dev/ttyACM3; name one",
        ),
    ],
)
def test_none_or_several_are_refused_with_the_remedy(present: list[Port], words: str) -> None:
    with pytest.raises(LinkError, match=words):
        find_port(present)


@pytest.mark.parametrize("baud", [921600, 460800, 115200])
def test_auto_finds_the_port_and_its_speed(monkeypatch: pytest.MonkeyPatch, baud: int) -> None:
    """At any other speed the board and its host read noise, as on a line."""
    board = PtyBoard(baud=baud)
    monkeypatch.setattr(list_ports, "comports", lambda: [Port("/dev/ttyS0"), board_at(board.port)])
    try:
        address = Address(port=AUTO)
        client = BoardClient(address.open())
        assert address.baud == baud
        assert client.info().boot_id == 77
        client.close()
    finally:
        board.close()


def test_auto_follows_a_board_that_comes_back_under_another_name(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = PtyBoard(), PtyBoard()
    present = [board_at(first.port)]
    monkeypatch.setattr(list_ports, "comports", lambda: present)
    address = Address(port=AUTO)
    try:
        link = address.open()
        link.close()
        assert link.name == first.port
        present[:] = [board_at(second.port)]
        link = address.open()
        link.close()
        assert link.name == second.port
    finally:
        first.close()
        second.close()


def test_every_command_takes_auto(monkeypatch: pytest.MonkeyPatch) -> None:
    board = PtyBoard()
    monkeypatch.setattr(list_ports, "comports", lambda: [board_at(board.port)])
    try:
        said = CliRunner().invoke(cli, ["device", "info", "--port", "auto"])
    finally:
        board.close()
    assert said.exit_code == 0, said.output
    assert "boot_id            77" in said.output


def test_a_port_where_nobody_understands_names_the_speeds_tried() -> None:
    board = PtyBoard(baud=57600)
    try:
        with pytest.raises(LinkError, match=f"no answer from a board at any of the speeds {BAUDS[0]}, "):
            Address(port=board.port).open()
        with SerialLink.open(board.port, 57600) as link:
            assert BoardClient(link).info().boot_id == 77
    finally:
        board.close()
