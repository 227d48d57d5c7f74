"""How well a trial tells two linear models apart, against distances worked out by hand."""

import numpy as np
import pytest
from impid_host.design.divergence import Member, added, divergence, fitted, least_added, triangle


def member(column: int, value: float) -> Member:
    return Member(np.array([column]), np.array([value]))


@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 2])
def test_two_lines_through_the_origin_are_apart_by_the_sine_of_their_angle(turn: float) -> None:
    """y = a u against y = b w, with w turned from u: half of a^2 |u|^2 sin^2."""
    u, other = np.zeros(50), np.zeros(50)
    u[0], other[1] = 4.0, 4.0
    rows = np.column_stack([u, np.cos(turn) * u + np.sin(turn) * other])
    found = divergence(rows, member(0, 3.0), np.array([1]))
    assert found == pytest.approx(0.5 * (3.0 * 4.0 * np.sin(turn)) ** 2, abs=1e-9)


@pytest.mark.parametrize("slope", [1.0, 0.5, 0.0, -2.0])
def test_a_rival_is_refitted_to_old_and_new_rows_together(slope: float) -> None:
    """n rows in which both columns are 1, m in which the rival's is `slope`; least squares by hand."""
    n, m, a = 40, 10, 0.7
    known = np.ones((n, 2))
    fresh = np.column_stack([np.ones(m), np.full(m, slope)])
    one = 0.5 * a**2 * n * m * (1 - slope) ** 2 / (n + m * slope**2)
    other = 0.5 * a**2 * n * m * (1 - slope) ** 2 / (n + m)
    assert added(known, fresh, member(0, a), member(1, a)) == pytest.approx(0.5 * (one + other), abs=1e-9)


def test_what_the_old_rows_tell_already_is_not_counted_again() -> None:
    rng = np.random.default_rng(1)
    known = rng.normal(size=(200, 2))
    assert added(known, np.zeros((5, 2)), member(0, 1.0), member(1, 1.0)) == pytest.approx(0.0, abs=1e-9)


def test_it_is_the_mean_of_the_log_likelihood_ratio_of_simulated_trials() -> None:
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(60, 2))
    truth = rows[:, 0] * 0.4
    ratios = []
    for _ in range(4000):
        y = truth + rng.normal(size=60)
        rest = y - rows[:, 1] * (rows[:, 1] @ y) / (rows[:, 1] @ rows[:, 1])
        ratios.append(0.5 * (rest @ rest - (y - truth) @ (y - truth)))
    # A fitted coefficient takes up half a nat of noise.
    expected = divergence(rows, member(0, 0.4), np.array([1])) - 0.5
    assert np.mean(ratios) == pytest.approx(expected, abs=5 * np.std(ratios) / np.sqrt(4000))


def test_the_triangle_stands_for_all_rows() -> None:
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(500, 4))
    whole, small = (divergence(r, member(0, 2.0), np.array([1, 2])) for r in (rows, triangle(rows)))
    assert small == pytest.approx(whole, rel=1e-9)
    own, left = fitted(rows[:, :3], rows[:, 3], np.array([0, 2]))
    expected, squares, *_ = np.linalg.lstsq(rows[:, [0, 2]], rows[:, 3], rcond=None)
    np.testing.assert_allclose(own.value, expected)
    assert left == pytest.approx(squares[0])


def test_of_several_pairs_the_worst_counts_and_a_column_of_zeros_breaks_nothing() -> None:
    known, fresh = np.zeros((4, 3)), np.zeros((4, 3))
    fresh[0, 0], fresh[1, 1] = 2.0, 6.0
    near, far = (member(0, 1.0), member(2, 0.0)), (member(1, 1.0), member(2, 0.0))
    assert least_added(known, fresh, [near, far]) == pytest.approx(0.5 * 0.5 * 4.0)
    assert least_added(known, fresh, []) == 0.0
