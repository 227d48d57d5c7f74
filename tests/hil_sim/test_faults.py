"""Each fault by itself: it does what it says, as often as it says, however the stream is cut."""

from typing import Any, ClassVar

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from hil_sim.carriers.protocol import CanFrame
from hil_sim.errors import SimError
from hil_sim.faults.bus import FaultyBus, FrameDamage
from hil_sim.faults.chance import RareEvents
from hil_sim.faults.damage import DroppedBytes, DuplicatedBytes, FlippedBits
from hil_sim.faults.injectors import Rig, injector
from hil_sim.faults.line import FaultyLine
from hil_sim.faults.readings import ENCODER_FAULT, STALLED, FaultyReadings
from hil_sim.faults.schedule import Schedule
from hil_sim.faults.schema import Fault
from hil_sim.faults.throttle import Throttle
from hil_sim.world import Readings

FAULT: TypeAdapter[Any] = TypeAdapter(Fault)


class Carrier:
    """The client's side of a line or a bus: what came out, and what goes in."""

    address, connected, dropped = "here", True, 0
    config: ClassVar[dict[str, Any]] = {}

    def __init__(self):
        self.sent, self.waiting, self.cable = [], [], []

    def send(self, data):
        if data:
            self.sent.append(data)

    def receive(self, timeout_s):
        return self.waiting.pop(0)

    def pull(self):
        self.cable.append("out")

    def plug(self):
        self.cable.append("in")

    def close(self):
        pass


class Power:
    def __init__(self):
        self.did = []

    def restart(self, reset_cause, off_us):
        self.did.append((reset_cause, off_us))

    def short_bus(self):
        self.did.append("short")

    def free_bus(self):
        self.did.append("free")


class Log:
    def truncate(self, at_s):
        return round(1000 * at_s)


class Bench:
    """A rig with a clock that the test sets."""

    def __init__(self, *, serial=True, can=False):
        self.now_us = 0
        self.carrier, self.readings, self.power = Carrier(), FaultyReadings(), Power()
        self.line = FaultyLine(self.carrier, lambda: self.now_us) if serial else None
        self.bus = FaultyBus(self.carrier, lambda: self.now_us) if can else None
        cable = self.bus or self.line
        assert cable is not None
        self.rig = Rig(cable, self.line, self.bus, self.readings, self.power, Log())

    def schedule(self, *faults, seed=1, trial="free_01"):
        return Schedule(tuple(FAULT.validate_python(f) for f in faults), trial, seed, self.rig)


def test_rare_events_come_at_their_rate_and_where_the_stream_is_cut_does_not_matter():
    whole = RareEvents(1e-3, np.random.default_rng(4)).within(1_000_000)
    # Binomial: 1000 +- 32.
    assert abs(whole.size - 1000) < 4 * 32
    # The mean of uniform places is half of the stream, within 1e6 / sqrt(12 * 1000).
    assert abs(whole.mean() - 500_000) < 4 * 9100
    pieces, begin = [], 0
    events = RareEvents(1e-3, np.random.default_rng(4))
    for length in np.random.default_rng(5).integers(0, 5000, 1000):
        pieces += [begin + hit for hit in events.within(int(length)).tolist()]
        begin += int(length)
    assert begin > 1_000_000
    assert [hit for hit in pieces if hit < 1_000_000] == whole.tolist()


def test_certain_events_are_all_of_them():
    assert RareEvents(1.0, np.random.default_rng(0)).within(5).tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("cut", [1, 7, 100_000])
def test_bit_errors_flip_what_they_count(cut):
    data = np.random.default_rng(1).integers(0, 256, 100_000, dtype=np.uint8).tobytes()
    damage = FlippedBits(1e-3, np.random.default_rng(2))
    arrived = b"".join(damage(data[i : i + cut]) for i in range(0, len(data), cut))
    flipped = np.frombuffer(arrived, np.uint8) ^ np.frombuffer(data, np.uint8)
    assert int(np.unpackbits(flipped).sum()) == damage.count
    assert abs(damage.count - 800) < 4 * 28


