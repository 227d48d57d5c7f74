"""Converter and accelerometer: supply, self-test, noise."""

import numpy as np

from impid_host.bring_up.board import BenchBoard
from impid_host.bring_up.result import Result, not_measured
from impid_host.wire.messages import SAMPLE_PERIOD_US, choices

_SELF_TEST = choices("STATUS_HEALTH", "self_test")
# Nobody answers: an output that moves by less than this is none (115 mV are the least that a sensor shows).
_NOTHING_MV = 30
_REFERENCE_READINGS = 1000
_AXIS_READINGS = 16000
_STREAM_S = 5.0
# Signal to noise of 64 dB at least (F446 data sheet, ADC dynamic accuracy) is 0.91 codes of 12 bits; the
# reference itself is noisier than a quiet input.
_REFERENCE_NOISE = 2.0
# 180 ug/sqrt(Hz) over the 785 Hz that a first order of 500 Hz lets pass are 3.9 codes; 1.5 times that.
_AXIS_NOISE = 6.0
# docs/hardware.md: 40 to 60 codes of 16 bits at rest.
_STREAM_NOISE = 80.0


def supply(board: BenchBoard) -> Result:
    """The converter's and the accelerometer's."""
    millivolts = board.client.status().supply_mV
    return Result(
        "supply (AVDD), by the internal reference",
        float(millivolts),
        "mV",
        3000.0,
        3600.0,
        "",
        "the board's own regulator; the emulator's supply is a number",
    )


def reference_noise(board: BenchBoard) -> list[Result]:
    """The converter on its internal reference: no wire, no sensor."""
    found = board.histogram("reference", _REFERENCE_READINGS)
    silicon = "the converter's own noise, which decides whether AN4073's settings are worth their price"
    detail = f"{_REFERENCE_READINGS} readings, mean {found.mean:.1f}, {found.outside} further than 32 codes"
    return [
        Result(
            "noise of the converter on its reference",
            found.noise,
            "codes of 12 bits",
            0.0,
            _REFERENCE_NOISE,
            detail,
            silicon,
        ),
    ]


def accelerometer(board: BenchBoard) -> list[Result]:
    """Its self-test, and where one answers, its noise at rest."""
    outcome = board.client.self_test()
    info = board.client.info()
    responses = [_signed(word) for word in (info.self_test_x_mv, info.self_test_y_mv)]
    names = (
        "self-test of the accelerometer",
        *(f"noise of axis {axis}, converter at 8 kHz" for axis in "xy"),
        *(f"missing codes of axis {axis}" for axis in "xy"),
        *(f"noise of axis {axis} at rest, stream" for axis in "xy"),
    )
    if outcome == _SELF_TEST["FAILED_BOTH"] and max(map(abs, responses)) < _NOTHING_MV:
        why = f"no accelerometer answers (response {responses[0]} and {responses[1]} mV)"
        return [not_measured(name, why) for name in names]
    passed = outcome == _SELF_TEST["PASSED"]
    rows = [
        Result(
            names[0],
            float(passed),
            "",
            1.0,
            1.0,
            f"response {responses[0]} and {responses[1]} mV",
            "the sensor's own answer, 115 to 316 mV at 3.3 V",
        ),
    ]
    histograms = [board.histogram(axis, _AXIS_READINGS) for axis in "xy"]
    for name, found in zip(names[1:3], histograms, strict=True):
        detail = f"{_AXIS_READINGS} readings, mean {found.mean:.1f}, {found.outside} further than 32 codes"
        rows.append(
            Result(
                name,
                found.noise,
                "codes of 12 bits",
                0.0,
                _AXIS_NOISE,
                detail,
                "supply, layout and capacitor: the emulator's noise is what its scenario says",
            )
        )
    rows += [
        Result(
            name,
            float(found.missing),
            "",
            0.0,
            0.0,
            "empty bins within one noise of the mean",
            "the converter's differential nonlinearity",
        )
        for name, found in zip(names[3:5], histograms, strict=True)
    ]
    rows += [
        Result(name, noise, "codes of 16 bits", 0.0, _STREAM_NOISE, "40 to 60 with 10 nF, at rest")
        for name, noise in zip(names[5:], _stream_noise(board), strict=True)
    ]
    return rows


def _stream_noise(board: BenchBoard) -> tuple[float, float]:
    """Standard deviation of both axes over some seconds of the stream, codes."""
    ear = board.fresh_ear()
    board.client.start()
    end = board.now() + 2 * _STREAM_S
    while ear.samples < _STREAM_S * 1e6 / SAMPLE_PERIOD_US and board.now() < end:
        board.wait(0.05)
    board.client.stop()
    x, y = np.concatenate(ear.codes).std(axis=0)
    return float(x), float(y)


def _signed(word: int) -> int:
    return word - (1 << 32) if word >> 31 else word
