"""Faults of a served board: at the moment the schedule says, told in an event line, booked in the truth.

Times are held against the samples' own stamps and the truth's start of the motion.
"""

import json
import time
from typing import Any

import can
import numpy as np
import pytest
import serial

from hil_sim.board import layout
from hil_sim.board.wire import command
from hil_sim.errors import SimError
from hil_sim.scenarios.load import load
from hil_sim.study.write import write_study

from .serving import Client, serving

SATURATED, ENCODER_FAULT, RESET = 0x01, 0x02, 0x08
TRIAL = "free_01"


def with_faults(*faults):
    def change(content):
        content["faults"] = list(faults)

    return change


def truth_of(path):
    truth = json.loads(path.read_text())
    return truth, truth["trials"][TRIAL]["clock"]["board_us_at_start"]


def missing(seq):
    """The indices between the first and the last that are not there."""
    return np.setdiff1d(np.arange(seq[0], seq[-1] + 1), seq)


def stop_and_drain(client):
    assert client.ask("STOP")
    client.read(0.5)


def test_faults_of_sensors_board_and_log(scenario_file, tmp_path):
    path = scenario_file(
        8.0,
        with_faults(
            {"kind": "adc_saturation", "at_s": 0.5, "duration_s": 0.2, "axis": "x"},
            {"kind": "encoder_lost", "at_s": 1.0, "duration_s": 0.3, "encoder": 1},
            {"kind": "main_loop_stall", "at_s": 1.5, "duration_s": 0.4},
            {"kind": "torque_log_truncated", "at_s": 2.0},
            {"kind": "board_reset", "at_s": 3.0, "trials": ["free_02"]},
        ),
    )
    truth_path, log = tmp_path / "truth.json", tmp_path / "log.csv"
    arguments = ["--trial", TRIAL, "--speed", 3, "--truth", truth_path, "--robot-log", log]
    with serving(path, *arguments) as board:
        with serial.Serial(board.ready["port"], 921600, timeout=0.05) as port:
            client = Client(port)
            assert client.ask("START")
            cut = board.event("fault", kind="torque_log_truncated")
            client.read_to_board_time(cut["board_us"] + 300_000)
            stop_and_drain(client)
        closed = board.end()
    truth, begin_us = truth_of(truth_path)
    said = [event for event in board.events if event["event"] == "fault"]
    assert [(event["kind"], event["phase"]) for event in said] == [
        ("adc_saturation", "begin"),
        ("adc_saturation", "end"),
        ("encoder_lost", "begin"),
        ("encoder_lost", "end"),
        ("main_loop_stall", "begin"),
        ("main_loop_stall", "end"),
        ("torque_log_truncated", "begin"),
    ]
    assert [event["board_us"] - begin_us for event in said] == [round(1e6 * event["at_s"]) for event in said]
    assert truth["faults"] == closed["faults"]
    assert len(truth["faults"]) == 4

    got = client.samples
    since = (got.t_us - begin_us) / 1e3  # ms
    # 28 taps at 8 kHz reach 3.5 ms around what they give.
    saturated = since[got.flags & SATURATED != 0]
    assert 497 <= saturated[0] <= 502
    assert 698 <= saturated[-1] <= 703
    inside = (since > 505) & (since < 695)
    assert set(got.ax[inside].tolist()) == {16 * 4095}
    assert np.all(np.abs(got.ay[inside].astype(int) - 32768) < 12000)

    lost = got.flags & ENCODER_FAULT != 0
    assert np.array_equal(since[lost], np.arange(1000, 1300))
    assert set(got.enc1[lost].tolist()) == {int(got.enc1[since == 999][0])}
    assert np.unique(got.enc2[lost]).size > 100
    # Back on its line the counter goes on from where it stood.
    assert abs(int(got.enc1[since == 1300][0]) - int(got.enc1[since == 1299][0])) < 500
    assert abs(said[3]["counts"]["missed_counts"]) > 1000

    # The ring of 256 takes the first of the stall; the tick after it still finds the ring full. What the ring
    # held comes in one go, for which the port's own queue is too small: whole frames, counted too.
    gone = missing(got.seq)
    statuses = [
        frame.records for frame in client.frames if frame.kind == layout.code("BATCH", "kind", "STATUS")
    ]
    counters = np.frombuffer(statuses[-1], np.uint8).reshape(8, 8)
    assert layout.unpack("STATUS_SAMPLES", counters[:1])["ring_lost"][0] == 400 + 1 - 256
    frames_dropped = int(layout.unpack("STATUS_LINK", counters[1:2])["frames_dropped"][0])
    assert 0 < gone.size - (400 + 1 - 256) <= 10 * frames_dropped
    gone_ms = since[0] + (gone - int(got.seq[0]))
    assert gone_ms[0] >= 1498  # a tick completes the sample of two ticks before
    assert gone_ms[-1] == 1898  # the last that found the ring full
    assert gone_ms[-145] == 1898 - 144
    assert closed["boots"][0]["samples_sent"] == got.seq.size

    text = log.read_text()
    rows = said[6]["counts"]["whole_rows"]
    assert abs(rows - 2000) <= 2
    assert text.count("\n") == rows + 1
    assert 0 < len(text.rsplit("\n", 1)[1]) < 60