def test_dropped_bytes_are_gone_and_the_others_in_order():
    data = bytes(range(256)) * 400
    damage = DroppedBytes(0.01, np.random.default_rng(2))
    arrived = damage(data)
    assert len(data) - len(arrived) == damage.count
    assert abs(damage.count - 1024) < 4 * 32
    # In a counting sequence every step is 1 + the number of bytes left out there.
    steps = np.diff(np.frombuffer(arrived, np.uint8))  # modulo 256
    assert 0 <= damage.count - int((steps - 1).sum()) <= 3  # but for the ends
    assert steps.min() >= 1


def test_duplicated_bytes_stand_beside_themselves():
    data = bytes(range(256)) * 400
    damage = DuplicatedBytes(0.01, np.random.default_rng(2))
    arrived = np.frombuffer(damage(data), np.uint8)
    assert arrived.size - len(data) == damage.count
    again = np.flatnonzero(np.diff(arrived.astype(np.int64)) == 0)
    assert again.size == damage.count
    assert np.delete(arrived, again).tobytes() == data


@pytest.mark.parametrize(("times", "sign"), [(0, -1), (2, 1)])
def test_frames_are_dropped_or_doubled(times, sign):
    frames: list[CanFrame] = [(i % 2048, b"") for i in range(10_000)]
    damage = FrameDamage(times, 0.02, np.random.default_rng(3))
    arrived = damage(frames)
    assert len(arrived) - len(frames) == sign * damage.count
    assert abs(damage.count - 200) < 4 * 14


def test_a_throttle_passes_its_rate_and_loses_what_it_cannot_hold():
    throttle = Throttle(1000.0, 50, now_us=0)
    for piece in range(80):
        throttle.put(1, bytes([piece]))
    assert throttle.lost == 30
    assert throttle.take(10_000) == [bytes([i]) for i in range(10)]
    assert throttle.take(10_000) == []
    assert throttle.take(10_900) == []
    assert throttle.take(11_000) == [b"\x0a"]
    assert len(throttle.rest()) == 39
    throttle.take(1_000_000)
    throttle.put(1, b"a")
    throttle.put(1, b"b")
    assert throttle.take(1_000_999) == []  # an idle reader saves nothing up
    assert throttle.lost == 30


def test_a_stalled_line_holds_both_directions_and_gives_all_back():
    bench = Bench()
    bench.line.send(b"1")
    bench.line.stall()
    bench.line.send(b"2")
    bench.carrier.waiting = [b"a", b"b", b""]
    assert bench.line.receive(0.0) == b""
    bench.line.send(b"3")
    assert bench.carrier.sent == [b"1"]
    assert bench.line.resume() == 3
    assert bench.carrier.sent == [b"1", b"23"]
    assert bench.line.receive(0.0) == b"ab"
    assert bench.line.receive(0.0) == b""


def test_a_shorted_bus_swallows_and_counts():
    bench = Bench(serial=False, can=True)
    bench.bus.short()
    bench.bus.send([(1, b""), (2, b"")])
    bench.carrier.waiting = [[(0x100, b"")], [(0x100, b"")]]
    assert bench.bus.receive(0.0) == []
    assert bench.bus.unshort() == 2
    bench.bus.send([(3, b"")])
    assert bench.carrier.sent == [[(3, b"")]]
    assert bench.bus.receive(0.0) == [(0x100, b"")]


def test_a_slow_reader_of_a_bus_loses_whole_frames():
    bench = Bench(serial=False, can=True)
    bench.bus.throttle(1400.0, 28)  # a hundred frames a second, room for two
    bench.bus.send([(i, bytes([i])) for i in range(5)])
    assert bench.carrier.sent == []
    bench.now_us = 10_000
    bench.bus.send([])
    assert bench.carrier.sent == [[(0, b"\x00")]]
    assert bench.bus.unthrottle() == 3
    assert bench.carrier.sent == [[(0, b"\x00")], [(1, b"\x01")]]


