"""What the live page is told: units, means, spectrum and lamp, by arithmetic of the test's own."""

from typing import Any

import numpy as np
import pytest
from impid_host.samples import FLAG_ENCODER_FAULT, FLAG_SATURATED
from impid_host.study.model import AccelerometerSetup, EncoderSetup, RobotSetup, Setup
from impid_host.view.lamp import Lamp
from impid_host.view.scale import Scale, scale_of
from impid_host.view.spectrum import SEGMENT, amplitude_spectrum
from impid_host.view.stream import Stream

SETUP = Setup(
    RobotSetup("planar-2r-absolute", (0.25, 0.27)),
    EncoderSetup((400_000, 200_000), (0.5, -0.25), (1, -1)),
    AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.65), (0.62, 0.62), "link2", 0.0),
)
TOLD = {"connected": True, "lost": 0, "damaged": 0, "elapsed_s": 20.0, "clock": "+21 ppm"}


def piece(index: np.ndarray, ax=32768, enc1=0, run: int = 1) -> dict[str, Any]:
    """One of 1 kHz, with the same code or an array on the first axis."""
    ones = np.ones(len(index), dtype=int)
    return {
        "boot_id": 7, "run": run, "index": index.tolist(), "t_us": (5_000_000 + 1000 * index).tolist(),
        "ax": (ones * ax).tolist(), "ay": (ones * 32768).tolist(),
        "enc1": (ones * enc1).tolist(), "enc2": (0 * ones).tolist(),
    }  # fmt: skip


def test_units_are_the_setups() -> None:
    scale = scale_of(SETUP, {}, 65536)
    one_g = round((1.65 + 0.62) / 3.3 * 65536)
    assert scale.acceleration(np.array([[one_g, 32768]]))[0] == pytest.approx([9.80665, 0.0], abs=1e-3)
    assert scale.angles(np.array([[100_000, 50_000]]))[0] == pytest.approx(
        [0.5 + np.pi / 2, -0.25 - np.pi / 2]
    )
    assert scale.angle_units == ("rad", "rad")
    assert Scale.from_dict({**scale.to_dict(), "acc_zero": list(scale.acc_zero)}) == scale


def test_without_a_setup_the_boards_own_settings_serve() -> None:
    settings = {"accel_x_zero": 30000, "accel_x_per_g": 12000, "encoder_2_cpr": 4000}
    scale = scale_of(None, settings, 65536)
    assert scale.acceleration(np.array([[42000, 32768]]))[0] == pytest.approx([9.80665, 0.0])
    assert scale.angle_units == ("counts", "rad")
    assert scale.angles(np.array([[17, 1000]]))[0] == pytest.approx([17.0, np.pi / 2])
    # Codes of 24 bits, settings of 16.
    wide = scale_of(None, settings, 1 << 24)
    assert wide.acceleration(np.array([[42000 * 256, 0]]))[0, 0] == pytest.approx(9.80665)


def test_a_slide_is_in_metres() -> None:
    slide = Setup(RobotSetup("slide-1d", ()), EncoderSetup((1000,), (0.0,), (1,)))
    assert scale_of(slide, {}, 65536).angle_units == ("m", "counts")


def test_points_are_means_of_ten_whatever_the_pieces() -> None:
    stream = Stream(scale_of(SETUP, {}, 65536), 1000.0)
    codes = 32768 + np.arange(100)
    for begin, end in ((0, 7), (7, 33), (33, 100)):
        stream.take(piece(np.arange(begin, end), ax=codes[begin:end]))
    points = stream.points()
    assert points["t"] == pytest.approx(np.arange(10) * 0.01 + 0.0045)
    per_code = 9.80665 / (0.62 / 3.3 * 65536)
    assert points["acc_x"] == pytest.approx((np.arange(10) * 10 + 4.5) * per_code, rel=1e-4)
    assert stream.points()["t"] == []


def test_what_waits_is_bounded_and_a_new_run_begins_anew() -> None:
    stream = Stream(scale_of(None, {}, 65536), 1000.0)
    for k in range(400):
        stream.take(piece(np.arange(100 * k, 100 * (k + 1))))
    assert len(stream.points()["t"]) == 1000
    assert stream.spectrum() is not None
    stream.take(piece(np.arange(0, 100), run=2))
    assert stream.run == (7, 2)
    assert stream.points()["t"][0] == pytest.approx(0.0045)
    assert stream.spectrum() is None


