"""A known curve on a channel comes back as a shape: within its band, with its share of the squares."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.shapes import structures, words
from impid_host.diagnosis.table import Table
from impid_host.effects.structure import values_of
from impid_host.effects.view import View
from scipy.interpolate import BSpline

from ..effects.closed_form import FREE, body, recorded
from .synthetic import Rows, curve, term

TRIALS, COUNT, SIZE = 3, 1500, 7
TRUTH = np.array([0.5, -1.0, 2.0, 1.5, -0.5, 0.0, 1.0])
CURVE, NAME = "unattributed@tau1+theta1", "friction.coulomb@joint1"


def seen_views() -> list[View]:
    """Three trials; the variable is joint 1's angle."""
    plain = recorded(FREE)
    return [replace(plain, name=f"free_{k + 1:02d}", theta=body(plain.t + 7.0 * k).q) for k in range(TRIALS)]


def splines(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Cubic B-splines on equal knots, held at the ends, by their definition: one unit coefficient each."""
    knots = np.concatenate([[low] * 3, np.linspace(low, high, SIZE - 2), [high] * 3])
    inside = np.clip(values, low, high)
    return np.stack([BSpline(knots, row, 3)(inside) for row in np.eye(SIZE)], axis=1)


VIEWS = seen_views()
ANGLES = np.concatenate([view.theta[:, 0] for view in VIEWS])
LOW, HIGH = (float(v) for v in np.percentile(ANGLES, [0.2, 99.8]))


def laboratory(noise: float = 1.0, seed: int = 0) -> tuple[Rows, Table, np.ndarray]:
    rows = Rows(
        [term("friction.coulomb", "joint1"), curve("tau1", "theta1", size=SIZE)],
        trials=TRIALS,
        count=COUNT,
        seed=seed,
    )
    block = np.stack([splines(view.theta[:, 0], LOW, HIGH) for view in VIEWS])[None]
    rows.made[CURVE, 0.0] = block
    target = rows.target({NAME: 0.8, CURVE: TRUTH}, noise)
    return rows, rows.table(target), target


def found(table: Table) -> Structure:
    (own,) = structures(table, [0], [1], VIEWS)
    return own


def regression(rows: Rows, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, float, float]:
    """numpy's coefficients and covariance of the curve, and squares with and without it."""
    base = rows.base_columns.reshape(-1, 2)
    name = rows.of(rows.terms[0], 0.0).reshape(-1, 1)
    block = rows.of(rows.terms[1], 0.0).reshape(-1, SIZE)
    y = target.reshape(-1)
    without, X = np.column_stack([base, name]), np.column_stack([base, name, block])
    squares = [float(y @ (y - Z @ np.linalg.lstsq(Z, y, rcond=None)[0])) for Z in (without, X)]
    beta = np.linalg.lstsq(X, y, rcond=None)[0][3:]
    return beta, np.linalg.inv(X.T @ X)[3:, 3:], squares[0], squares[1]


def test_the_curve_is_numpys_and_so_is_its_band() -> None:
    rows, table, target = laboratory()
    own = found(table)
    beta, covariance, _, _ = regression(rows, target)
    grid = own.curve[:, 0]
    assert (grid[0], grid[-1]) == pytest.approx((LOW, HIGH))
    basis = splines(grid, LOW, HIGH)
    assert own.curve[:, 1] == pytest.approx(basis @ beta, abs=1e-4)
    half = 1.96 * np.sqrt(np.sum(basis @ covariance * basis, axis=1))
    assert own.band == pytest.approx(own.curve[:, 1:] + np.outer(half, [-1.0, 1.0]), abs=1e-4)


def test_the_band_holds_the_truth_in_95_of_100() -> None:
    inside = []
    for seed in range(30):
        own = found(laboratory(seed=seed)[1])
        truth = splines(own.curve[:, 0], LOW, HIGH) @ TRUTH
        assert np.abs(own.curve[:, 1] - truth).max() < 0.5
        inside.append(np.mean((own.band[:, 0] < truth) & (truth < own.band[:, 1])))
    # Some seven independent values each: 210 draws of 0.95.
    assert np.mean(inside) == pytest.approx(0.95, abs=0.045)


def test_the_share_is_the_ratio_of_the_squares() -> None:
    for noise in (0.3, 1.0, 3.0):
        rows, table, target = laboratory(noise)
        _, _, before, after = regression(rows, target)
        assert found(table).share == pytest.approx(1 - after / before, rel=1e-4)


def test_a_second_curve_has_its_share_of_what_the_first_leaves() -> None:
    rows = Rows(
        [curve("tau1", "theta1", size=SIZE), curve("tau1", "time", size=SIZE)], trials=TRIALS, count=COUNT
    )
    t = VIEWS[0].t
    rows.made[CURVE, 0.0] = np.stack([splines(view.theta[:, 0], LOW, HIGH) for view in VIEWS])[None]
    slow = splines(t, *np.percentile(t, [0.2, 99.8]))
    rows.made["unattributed@tau1+time", 0.0] = np.stack([slow] * TRIALS)[None]
    target = rows.target({CURVE: TRUTH, "unattributed@tau1+time": 3.0 * TRUTH})
    first, second = structures(rows.table(target), [], [0, 1], VIEWS)
    y, base = target.reshape(-1), rows.base_columns.reshape(-1, 2)
    blocks = [rows.of(own, 0.0).reshape(-1, SIZE) for own in rows.terms]
    squares = []
    for count in range(3):
        X = np.column_stack([base, *blocks[:count]])
        squares.append(float(y @ (y - X @ np.linalg.lstsq(X, y, rcond=None)[0])))
    assert first.share == pytest.approx(1 - squares[1] / squares[0], rel=1e-4)
    assert second.share == pytest.approx(1 - squares[2] / squares[1], rel=1e-4)
    assert (first.variable, second.variable) == ("theta1", "time")


def test_a_trial_apart_is_named() -> None:
    odd = replace(curve("tau1", "one_trial", size=2), variant="free_02")
    rows = Rows([odd], trials=TRIALS, count=COUNT)
    table = rows.table(rows.target({"unattributed@tau1+one_trial": [1.0, -1.0]}))
    (own,) = structures(table, [], [0], VIEWS)
    assert own.words == "trial free_02 is unlike the others"
    # Two columns of power 1 beside noise of power 1: two thirds.
    assert own.share == pytest.approx(2 / 3, abs=0.03)


def test_each_variable_is_read_off_the_motion() -> None:
    view = recorded(FREE)
    true = body(view.t)
    for name, truth in {
        "x": true.x[:, 0],
        "y": true.x[:, 1],
        "speed": np.hypot(*true.v.T),
        "time": view.t,
        "theta2": true.q[:, 1],
        "omega1": true.w[:, 0],
    }.items():
        assert values_of(view, name) == pytest.approx(truth, abs=1e-9), name


def test_a_bump_and_a_slope_are_told_apart() -> None:
    grid = np.linspace(0.0, 1.0, 101)
    bump = np.exp(-0.5 * ((grid - 0.7) / 0.03) ** 2)
    # exp(-u^2 / 2) is a half at u = 1.177: 0.67 to 0.73 of a grid of 0.01.
    assert words("theta1", "tau1", grid, bump, "") == "narrow bump of tau1 near theta1 = 0.7, about 0.06 wide"
    assert words("theta1", "tau1", grid, 2 * grid, "") == (
        "tau1 varies smoothly with theta1, by 2 over its range"
    )
    assert words("time", "tau1", grid, 2 * grid, "torque").endswith("multiplied by the torque")
    assert words("time", "tau1", grid, 2 * grid, "speed").endswith("multiplied by the speed of motion")
