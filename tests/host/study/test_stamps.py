"""Stamps in bursts, of coarse clocks and of clocks that jump, made of rows whose true times are known."""

from pathlib import Path

import numpy as np
import pytest
from impid_host.errors import InputError
from impid_host.study.folder import read_study, write_study
from impid_host.study.notices import StudyWarning
from impid_host.study.stamps import clock_jump, moves_by, recovered
from impid_host.study.text_clock import across_midnight, clock_seconds

ROWS = 30_000
PERIOD_S = 1.00007e-3
TRUE = 12.3 + PERIOD_S * np.arange(float(ROWS))


def arrivals(t: np.ndarray, every_s: float, jitter_s: float, *, apart_s: float = 0.0) -> np.ndarray:
    """Stamps of rows that are fetched about every so often, one after the other `apart_s` later."""
    rng = np.random.default_rng(3)
    count = int(2 * (t[-1] - t[0]) / every_s)
    fetched = t[0] + np.cumsum(np.maximum(rng.normal(every_s, jitter_s, count), 1e-3))
    burst = np.searchsorted(fetched, t)
    first = np.searchsorted(burst, burst)
    return np.asarray(fetched[burst] + apart_s * (np.arange(len(t)) - first))


def error(found: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Rms of what is left but for a constant (s), and the error of the rate."""
    left = found - true
    return float(np.std(left)), float(np.polyfit(true, left, 1)[0])


@pytest.mark.parametrize(
    ("stamps", "found", "step_s"),
    [
        (TRUE[0] + np.ceil((TRUE - TRUE[0]) / 0.016) * 0.016, "bursts", 0.016),
        (arrivals(TRUE, 0.016, 0.001), "bursts", 0.016),
        (arrivals(TRUE, 0.016, 0.004), "bursts", 0.016),
        (arrivals(TRUE, 0.016, 0.001, apart_s=20e-6), "bursts", 0.016),
        (np.round(TRUE, 2), "resolution", 0.010),
        (np.round(TRUE * 64) / 64, "resolution", 1 / 64),
        ((TRUE + 5000.0).astype(np.float32).astype(np.float64), "resolution", 2.0**-11),
    ],
)
def test_rows_are_put_back_on_their_own_clock(stamps: np.ndarray, found: str, step_s: float) -> None:
    result = recovered(stamps)
    assert result is not None
    t, fit = result
    assert fit.found == found
    assert fit.step_s == pytest.approx(step_s, rel=0.02)
    assert fit.period_s == pytest.approx(PERIOD_S, rel=2e-5)
    assert fit.missing_rows == 0
    rms_s, rate = error(t, TRUE)
    assert rms_s < 0.1 * PERIOD_S
    assert abs(rate) < 2e-5
    # A wait of anything up to one step: step / sqrt(12) where the steps are alike, more where they are not.
    assert fit.step_s / np.sqrt(12) * 0.95 < fit.residual_rms_s < fit.step_s / np.sqrt(12) * 1.25


@pytest.mark.parametrize(("period_s", "digits"), [(8e-3, 2), (2.5e-3, 3), (1.7e-3, 3)])
def test_a_coarse_clock_need_not_repeat_a_stamp(period_s: float, digits: int) -> None:
    true = 3.0 + period_s * np.arange(5000)
    result = recovered(np.round(true, digits))
    assert result is not None
    assert result[1].found == "resolution"
    assert error(result[0], true)[0] < 0.01 * period_s


def test_lost_packets_are_counted_and_leave_the_rest_in_place() -> None:
    keep = np.ones(ROWS, dtype=bool)
    keep[8000:8160] = False
    keep[20_000:20_016] = False
    result = recovered(arrivals(TRUE[keep], 0.016, 0.001))
    assert result is not None
    t, fit = result
    assert abs(fit.missing_rows - 176) <= 16
    assert np.quantile(np.abs(t - TRUE[keep] - np.median(t - TRUE[keep])), 0.99) < PERIOD_S


RNG = np.random.default_rng(7)


@pytest.mark.parametrize(
    "stamps",
    [
        TRUE,
        np.round(TRUE, 6),
        np.round(12.0 + 1e-3 * np.flatnonzero(RNG.random(ROWS) > 0.02), 3),  # rows missing, stamps true
        TRUE + RNG.normal(0, 3e-5, ROWS),  # stamps taken with the rows: the jitter is theirs
        np.round(
            TRUE + (RNG.random(ROWS) < 0.05) * RNG.uniform(0, 9e-4, ROWS), 5
        ),  # rows late and stamped so
        np.sort(RNG.uniform(0, 30, ROWS)),
        np.round(TRUE[RNG.random(ROWS) > 0.05], 2),  # so many lost that no clock can be told
    ],
)
def test_good_stamps_and_hopeless_ones_are_left_alone(stamps: np.ndarray) -> None:
    assert recovered(stamps) is None


def moving(t: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(2.1 * t), 0.5 * np.cos(3.3 * t + 1)], axis=1)


def test_a_clock_that_jumps_while_the_motion_goes_on() -> None:
    theta = np.round(moving(TRUE), 5)
    for jump_s in (0.5, 3600.0, 200_000.0):
        t = TRUE.copy()
        t[17_000:] += jump_s
        found = clock_jump(t, theta)
        assert found is not None
        assert (found.row, found.motion_goes_on) == (17_000, True)
        assert found.jump_s == pytest.approx(jump_s + PERIOD_S)


def test_a_hole_in_which_the_robot_moved_is_no_jump() -> None:
    for first in range(2000, 26_000, 1111):
        keep = np.ones(ROWS, dtype=bool)
        keep[first : first + 1500] = False
        assert clock_jump(TRUE[keep], np.round(moving(TRUE), 5)[keep]) is None


def test_a_hole_longer_than_the_log_is_no_trial() -> None:
    t = TRUE.copy()
    t[17_000:] += 200_000.0
    found = clock_jump(t, np.zeros((ROWS, 2)))
    assert found is not None
    assert (found.row, found.motion_goes_on) == (17_000, False)


def write_robot(folder: Path, t: np.ndarray, *, text: list[str] | None = None) -> None:
    rows = np.column_stack([moving(TRUE[: len(t)]), moving(TRUE[: len(t)] + 1)])
    stamps = text if text is not None else [f"{value:.9g}" for value in t]
    lines = [",".join([stamp, *(f"{v:.9g}" for v in row)]) for stamp, row in zip(stamps, rows, strict=True)]
    (folder / "free_01" / "robot.csv").write_text("t,theta1,theta2,tau1,tau2\n" + "\n".join(lines) + "\n")
    (folder / "free_01" / "device.csv").unlink(missing_ok=True)


def test_the_study_reader_recovers_warns_and_keeps_the_file_as_it_was(
    study_folder: Path, tmp_path: Path
) -> None:
    written = np.round(TRUE[:3000], 2)
    write_robot(study_folder, written)
    with pytest.warns(StudyWarning, match=r"rounded to 10 ms.*one per 1\.000.* ms"):
        study = read_study(study_folder)
    log = study.trials[0].robot
    assert log.stamps is not None
    assert log.stamps.found == "resolution"
    assert error(log.t, TRUE[:3000])[0] < 0.3 * PERIOD_S
    write_study(study, tmp_path / "again")
    with pytest.warns(StudyWarning):
        again = read_study(tmp_path / "again").trials[0].robot
    assert again.t_written is not None
    np.testing.assert_array_equal(again.t_written, written)
    np.testing.assert_array_equal(again.t, log.t)


def test_a_jump_is_refused_with_its_row_for_man_and_machine(study_folder: Path) -> None:
    t = TRUE[:3000].copy()
    t[1500:] += 3600
    write_robot(study_folder, t)
    with pytest.raises(InputError, match=r"robot\.csv, row 1502: t jumps by 3600") as caught:
        read_study(study_folder)
    assert caught.value.check == "time.jump"
    assert caught.value.row == 1502
    assert caught.value.evidence == {"jump_s": pytest.approx(3600, abs=0.01)}


def test_the_modules_stamps_may_not_jump_while_its_numbers_go_on(study_folder: Path) -> None:
    rows = [f"{1000 * k + (5_000_000 if k > 200 else 0)},{k},1,2,3,4,0" for k in range(400)]
    (study_folder / "free_01" / "device.csv").write_text("t_us,seq,ax,ay,enc1,enc2,flags\n" + "\n".join(rows))
    with pytest.raises(InputError, match=r"device\.csv, row 203: t_us jumps by 5\.001 s") as caught:
        read_study(study_folder)
    assert caught.value.check == "time.jump"


def test_a_clock_in_words(study_folder: Path) -> None:
    seconds = 23 * 3600 + 59 * 60 + 58 + 0.001 * np.arange(3000)
    text = [f"{int(s // 3600) % 24:02d}:{int(s // 60) % 60:02d}:{s % 60:06.3f}" for s in seconds]
    write_robot(study_folder, seconds, text=text)
    log = read_study(study_folder).trials[0].robot
    assert log.t == pytest.approx(seconds, abs=1e-6)  # goes on after midnight


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("00:00:00.000", 0.0),
        ("14:03:07.125", 50587.125),
        ("14:03:07,125", 50587.125),
        ("9:00:01", 32401.0),
        ("01:02.5", 62.5),
        ("1970-01-02 00:00:01.5", 86401.5),
        ("2026-11-30T14:03:07.125Z", 1796047387.125),
    ],
)
def test_clocks_as_loggers_write_them(text: str, seconds: float) -> None:
    assert clock_seconds(text) == pytest.approx(seconds, abs=1e-6)


@pytest.mark.parametrize("text", ["14:61:00", "noon", "1:2:3:4", "14:03:99", "::", "2026-13-41 00:00:00"])
def test_what_is_no_time(text: str) -> None:
    with pytest.raises(ValueError):
        clock_seconds(text)


def test_midnight() -> None:
    assert across_midnight(np.array([86399.0, 1.0, 2.0, 86399.5, 0.5])).tolist() == [
        86399.0,
        86401.0,
        86402.0,
        172799.5,
        172800.5,
    ]


@pytest.mark.parametrize("period_s", [1e-2, 1e-3])
@pytest.mark.parametrize("lost", [1, 25])
def test_what_moved_tells_a_lost_row_from_a_coarse_clock(period_s: float, lost: int) -> None:
    # Either way nearly all steps are one period of a round length, and a few are two.
    rows = np.arange(6000)
    missing = np.sort(np.random.default_rng(11).choice(rows[100:-100], lost, replace=False))
    kept = np.delete(rows, missing).astype(np.float64)
    stamps = 0.0004 + period_s * kept
    counts = 2 * np.pi / 131_072
    assert recovered(stamps, counts * np.round(moving(stamps) / counts)) is None
    # The same stamps, and no row missing: the rows' clock is a little slow.
    times = 0.0004 + (stamps[-1] - stamps[0]) / (len(stamps) - 1) * np.arange(float(len(stamps)))
    again = recovered(stamps, counts * np.round(moving(times) / counts))
    if lost == 1:  # one longer step is where a clock that rounds would put it, or anywhere
        assert again is None or again[1].missing_rows == 0
    else:
        assert moves_by(stamps, moving(times)) < 0.5
