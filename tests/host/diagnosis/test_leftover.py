"""What an explanation leaves: squares by channel as numpy has them, and entries for what is left."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.leftover import changes, left_over, odd_structures, power_by_channel
from impid_host.diagnosis.oddities import Oddity

from ..effects.closed_form import FREE, recorded
from .synthetic import STEP_S, Rows, term

TERMS = [term("friction.coulomb", "joint1"), term("elastic.joint", "joint1", size=2)]
TRUTH = {"friction.coulomb@joint1": 1.5, "elastic.joint@joint1": [0.5, -1.0]}


def least_squares(rows: Rows, target: np.ndarray, slots: list[int]) -> list[float]:
    """Squares that both channels leave, all rows in one regression."""
    base = rows.base_columns.reshape(-1, 2)
    blocks = [rows.of(TERMS[s], 0.0).reshape(len(base), -1) for s in slots]
    X, y = np.column_stack([base, *blocks]), target.reshape(-1)
    left = (y - X @ np.linalg.lstsq(X, y, rcond=None)[0]).reshape(2, -1)
    return [float(r @ r) for r in left]


@pytest.mark.parametrize("slots", [[], [0], [0, 1]])
def test_squares_by_channel_are_numpys(slots: list[int]) -> None:
    rows = Rows(TERMS, channels=2)
    target = rows.target(TRUTH)
    found = power_by_channel(rows.table(target), slots)
    assert list(found) == ["tau1", "tau2"]
    assert list(found.values()) == pytest.approx(least_squares(rows, target, slots), rel=1e-5)


def test_a_change_is_the_difference_of_two_fits_by_channel() -> None:
    rows = Rows(TERMS, channels=2)
    target = rows.target(TRUTH)
    before, after = (np.array(least_squares(rows, target, slots)) for slots in ([1], [0, 1]))
    found = changes(rows.table(target), [0, 1], 0)
    assert list(found.values()) == pytest.approx((before - after).tolist(), rel=1e-4)


def test_a_channel_that_gets_worse_is_not_said_to_gain() -> None:
    """A column that only channel 1 shows in truth pulls both: fitted to both, it harms the other."""
    rows = Rows(TERMS[:1], channels=2)
    target = rows.target({})
    target[0] += 2.0 * rows.of(TERMS[0], 0.0)[0, ..., 0]
    found = changes(rows.table(target), [0], 0)
    assert found["tau1"] > 1000
    assert found["tau2"] == 0.0


def test_white_noise_leaves_nothing_and_a_line_is_told_by_its_frequency() -> None:
    rows = Rows(TERMS)
    # A robot that is moved at half a hertz: elsewhere a line is no excitation.
    phase = np.pi * rows.t[:, None] + np.array([0.0, 1.0])
    rows.base_columns = np.broadcast_to(np.sin(phase), rows.base_columns.shape)
    target = rows.target(TRUTH)
    views = [replace(recorded(FREE), name=f"free_{k + 1:02d}") for k in range(rows.trials)]
    assert left_over(rows.table(target), [0, 1], [], views) == ()
    hum = target + 0.8 * np.sin(2 * np.pi * 3.3 * rows.t)
    (own,) = left_over(rows.table(hum), [0, 1], [], views)
    assert own.on == "tau1"
    assert own.peak == pytest.approx(3.3, abs=1 / (rows.count * STEP_S))


def test_rows_that_were_left_out_are_entries_of_their_own() -> None:
    gap = Oddity("free_02", "tau1", 0.25, "stands still")
    (own,) = odd_structures([gap, Oddity("free_03", "tau1", 0.0, "nothing")])
    assert (own.variable, own.on, own.share, own.words) == ("one_trial", "tau1", 0.25, "stands still")
    assert own.curve.shape == (0, 2)