def test_reset_watchdog_and_brown_out_boot_the_board_at_their_time(scenario_file, tmp_path):
    faults = [
        {"kind": "board_reset", "at_s": 0.5},
        {"kind": "watchdog", "at_s": 1.4, "duration_s": 0.1},
        {"kind": "brown_out", "at_s": 2.5, "duration_s": 0.3},
    ]
    truth_path = tmp_path / "truth.json"
    arguments = ["--trial", TRIAL, "--truth", truth_path]
    received: dict[int, Any] = {}
    causes = {}
    with serving(scenario_file(8.0, with_faults(*faults)), *arguments) as board:
        with serial.Serial(board.ready["port"], 921600, timeout=0.05) as port:
            for boot_id, cause in ((1, "POWER_ON"), (2, "PIN"), (3, "WATCHDOG"), (4, "BROWN_OUT")):
                if boot_id > 1:
                    assert board.event("boot")["boot_id"] == boot_id
                    time.sleep(0.02)
                    port.reset_input_buffer()  # what the boot before had still sent
                client = Client(port)
                assert client.ask("START")
                client.read(0.45)
                health = [
                    layout.unpack(
                        "STATUS_HEALTH", np.frombuffer(frame.records[40:48], np.uint8).reshape(1, 8)
                    )
                    for frame in client.frames
                    if frame.kind == layout.code("BATCH", "kind", "STATUS")
                ]
                causes[boot_id] = {int(part["reset_cause"][0]) for part in health[-2:]}
                assert causes[boot_id] == {layout.code("STATUS_HEALTH", "reset_cause", cause)}
                received[boot_id] = client.samples
        closed = board.end()
    truth, begin_us = truth_of(truth_path)
    assert [boot["reset_cause"] for boot in truth["boots"]] == ["POWER_ON", "PIN", "WATCHDOG", "BROWN_OUT"]
    assert truth["boots"] == closed["boots"]
    # A boot's clock starts 5 ms after its fault's end, so that much motion lies before its zero.
    zero = [boot["clock"]["robot_s_at_board_zero"] for boot in truth["boots"]]
    rate = 1.0 + 1e-6 * truth["boots"][0]["clock"]["drift_ppm"]
    start = zero[0] + rate * 1e-6 * begin_us
    for boot, after_s in ((1, 0.505), (2, 1.505), (3, 2.805)):
        assert zero[boot] - start == pytest.approx(rate * after_s, abs=2e-6)
    resets = [received[boot].flags[0] & RESET for boot in (1, 2, 3, 4)]
    assert resets == [RESET] * 4
    # The counters of a freshly booted board start from zero; the joints had moved far by then.
    for boot in (2, 3, 4):
        assert abs(int(received[boot].enc1[0])) < 40_000
    assert closed["faults"][2]["begin"]["board_us"] is not None
    assert closed["faults"][2]["end"]["board_us"] is None  # the board was off


@pytest.mark.parametrize(
    ("fault", "unit"),
    [
        ({"kind": "dropped_bytes", "rate": 2e-3}, "bytes"),
        ({"kind": "duplicated_bytes", "rate": 2e-3}, "bytes"),
        ({"kind": "bit_errors", "rate": 2e-4}, "bits"),
    ],
)
def test_line_damage_loses_frames_inside_its_window_and_the_ledger_balances(
    scenario_file, tmp_path, fault, unit
):
    path = scenario_file(8.0, with_faults(fault | {"at_s": 0.5, "duration_s": 1.5}))
    truth_path = tmp_path / "truth.json"
    with serving(path, "--trial", TRIAL, "--speed", 2, "--truth", truth_path) as board:
        with serial.Serial(board.ready["port"], 921600, timeout=0.05) as port:
            client = Client(port)
            assert client.ask("START")
            over = board.event("fault", phase="end")
            client.read_to_board_time(over["board_us"] + 200_000)
            stop_and_drain(client)
        closed = board.end()
    _, begin_us = truth_of(truth_path)
    got = client.samples
    gone = missing(got.seq)
    assert gone.size > 0
    assert closed["boots"][0]["samples_sent"] == got.seq.size + gone.size
    assert closed["dropped"] == 0
    # Index and time go together: a millisecond each.
    since = (got.t_us[0] - begin_us) / 1e6 + 1e-3 * (gone - int(got.seq[0]))
    assert since.min() > 0.5 - 0.025
    assert since.max() < 2.0 + 0.001
    # 1.5 s of the stream are 29000 bytes.
    expected = fault["rate"] * 29_000 * (8 if unit == "bits" else 1)
    assert abs(over["counts"][unit] - expected) < 5 * np.sqrt(expected)
    assert client.reader.damaged > 0.5 * over["counts"][unit]


