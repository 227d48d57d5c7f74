"""The simulated CAN adapter: against python-can's own driver, and by the manual's words."""

import threading
import time

import can
import pytest
import serial
from can.interfaces.slcan import slcanBus

from hil_sim.carriers.pty import PtyCarrier
from hil_sim.carriers.slcan import SlcanCarrier


@pytest.fixture
def adapter():
    adapter = SlcanCarrier(PtyCarrier())
    yield adapter
    adapter.close()


@pytest.fixture
def turning(adapter):
    """The adapter at work in a thread of its own; the frames that it put on the bus."""
    frames, stop = [], threading.Event()

    def turn():
        while not stop.is_set():
            frames.extend(adapter.receive(0.01))

    thread = threading.Thread(target=turn)
    thread.start()
    yield frames
    stop.set()
    thread.join()


def talk(adapter, port, text):
    """What the adapter answers to the bytes of one command."""
    port.write(text)
    time.sleep(0.01)
    frames = adapter.receive(0.1)
    return port.read(100), frames


def await_count(frames, count):
    end = time.monotonic() + 5.0
    while len(frames) < count and time.monotonic() < end:
        time.sleep(0.005)
    assert len(frames) == count


def test_python_can_sends_and_receives(adapter, turning):
    with can.Bus(**adapter.config, sleep_after_open=0.1) as bus:
        for number, data in ((0x100, bytes(range(8))), (0x7FF, b""), (0, b"\xff")):
            bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False))
        await_count(turning, 3)
        assert turning == [(0x100, bytes(range(8))), (0x7FF, b""), (0, b"\xff")]
        sent = [(0x110 + i, bytes([i] * (i % 9))) for i in range(200)]
        adapter.send(sent)
        got: list[tuple[int, bytes]] = []
        while len(got) < 200 and (message := bus.recv(1.0)) is not None:
            got.append((message.arbitration_id, bytes(message.data)))
        assert got == sent
        assert isinstance(bus, slcanBus)
        assert bus.get_version(1.0) == (10, 13)


def test_python_can_at_another_bit_rate_hears_nothing(adapter, turning):
    config = adapter.config | {"bitrate": 500_000}
    with can.Bus(**config, sleep_after_open=0.1) as bus:
        bus.send(can.Message(arbitration_id=0x100, data=b"1", is_extended_id=False))
        adapter.send([(0x110, b"2")])
        assert bus.recv(0.3) is None
    assert turning == []


@pytest.fixture
def port(adapter):
    with serial.Serial(adapter.address, timeout=0.05) as port:
        yield port


def test_commands_by_the_manual(adapter, port):
    """Lawicel's manual: what is answered to each command, with the channel closed and open."""
    refused: tuple[bytes, list[object]] = (b"\a", [])
    for early in (b"O\r", b"C\r", b"t1000\r", b"F\r", b"S9\r", b"S\r", b"Q\r", b"m00000000\r"):
        assert talk(adapter, port, early) == refused, early
    for closed in (b"S6\r", b"S8\r", b"s0014\r", b"Z0\r", b"M00000000\r", b"mFFFFFFFF\r", b"O\r"):
        assert talk(adapter, port, closed) == (b"\r", []), closed
    for late in (b"O\r", b"S8\r", b"s0014\r", b"Z1\r", b"mFFFFFFFF\r"):
        assert talk(adapter, port, late) == refused, late
    assert talk(adapter, port, b"t10021122\r") == (b"z\r", [(0x100, b"\x11\x22")])
    assert talk(adapter, port, b"t7ff0\r") == (b"z\r", [(0x7FF, b"")])
    assert talk(adapter, port, b"T000001000\r") == (b"Z\r", [])
    assert talk(adapter, port, b"r1008\r") == (b"z\r", [])
    for wrong in (
        b"t8000\r",
        b"t1009\r",
        b"t1001\r",
        b"t10011\r",
        b"t1001zz\r",
        b"t10001\r",
        b"t\r",
        b"t-011ff\r",
    ):
        assert talk(adapter, port, wrong) == refused, wrong
    assert talk(adapter, port, b"F\r") == (b"F00\r", [])
    assert talk(adapter, port, b"V\r") == (b"V1013\r", [])
    assert talk(adapter, port, b"\r\rt10011") == (b"\r\r", [])
    assert talk(adapter, port, b"1\r") == (b"z\r", [(0x100, b"\x11")])
    adapter.send([(0x111, b"\xab\xcd")])
    assert port.read(100) == b"t1112ABCD\r"
    assert talk(adapter, port, b"C\r") == (b"\r", [])
    adapter.send([(0x111, b"\xab\xcd")])
    assert port.read(100) == b""


def test_listen_only_hears_and_does_not_speak(adapter, port):
    assert talk(adapter, port, b"S8\rL\r") == (b"\r\r", [])
    assert talk(adapter, port, b"t1000\r") == (b"\a", [])
    adapter.send([(0x111, b"")])
    assert port.read(100) == b"t1110\r"


def test_time_stamps_count_milliseconds_of_a_minute(adapter, port):
    assert talk(adapter, port, b"S8\rZ1\rO\r") == (b"\r\r\r", [])
    adapter.send([(0x111, b"")])
    time.sleep(0.25)
    adapter.send([(0x111, b"")])
    first, second, _ = port.read(100).split(b"\r")
    assert len(first) == len(second) == len("t1110") + 4
    assert 250 <= (int(second[5:], 16) - int(first[5:], 16)) % 60000 < 350


def test_another_bit_rate_shows_as_bus_errors(adapter, port):
    assert talk(adapter, port, b"S6\rO\r") == (b"\r\r", [])
    adapter.send([(0x111, b"")])
    assert talk(adapter, port, b"F\r") == (b"F84\r", [])
    assert talk(adapter, port, b"F\r") == (b"F00\r", [])


def test_rubbish_is_thrown_away(adapter, port):
    assert talk(adapter, port, b"x" * 4000) == (b"", [])
    assert talk(adapter, port, b"x" * 4000) == (b"", [])
    assert talk(adapter, port, b"\r") == (b"\a", [])
    assert talk(adapter, port, b"V\r")[0] == b"V1013\r"


def test_a_replugged_adapter_has_forgotten_its_bit_rate(adapter):
    with serial.Serial(adapter.address, timeout=0.05) as port:
        assert talk(adapter, port, b"S8\rO\r") == (b"\r\r", [])
    adapter.pull()
    adapter.plug()
    with serial.Serial(adapter.address, timeout=0.05) as port:
        assert talk(adapter, port, b"O\r") == (b"\a", [])
