"""Predictive densities against a loop that leaves out each block and its neighbours, fits, and predicts."""

import numpy as np
import pytest
from impid_host.diagnosis.rows import REFERENCE, Run
from impid_host.diagnosis.score import Explanation, Scorer, difference
from impid_host.diagnosis.table import table_of
from scipy import stats

from .synthetic import STEP_S, Rows, stacked, term

TERMS = [term("friction.coulomb", "joint1"), term("elastic.joint", "joint1", size=2)]
BLOCK = round(2.0 / STEP_S)


@pytest.mark.parametrize("tail", [5.0, 1e4])
@pytest.mark.parametrize("slots", [[], [0], [0, 1]])
def test_the_density_is_that_of_a_loop_over_blocks(tail: float, slots: list[int]) -> None:
    rows = Rows(TERMS, count=200, trials=2, channels=2)
    target = rows.target({"friction.coulomb@joint1": 0.3})
    table = rows.table(target, tail)
    base = [rows.base_columns[c, k] for c in range(2) for k in range(2)]
    X = stacked(table, base, slots)
    y = target.reshape(-1)
    number = np.tile(np.arange(200) // BLOCK, 4)
    channel, trial = np.repeat([0, 1], 400), np.tile(np.repeat([0, 1], 200), 2)
    truth = []
    for k in range(2):
        for block in range(5):
            away = (trial != k) | (np.abs(number - block) > 1)
            beta, *_ = np.linalg.lstsq(X[away], y[away], rcond=None)
            total = 0.0
            for c in range(2):
                own = (trial == k) & (number == block) & (channel == c)
                r = y[own] - X[own] @ beta
                total += float(stats.multivariate_t(np.zeros(BLOCK), np.eye(BLOCK), df=tail).logpdf(r))  # type: ignore[arg-type]
            truth.append(total)
    found = Scorer(table).explanation(table, slots)
    assert sorted(found.density) == pytest.approx(sorted(truth), rel=1e-5)
    whole, *_ = np.linalg.lstsq(X, y, rcond=None)
    assert found.beta == pytest.approx(whole[2:], abs=1e-5)


def test_references_always_take_part() -> None:
    """A row that says the base's first parameter is 3 +- 0.001, where all else leaves it open."""
    rows = Rows(TERMS[:1], count=200, trials=2)
    target = rows.target({})
    table = rows.table(target)
    runs = rows.runs(table.slots, target)
    none = np.zeros(0, dtype=np.intp)
    said = Run(
        "",
        REFERENCE,
        0,
        "fit",
        0.0,
        0.0,
        np.array([3000.0]),
        np.array([[1000.0, 0.0]]),
        none,
        np.zeros((1, 0), dtype=np.float32),
    )
    noise = table.noise
    noise.tails[REFERENCE, 0] = 1e4  # type: ignore[index]
    other = table_of([*runs, said], table.slots, noise, table.make)
    found, plain = (Scorer(own).explanation(own, []) for own in (other, table))
    assert len(found.density) == len(plain.density)
    assert found.total == pytest.approx(float(found.density.sum()) + found.reference)
    assert found.reference == pytest.approx(stats.norm.logpdf(0.0), abs=1.0)


def test_a_difference_is_a_sum_with_the_error_of_counting() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.standard_normal((2, 30))
    by = difference(Explanation((0,), one, 2.0, np.zeros(0)), Explanation((), other, -1.0, np.zeros(0)))
    assert by.gain == pytest.approx((one - other).sum() + 3.0)
    assert by.se == pytest.approx(np.sqrt(30) * stats.tstd(one - other))


def test_what_every_block_says_is_sure_however_unequal_they_are() -> None:
    """Three of twenty blocks tell nearly all: their standard error is as large as half of it."""
    level = np.zeros(20)
    told = np.full(20, 0.5)
    told[:3] = 80.0, 120.0, 300.0
    by = difference(Explanation((0,), told, 0.0, np.zeros(0)), Explanation((), level, 0.0, np.zeros(0)))
    assert by.gain < 2 * by.se
    assert by.surely(3.0)
    told[5] = -150.0
    by = difference(Explanation((0,), told, 0.0, np.zeros(0)), Explanation((), level, 0.0, np.zeros(0)))
    assert not by.surely(3.0)


@pytest.mark.parametrize("sigmas", [1.0, 2.0, 3.0])
def test_many_alike_blocks_are_as_sure_as_a_gaussian_says(sigmas: float) -> None:
    blocks = np.random.default_rng(3).standard_normal(400)
    blocks -= blocks.mean()
    se = np.sqrt(400) * blocks.std(ddof=1)
    none = Explanation((), np.zeros(400), 0.0, np.zeros(0))
    for shift, sure in ((0.9, False), (1.1, True)):
        own = Explanation((0,), blocks + shift * sigmas * se / 400, 0.0, np.zeros(0))
        assert difference(own, none).surely(sigmas) is sure