def test_a_stalled_line_delays_and_a_slow_reader_loses(scenario_file, tmp_path):
    path = scenario_file(
        8.0,
        with_faults(
            {"kind": "line_stall", "at_s": 0.5, "duration_s": 0.3},
            {
                "kind": "slow_reader",
                "at_s": 1.5,
                "duration_s": 0.5,
                "bytes_per_s": 4000.0,
                "buffer_bytes": 2000,
            },
        ),
    )
    truth_path = tmp_path / "truth.json"
    with serving(path, "--trial", TRIAL, "--truth", truth_path) as board:
        with serial.Serial(board.ready["port"], 921600, timeout=0.02) as port:
            client = Client(port)
            assert client.ask("START")
            stalled = board.event("fault", kind="line_stall", phase="begin")
            client.read(0.05)
            held = len(client.frames)
            client.read(0.1)
            assert len(client.frames) == held  # the line is dead, though the board goes on
            resumed = board.event("fault", kind="line_stall", phase="end")
            client.read_to_board_time(resumed["board_us"] + 100_000)
            assert missing(client.samples.seq).size == 0
            slow = board.event("fault", kind="slow_reader", phase="end")
            client.read_to_board_time(slow["board_us"] + 100_000)
            stop_and_drain(client)
        closed = board.end()
    assert resumed["board_us"] - stalled["board_us"] == 300_000
    per_s = 18_600 + 1000  # batches of 186 bytes, ten STATUS of about 86 and what is in their gaps
    assert resumed["counts"]["delayed_bytes"] == pytest.approx(0.3 * per_s, rel=0.08)
    assert slow["counts"]["lost_bytes"] == pytest.approx(0.5 * (per_s - 4000) - 2000, rel=0.08)
    got = client.samples
    gone = missing(got.seq)
    assert closed["boots"][0]["samples_sent"] == got.seq.size + gone.size
    # Every lost batch lacks bytes; one that lacks only some is lost whole.
    assert gone.size / 10 * 186 > 0.8 * slow["counts"]["lost_bytes"]
    _, begin_us = truth_of(truth_path)
    since = (got.t_us[0] - begin_us) / 1e6 + 1e-3 * (gone - int(got.seq[0]))
    assert since.min() > 1.5
    assert since.max() < 2.0 + 0.01  # the batch of ten in which the fault ends is lost whole


@pytest.mark.parametrize("carrier", ["pty", "tcp"])
def test_the_cable_comes_back_at_the_same_address(scenario_file, tmp_path, carrier):
    path = scenario_file(8.0, with_faults({"kind": "cable_pulled", "at_s": 0.5, "duration_s": 0.4}))
    truth_path, link = tmp_path / "truth.json", tmp_path / "tty"
    more = ["--link", link] if carrier == "pty" else ["--carrier", "tcp"]
    with serving(path, "--trial", TRIAL, "--truth", truth_path, *more) as board:
        address = str(link) if carrier == "pty" else board.ready["port"]
        before = None
        with (
            pytest.raises((OSError, serial.SerialException)),
            serial.serial_for_url(address, 921600, timeout=0.02) as port,
        ):
            before = Client(port)
            assert before.ask("START")
            before.read(10.0)
        pulled = board.event("fault", phase="begin")
        with pytest.raises((OSError, serial.SerialException)):
            serial.serial_for_url(address, 921600)
        back = board.event("fault", phase="end")
        assert back["port"] == (board.ready["port"] if carrier == "tcp" else str(link.readlink()))
        with serial.serial_for_url(address, 921600, timeout=0.02) as port:
            after = Client(port)
            after.read(0.5)
            assert after.samples.seq.size > 200  # nobody told the board to stop
            stop_and_drain(after)
        closed = board.end()
    _, begin_us = truth_of(truth_path)
    last_ms = (before.samples.t_us[-1] - begin_us) / 1e3
    first_ms = (after.samples.t_us[0] - begin_us) / 1e3
    assert 500 - 25 <= last_ms < 500
    assert first_ms >= 900 - 25
    assert (pulled["board_us"] - begin_us, back["board_us"] - begin_us) == (500_000, 900_000)
    assert [boot["boot_id"] for boot in closed["boots"]] == [1]