def test_a_spectrum_is_not_made_across_a_hole() -> None:
    stream = Stream(scale_of(None, {}, 65536), 1000.0)
    stream.take(piece(np.arange(0, 5000)))
    assert stream.spectrum() is not None
    stream.take(piece(np.arange(5100, 6000)))
    assert stream.spectrum() is None


def test_the_spectrum_is_in_m_per_s2_and_ends_at_20_hz() -> None:
    """2 m/s² at a line near 5 Hz, and as much at 100 Hz, which is not shown."""
    stream = Stream(scale_of(SETUP, {}, 65536), 1000.0)
    n = np.arange(3 * SEGMENT)
    per_code = 9.80665 / (0.62 / 3.3 * 65536)
    own, far = 2 * np.pi * 20 / SEGMENT, 2 * np.pi * 410 / SEGMENT
    stream.take(
        piece(n, ax=np.round(32768 + (2 * np.sin(own * n) + 2 * np.sin(far * n)) / per_code).astype(int))
    )
    spectrum = stream.spectrum()
    assert spectrum is not None
    assert spectrum["step_hz"] == pytest.approx(1000 / SEGMENT)
    lines = np.array(spectrum["acc_x"])
    assert lines.argmax() == 20
    assert lines[20] == pytest.approx(2.0, rel=1e-3)
    assert (len(lines) - 1) * spectrum["step_hz"] <= 20.0
    assert np.delete(lines, [19, 20, 21]).max() < 1e-2


def test_the_spectrum_of_a_sinusoid_is_its_amplitude() -> None:
    """On line 40, amplitude 300, on a pedestal: the pedestal is gone and the line reads 300."""
    t = np.arange(3 * SEGMENT)
    lines = amplitude_spectrum(32768 + 300 * np.sin(2 * np.pi * 40 * t / SEGMENT))
    assert lines.argmax() == 40
    assert lines[40] == pytest.approx(300, rel=2e-3)
    assert lines[0] < 0.1
    assert np.delete(lines, [39, 40, 41]).max() < 0.2


def lit(lamp: Lamp, now: float, **told) -> tuple[str, str]:
    light = lamp.light(now, {**TOLD, **told})
    return light.level, "; ".join(light.words)


def moving(lamp: Lamp, now: float, flags: int = 0) -> None:
    lamp.see(now, flags, (1, 1), constant=(False, False))
    lamp.progress(now, TOLD)


def test_the_lamp_is_good_when_nothing_is_wrong() -> None:
    lamp = Lamp()
    for k in range(100):
        moving(lamp, 0.1 * k)
    assert lit(lamp, 9.9) == ("good", "recording, nothing is wrong")
    assert Lamp().light(0.0, {}).level == "look"


@pytest.mark.parametrize(
    ("flag", "words"), [(FLAG_SATURATED, "at its end"), (FLAG_ENCODER_FAULT, "encoder reports a fault")]
)
def test_a_flag_is_shown_for_ten_seconds(flag: int, words: str) -> None:
    lamp = Lamp()
    moving(lamp, 0.0, flag)
    moving(lamp, 9.0)
    level, said = lit(lamp, 9.0)
    assert level == "bad"
    assert words in said
    moving(lamp, 11.0)
    assert lit(lamp, 11.0)[0] == "good"


def test_silence_a_gone_board_and_a_dead_axis_are_wrong() -> None:
    lamp = Lamp()
    moving(lamp, 0.0)
    assert lit(lamp, 3.0) == ("bad", "no samples arrive: check cable and power")
    assert "the board is gone" in lit(lamp, 3.0, connected=False)[1]
    for k in range(70):
        lamp.see(0.1 * k, 0, (k, 500), constant=(False, True))
    assert lit(lamp, 6.9) == ("bad", "acceleration y stands on one code: is the sensor connected?")


def test_losses_are_wrong_while_they_last_and_said_ever_after() -> None:
    lamp = Lamp()
    for k, lost in enumerate([0] * 10 + [40] * 20):
        lamp.see(float(k), 0, (k, k), constant=(False, False))
        lamp.progress(float(k), {**TOLD, "lost": lost})
        if k == 12:
            level, words = lit(lamp, 12.0, lost=40)
            assert level == "bad"
            assert "40 samples lost in the last 10 s" in words
    assert lit(lamp, 29.0, lost=40) == ("look", "40 samples lost so far; the recording says where")


def test_a_clock_that_is_not_found_asks_for_a_look() -> None:
    lamp = Lamp()
    moving(lamp, 0.0)
    assert lit(lamp, 0.0, clock=None) == ("look", "the board's clock is not determined yet")
    assert lit(lamp, 0.0, clock=None, elapsed_s=3.0)[0] == "good"
