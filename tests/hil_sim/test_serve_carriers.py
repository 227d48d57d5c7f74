"""The same board behind every carrier, and commands that only a served board can carry out."""

import subprocess
import time
from typing import Any

import can
import numpy as np
import pytest
import serial

from hil_sim.board import layout
from hil_sim.board.wire import command

from .serving import SERVE, Client, serving

SPEED = 3


def still(content):
    """No clock errors, so that every carrier sees the same readings."""
    content["world"].pop("clocks", None)


def moving_counts(counts):
    """The counts from the first change on: the motion's own zero of time."""
    return counts[np.flatnonzero(np.diff(counts))[0] :]


def serial_counts(address):
    with serial.serial_for_url(address, 921600, timeout=0.05) as port:
        client = Client(port)
        assert client.ask("START")
        assert client.read(60.0, lambda: len(client.frames) > 100 and len(client.samples.seq) > 1500)
        assert client.reader.damaged == 0
    got = client.samples
    assert np.all(np.diff(got.seq.astype(np.int64)) == 1)
    return got.enc1


def can_counts(config):
    start = layout.database().encode_message(
        "COMMAND",
        {"request_id": 7, "opcode": layout.code("COMMAND", "opcode", "START"), "item": 0, "value": 0},
        scaling=False,
    )
    options: dict[str, Any] = {"sleep_after_open": 0.1} if config["interface"] == "slcan" else {}
    with can.Bus(**config, **options) as bus:
        bus.send(can.Message(arbitration_id=0x100, data=start, is_extended_id=False))
        encoder, accel = list[Any](), list[Any]()
        end = time.monotonic() + 60.0
        while len(encoder) < 1500 and time.monotonic() < end:
            message = bus.recv(1.0)
            if message is not None and message.arbitration_id == 0x110:
                accel.append(bytes(message.data))
            elif message is not None and message.arbitration_id == 0x111:
                encoder.append(bytes(message.data))
    payloads = np.frombuffer(b"".join(encoder), np.uint8).reshape(-1, 8)
    halves = np.frombuffer(b"".join(accel[: len(encoder)]), np.uint8).reshape(-1, 8)
    low, high = layout.unpack("ENCODER", payloads), layout.unpack("ACCEL", halves)
    assert np.all(np.diff(high["index_low16"].astype(np.int64)) == 1)
    return ((high["enc1_high4"] << np.uint64(28)) | low["enc1_low28"]).astype(np.uint32).view(np.int32)


@pytest.fixture
def expected(scenario_file):
    """Counts of the same trial over the pseudo-terminal."""
    path = scenario_file(30.0, still)
    with serving(path, "--trial", "free_01", "--speed", SPEED) as board:
        return path, moving_counts(serial_counts(board.ready["port"]))


def test_every_carrier_serves_the_same_board(expected):
    path, counts = expected
    seen = {}
    for carrier, *more in (("tcp",), ("slcan",), ("udp_multicast", "--address", ":43192")):
        with serving(path, "--trial", "free_01", "--speed", SPEED, "--carrier", carrier, *more) as board:
            ready = board.ready
            assert ready["carrier"] == carrier
            if carrier == "tcp":
                assert (ready["can"], ready["can_config"]) == (None, None)
                seen[carrier] = serial_counts(ready["port"])
            else:
                assert ready["port"] is None
                assert ready["can"].startswith(f"{carrier}:")
                seen[carrier] = can_counts(ready["can_config"])
            closed = board.end()
            assert closed["boots"][0]["samples_sent"] >= seen[carrier].size
    for carrier, every in seen.items():
        got = moving_counts(every)
        n = min(got.size, counts.size)
        assert n > 900, carrier
        assert np.array_equal(got[:n], counts[:n]), carrier


