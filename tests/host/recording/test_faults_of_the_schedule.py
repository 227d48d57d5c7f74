"""The simulator's faults against the recorder: what the board sampled is stored or counted as lost, exactly.

The simulator counts its board's ticks while it streams; every fault over every carrier is in
bench/recording/faults.py.
"""

from pathlib import Path

from tests.host.recording.served import Outcome, record_through


def books_close(outcome: Outcome) -> None:
    assert outcome.exit_code == 0, outcome.said
    assert outcome.balanced, outcome.books


def test_line_damage_a_pulled_cable_and_a_reset(tmp_path: Path) -> None:
    faults = [
        {"kind": "bit_errors", "at_s": 0.3, "duration_s": 0.6, "rate": 2e-4},
        {"kind": "cable_pulled", "at_s": 1.2, "duration_s": 0.5},
        {"kind": "board_reset", "at_s": 2.4},
    ]
    outcome = record_through("pty", faults, tmp_path)
    books_close(outcome)
    first, second = outcome.books
    assert first["lost"] > 500
    assert (first["uncounted"], second["uncounted"]) == (0, 0)
    assert second["cause"] == "PIN"
    # 2.4 s after the motion began, which was 0.25 s after the answer to START had been carried away.
    assert 2640 <= first["produced"] <= 2900
    names = [event.name for event in outcome.recording.events]
    assert names.count("disconnected") == names.count("reconnected") >= 1
    assert names.count("boot") == 1


def test_bus_off_lost_frames_and_a_hanging_main_loop(tmp_path: Path) -> None:
    """The controller really leaves the bus: what it held is gone, and its own count says so."""
    faults = [
        {"kind": "bus_off", "at_s": 0.3, "duration_s": 0.4},
        {"kind": "dropped_frames", "at_s": 1.0, "duration_s": 0.5, "rate": 0.05},
        {"kind": "watchdog", "at_s": 1.8, "duration_s": 0.1},
    ]
    outcome = record_through("udp_multicast", faults, tmp_path)
    books_close(outcome)
    assert [book["cause"] for book in outcome.books] == ["POWER_ON", "WATCHDOG"]
    assert outcome.books[0]["lost"] > 400
    # Every 3 ms, as long as the bus is shorted.
    assert max(status.bus_off for status in outcome.recording.statuses) == 134


def test_a_loss_of_power_is_bounded_by_the_clock(tmp_path: Path) -> None:
    outcome = record_through("tcp", [{"kind": "brown_out", "at_s": 1.0, "duration_s": 0.3}], tmp_path)
    books_close(outcome)
    first, second = outcome.books
    # 0.3 s without power and 5 ms of boot, what was in the board, and how well a ping tells the time.
    assert 300 <= first["uncounted"] < 300 + 200
    assert second["uncounted"] == 0
    assert "and at most" in outcome.said


def test_bytes_twice_on_an_adapters_line(tmp_path: Path) -> None:
    """Its lines have no checksum: a digit twice would move every digit behind it."""
    faults = [{"kind": "duplicated_bytes", "at_s": 0.3, "duration_s": 1.0, "rate": 2e-3}]
    outcome = record_through("slcan", faults, tmp_path)
    books_close(outcome)
    assert outcome.books[0]["lost"] > 20
    (segment,) = outcome.recording.segments
    assert (segment.samples.t_us - segment.samples.t_us[0] == (segment.index - segment.index[0]) * 1000).all()