def counting(first, ticks):
    counts = np.arange(first, first + ticks, dtype=np.int32)
    adc = np.full((ticks, 8, 2), 2048, dtype=np.uint16)
    return Readings(adc=adc, encoder=np.stack([counts, -counts], axis=1))


def test_a_broken_encoder_line_stands_still_and_never_catches_up():
    faulty = FaultyReadings()
    faulty(counting(0, 100))
    faulty.break_line(1, reported=True)
    first, flags = faulty(counting(100, 50))
    second, _ = faulty(counting(150, 50))
    assert set(first.encoder[:, 0].tolist()) == set(second.encoder[:, 0].tolist()) == {99}
    assert second.encoder[:, 1].tolist() == [-i for i in range(150, 200)]
    assert flags.tolist() == [ENCODER_FAULT] * 50
    assert faulty.mend_line(1) == 100
    third, flags = faulty(counting(200, 10))
    assert third.encoder[:, 0].tolist() == list(range(100, 110))
    assert not flags.any()


def test_a_broken_line_that_nobody_reports_raises_no_flag():
    faulty = FaultyReadings()
    faulty.break_line(2, reported=False)
    readings, flags = faulty(counting(7, 5))
    assert readings.encoder.tolist() == [[i, -7] for i in range(7, 12)]
    assert not flags.any()


@pytest.mark.parametrize(
    ("axis", "rail", "expected"),
    [("x", "high", [4095, 2048]), ("y", "low", [2048, 0]), ("both", "high", [4095, 4095])],
)
def test_saturation_drives_its_axis_to_its_rail(axis, rail, expected):
    faulty = FaultyReadings()
    faulty.saturate(axis, rail)
    readings, _ = faulty(counting(0, 3))
    assert np.array_equal(readings.adc, np.broadcast_to(np.array(expected), (3, 8, 2)))
    faulty.release(axis)
    assert np.all(faulty(counting(3, 3))[0].adc == 2048)


def test_a_reset_board_counts_from_zero():
    faulty = FaultyReadings()
    faulty(counting(0, 100))
    faulty.board_restarted()
    readings, _ = faulty(counting(150, 2))
    assert readings.encoder.tolist() == [[51, -51], [52, -52]]


def test_the_schedule_carries_out_in_order_and_keeps_the_book():
    bench = Bench()
    schedule = bench.schedule(
        {"kind": "main_loop_stall", "at_s": 1.0, "duration_s": 0.5},
        {"kind": "cable_pulled", "at_s": 0.25, "duration_s": 0.75},
        {"kind": "board_reset", "at_s": 1.25},
        {"kind": "torque_log_truncated", "at_s": 2.0, "trials": ["free_01"]},
        {"kind": "board_reset", "at_s": 0.0, "trials": ["free_02"]},
    )
    said = []
    while (since_us := schedule.next_since_us) is not None:
        said.append(schedule.step(5_000_000 + since_us, boot_id=3))
        if said[-1]["kind"] == "cable_pulled":
            assert schedule.cable_is_out == (said[-1]["phase"] == "begin")
    assert [(s["at_s"], s["kind"], s["phase"]) for s in said] == [
        (0.25, "cable_pulled", "begin"),
        (1.0, "cable_pulled", "end"),
        (1.0, "main_loop_stall", "begin"),
        (1.25, "board_reset", "begin"),
        (1.5, "main_loop_stall", "end"),
        (2.0, "torque_log_truncated", "begin"),
    ]
    assert bench.carrier.cable == ["out", "in"]
    assert bench.power.did == [("PIN", 5000)]
    assert not bench.readings.hanging
    stall, cable, reset, log = schedule.close()
    assert stall["begin"] == {"board_us": 6_000_000, "boot_id": 3}
    assert stall["end"] == {"board_us": 6_500_000, "boot_id": 3}
    assert (cable["at_s"], cable["duration_s"]) == (0.25, 0.75)
    assert (reset["begin"]["board_us"], reset["end"]) == (6_250_000, None)
    assert log["counts"] == {"whole_rows": 2000}