def can_start():
    fields = {"request_id": 7, "opcode": layout.code("COMMAND", "opcode", "START"), "item": 0, "value": 0}
    data = layout.database().encode_message("COMMAND", fields, scaling=False)
    return can.Message(arbitration_id=0x100, data=data, is_extended_id=False)


def test_bus_off_and_lost_frames_on_can(scenario_file, tmp_path):
    path = scenario_file(
        8.0,
        with_faults(
            {"kind": "bus_off", "at_s": 0.5, "duration_s": 0.3},
            {"kind": "dropped_frames", "at_s": 1.2, "duration_s": 0.4, "rate": 0.05},
            {"kind": "duplicated_frames", "at_s": 1.8, "duration_s": 0.2, "rate": 0.05},
        ),
    )
    truth_path = tmp_path / "truth.json"
    with serving(path, "--trial", TRIAL, "--carrier", "slcan", "--truth", truth_path) as board:
        frames = []
        with can.Bus(**board.ready["can_config"], sleep_after_open=0.1) as bus:
            bus.send(can_start())
            end = time.monotonic() + 3.0
            while time.monotonic() < end:
                message = bus.recv(0.1)
                if message is not None:
                    frames.append((message.arbitration_id, bytes(message.data)))
        closed = board.end()
    truth, begin_us = truth_of(truth_path)
    off, dropped, doubled = truth["faults"]
    accel = [data for number, data in frames if number == 0x110]
    index = layout.unpack("ACCEL", np.frombuffer(b"".join(accel), np.uint8).reshape(-1, 8))[
        "index_low16"
    ].astype(int)
    (time_frame,) = [data for number, data in frames if number == 0x118][:1]
    first = layout.unpack("TIME", np.frombuffer(time_frame, np.uint8).reshape(1, 8))
    index0_us = int(first["t_us"][0]) - 1000 * int(first["index_low16"][0])
    since = (index0_us + 1000 * index - begin_us) / 1e6
    # 0.3 s are 627 frames; some of them waited in the controller when it left the bus, and never were on it.
    assert 300 < off["counts"]["lost_frames"] < 627
    assert not np.any((since >= 0.5) & (since < 0.795))
    # Between the faults everything came, and only once.
    calm = index[(since > 0.81) & (since < 1.19)]
    assert np.all(np.diff(calm) == 1)
    window = index[(since >= 1.2) & (since < 1.598)]
    assert 5 <= 398 - window.size <= dropped["counts"]["frames"]
    assert np.any(np.diff(index[(since >= 1.8) & (since < 1.998)]) == 0)
    assert doubled["counts"]["frames"] > 5
    bus_status = [data for number, data in frames if number == 0x126]
    count = layout.unpack("STATUS_BUS", np.frombuffer(bus_status[-1], np.uint8).reshape(1, 8))["bus_off"][0]
    assert count == 100  # every 3 ms for 0.3 s
    assert closed["faults"] == truth["faults"]


def test_commands_to_a_board_that_is_off_are_lost(scenario_file):
    path = scenario_file(6.0, with_faults({"kind": "brown_out", "at_s": 0.3, "duration_s": 1.0}))
    with serving(path, "--trial", TRIAL) as board:
        with serial.Serial(board.ready["port"], 921600, timeout=0.05) as port:
            client = Client(port)
            assert client.ask("START")
            board.event("boot")
            client.read(0.1)
            silent = len(client.frames)
            port.write(command(9, "STATUS"))
            client.read(0.5)
            assert len(client.frames) == silent
            client.read(0.7)
            assert len(client.frames) > silent  # booted, and telling its status
        board.end()


def test_a_study_has_no_line_for_faults(scenario_file, tmp_path):
    path = scenario_file(3.0, with_faults({"kind": "board_reset", "at_s": 0.5}))
    with pytest.raises(SimError, match="use impid-sim serve"):
        write_study(load(str(path)), tmp_path / "study", 1)
    assert not (tmp_path / "study").exists()
