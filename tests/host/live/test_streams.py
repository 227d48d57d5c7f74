"""Rows of the robot by UDP and samples of the module, as they come and as they should not."""

import socket

import numpy as np
import pytest
from impid_host.errors import LinkError
from impid_host.live.module import Module
from impid_host.live.torques import MOST_ROWS, TorqueReader, open_port, received
from impid_host.study.model import AccelerometerSetup

SENSOR = AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.65), (0.62, 0.62), "link2", 0.0)
PER_CODE = 9.80665 / (0.62 / 3.3 * 65536)


def line(t: float, *values: float) -> bytes:
    return ",".join(map(str, (t, *values))).encode()


def test_rows_are_read_in_order_and_what_is_lost_is_counted() -> None:
    reader = TorqueReader(2)
    first = reader.read(
        [b"t,theta1,theta2,tau1,tau2\n" + line(1.0, 0.1, 0.2, 3, 4) + b"\n" + line(1.001, 0.1, 0.2, 5, 6)]
    )
    assert first is not None
    assert first.t.tolist() == [1.0, 1.001]
    assert first.theta.tolist() == [[0.1, 0.2]] * 2
    assert first.tau.tolist() == [[3.0, 4.0], [5.0, 6.0]]
    # Columns behind are another program's; a datagram that was overtaken is left out; three rows never came.
    later = reader.read([line(1.005, 0, 0, 1, 2, 99, 99), line(1.002, 0, 0, 7, 8), line(1.006, 0, 0, 1, 2)])
    assert later is not None
    assert later.t.tolist() == [1.005, 1.006]
    assert reader.counts.rows == 4
    assert reader.counts.missing == 3
    assert reader.counts.unreadable == 0


@pytest.mark.parametrize("bad", [b"hello", b"1.0,2", b"nan,0,0,0,0", b"1.0,0,0,x,0", b"\xff\xfe"])
def test_what_is_no_row_is_counted(bad: bytes) -> None:
    reader = TorqueReader(2)
    assert reader.read([bad]) is None
    assert reader.counts.unreadable == 1


def test_a_clock_that_begins_anew_is_taken_for_one() -> None:
    reader = TorqueReader(1)
    reader.read([line(50.0, 0, 0)])
    rows = reader.read([line(0.5, 0, 0)])
    assert rows is not None
    assert rows.t.tolist() == [0.5]
    assert reader.counts.restarts == 1


def test_what_has_waited_too_long_is_left_out_and_counted() -> None:
    reader = TorqueReader(1)
    reader.read([line(0.0, 0, 0), line(0.001, 0, 0)])
    many = [line(0.002 + 0.001 * k, 0, 0) for k in range(MOST_ROWS + 500)]
    rows = reader.read(many)
    assert rows is not None
    assert len(rows) == MOST_ROWS
    assert reader.counts.missing == 500


def test_datagrams_come_through_a_port() -> None:
    with open_port("127.0.0.1", 0) as own, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as controller:
        for k in range(3):
            controller.sendto(line(k, 0, 0), own.getsockname())
        assert received(own, 1.0) == [line(k, 0, 0) for k in range(3)]
        assert received(own, 0.01) == []
        with pytest.raises(LinkError, match="choose another --torques"):
            open_port(*own.getsockname())


def piece(index: range, run: int = 0, ax=32768) -> dict[str, object]:
    return {
        "boot_id": 1, "run": run, "index": list(index), "t_us": [1_000_000 + 1000 * k for k in index],
        "ax": [ax + k for k in index], "ay": [32768] * len(index),
        "enc1": list(index), "enc2": [0] * len(index),
        "flags": 0,
    }  # fmt: skip


def test_what_is_felt_goes_on_straight_beyond_the_newest_sample() -> None:
    module = Module(SENSOR, 8.0)
    for k in range(0, 100, 10):
        module.take(piece(range(k, k + 10)))
    at = 1.0 + np.array([0.0505, 0.099, 0.110])
    assert module.felt_at(at)[:, 0] == pytest.approx(PER_CODE * np.array([50.5, 99.0, 110.0]), rel=1e-6)
    assert module.newest_s == pytest.approx(1.099)
    assert module.knows(at)
    assert not module.knows(at + 0.2)
    assert not module.knows(at - 0.2)


def test_no_more_is_kept_than_asked_and_a_new_run_begins_anew() -> None:
    module = Module(SENSOR, 2.0)
    for k in range(0, 5000, 10):
        module.take(piece(range(k, k + 10), ax=10_000))
    kept = module.last()
    assert kept is not None
    assert 2000 <= len(kept) <= 2020
    assert kept.enc1[-1] == 4999
    module.take(piece(range(10), run=1))
    again = module.last()
    assert again is not None
    assert len(again) == 10
    assert module.run == (1, 1)
    assert not module.knows(np.array([1.0]))