def test_the_board_is_switched_as_each_fault_says():
    bench = Bench(can=True)
    schedule = bench.schedule(
        {"kind": "watchdog", "at_s": 1.0, "duration_s": 0.5},
        {"kind": "brown_out", "at_s": 2.0, "duration_s": 0.3},
        {"kind": "bus_off", "at_s": 3.0, "duration_s": 0.1},
    )
    flags = []
    for _ in range(6):
        schedule.step(0, 1)
        flags.append(int(bench.readings(counting(0, 1))[1][0]))
    assert flags == [STALLED, 0, 0, 0, 0, 0]
    assert bench.power.did == [("WATCHDOG", 5000), ("BROWN_OUT", 305_000), "short", "free"]


def test_chance_is_the_seed_and_each_fault_has_its_own():
    damage = {"kind": "bit_errors", "at_s": 0.0, "duration_s": 1.0, "rate": 0.01}

    def arrived(seed, *faults):
        bench = Bench()
        schedule = bench.schedule(*faults, seed=seed)
        for _ in faults:
            schedule.step(0, 1)
        bench.line.send(bytes(1000))
        counts = [record["counts"] for record in schedule.close()]
        return bench.carrier.sent[0], counts

    once, counts = arrived(1, damage)
    assert arrived(1, damage) == (once, counts)
    assert arrived(2, damage)[0] != once
    assert counts == [{"bits": int(np.unpackbits(np.frombuffer(once, np.uint8)).sum())}]
    _, (_, second) = arrived(1, damage, damage)
    both, _ = arrived(1, damage, damage)
    assert both != bytes(1000)  # the same bits twice would cancel out
    assert second["bits"] > 0


@pytest.mark.parametrize(
    ("kind", "bench", "remedy"),
    [
        ("bit_errors", Bench(serial=False, can=True), "no serial line; use --carrier"),
        ("dropped_frames", Bench(), "no bus; use --carrier slcan"),
        ("bus_off", Bench(), "no bus; use --carrier slcan"),
    ],
)
def test_a_fault_without_its_carrier_is_refused(kind, bench, remedy):
    fault = {"kind": kind, "at_s": 0.0, "duration_s": 1.0} | ({} if kind == "bus_off" else {"rate": 0.1})
    with pytest.raises(SimError, match=remedy):
        bench.schedule(fault)


def test_a_log_to_be_cut_must_be_written():
    bench = Bench()
    assert bench.line is not None
    rig = Rig(bench.line, bench.line, None, bench.readings, bench.power, None)
    with pytest.raises(SimError, match="--robot-log"):
        injector(
            FAULT.validate_python({"kind": "torque_log_truncated", "at_s": 1.0}),
            rig,
            np.random.default_rng(0),
        )


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "gremlins", "at_s": 1.0},
        {"kind": "bit_errors", "at_s": 1.0, "duration_s": 1.0},
        {"kind": "bit_errors", "at_s": 1.0, "duration_s": 1.0, "rate": 1.5},
        {"kind": "cable_pulled", "at_s": -1.0, "duration_s": 1.0},
        {"kind": "cable_pulled", "at_s": 1.0, "duration_s": 0.0},
        {"kind": "cable_pulled", "at_s": 1.0005, "duration_s": 1.0},
        {"kind": "encoder_lost", "at_s": 1.0, "duration_s": 1.0, "encoder": 3},
        {"kind": "board_reset", "at_s": 1.0, "duration_s": 1.0},
    ],
)
def test_a_schedule_that_cannot_be_is_refused(wrong):
    with pytest.raises(ValidationError):
        FAULT.validate_python(wrong)