def test_reset_by_command_answers_and_boots_anew(scenario_file):
    with serving(scenario_file(30.0), "--trial", "free_01") as board:
        with serial.Serial(board.ready["port"], 921600, timeout=0.05) as port:
            client = Client(port)
            assert client.ask("START")
            client.read(60.0, lambda: len(client.samples.seq) > 300)
            before = client.frames[-1].t0_us
            assert client.ask("RESET", tries=1)
            boot = board.event("boot")
            assert (boot["boot_id"], boot["reset_cause"]) == (2, "SOFTWARE")
            old = len(client.frames)
            status = layout.code("BATCH", "kind", "STATUS")
            assert client.read(5.0, lambda: any(frame.kind == status for frame in client.frames[old:]))
            fresh = client.frames[-1]
            assert fresh.t0_us < 1_000_000 < before
            health = layout.unpack(
                "STATUS_HEALTH", np.frombuffer(fresh.records[40:48], np.uint8).reshape(1, 8)
            )
            assert health["reset_cause"] == layout.code("STATUS_HEALTH", "reset_cause", "SOFTWARE")
            assert client.ask("START")
            count = len(client.frames)
            client.read(5.0, lambda: len(client.frames) > count + 30)
            again = client.frames[count + 5 :]
            assert any(
                f.kind == layout.code("BATCH", "kind", "SAMPLES") and f.first_index < 100 for f in again
            )
        closed = board.end()
    first, second = closed["boots"]
    assert first["samples_sent"] > 300
    assert second["samples_sent"] > 0
    # The same robot clock, seen from the second boot's zero: later by the time that the first ran.
    apart = second["clock"]["robot_s_at_board_zero"] - first["clock"]["robot_s_at_board_zero"]
    assert 1e-6 * before < apart < 1e-6 * before + 0.5


def test_what_the_client_does_not_read_is_said_at_the_end(scenario_file):
    """20 s of a stream of 19 kB/s fill the 1 MiB that wait and the kernel's own buffer three times over."""
    with serving(scenario_file(200.0), "--trial", "free_01", "--speed", 25) as board:
        with serial.Serial(board.ready["port"], 921600, timeout=0.05) as port:
            port.write(command(1, "START"))
            end = time.monotonic() + 60.0
            while time.monotonic() < end and "trial-finished" not in [e["event"] for e in board.events]:
                board.event("trial-finished")
        closed = board.event("closed")
        assert board.process.wait(timeout=20) == 0
        complaint = board.process.stderr.read()
    assert closed["dropped"] > 1_000_000
    assert f"{closed['dropped']} bytes lost because the client did not read them" in complaint


def round_trips(port, count):
    """(t1, t2, t3, t4) of so many pings: seconds of this machine, microseconds of the board."""
    client, exchanges = Client(port), []
    pong = layout.code("BATCH", "kind", "PONG")
    for request in range(1, count + 1):
        before = len(client.frames)
        t1 = time.monotonic()
        port.write(command(request, "PING"))
        assert client.read(5.0, lambda seen=before: any(f.kind == pong for f in client.frames[seen:]))
        t4 = time.monotonic()
        answer = next(frame for frame in client.frames[before:] if frame.kind == pong)
        fields = layout.unpack("PONG", np.frombuffer(answer.records, np.uint8).reshape(1, 8))
        t2 = float(fields["t2_us"][0])
        exchanges.append((t1, 1e-6 * t2, 1e-6 * (t2 + float(fields["hold_us"][0])), t4))
        time.sleep(0.013)
    return np.array(exchanges)


def test_a_ping_is_as_long_on_its_way_as_its_answer(scenario_file):
    """34 bytes take 370 us each way at 92 a millisecond, and the quickest round trips hide little more."""
    with serving(scenario_file(60.0), "--trial", "free_01") as board:
        with serial.Serial(board.ready["port"], 921600, timeout=0.01) as port:
            t1, t2, t3, t4 = round_trips(port, 80).T
        board.end()
    trip = (t4 - t1) - (t3 - t2)
    assert 2 * 369e-6 < trip.min() < 2 * 369e-6 + 1e-3
    best = np.argsort(trip)[:15]
    offset = ((t2 - t1) + (t3 - t4))[best] / 2
    residual = offset - np.polyval(np.polyfit(t1[best], offset, 1), t1[best])
    assert residual.std() < 150e-6


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--carrier", "socketcan", "--address", "nocan9"], "nocan9: no socketcan here"),
        (["--carrier", "tcp", "--address", "127.0.0.1:http"], "the port must be a number"),
        (["--carrier", "tcp", "--link", "x"], "tcp has no terminal"),
        (["--carrier", "pty", "--address", "x"], "use --link"),
    ],
)
def test_a_carrier_that_cannot_be_had_is_one_line(scenario_file, arguments, words):
    result = subprocess.run(
        [*SERVE, str(scenario_file()), *arguments], capture_output=True, text=True, check=False, timeout=30
    )
    assert result.returncode == 1
    assert words in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert result.stdout == ""
