"""Weights of explanations whose densities are written by hand."""

import numpy as np
import pytest
from impid_host.diagnosis.confidence import confidence_of, weights
from impid_host.diagnosis.score import Explanation

from .synthetic import Rows, term


def explained(slots: tuple[int, ...], density: np.ndarray, reference: float = 0.0) -> Explanation:
    return Explanation(slots, density, reference, np.zeros(0))


def test_alike_explanations_share_alike() -> None:
    density = np.random.default_rng(1).standard_normal(40)
    assert weights([explained((k,), density) for k in range(4)]) == pytest.approx([0.25] * 4)


def test_a_constant_difference_is_the_softmax_of_its_sum() -> None:
    """Without scatter between blocks the bootstrap is exact: exp(-2) to 1."""
    level = np.zeros(20)
    found = weights([explained((0,), level), explained((1,), level - 0.1)])
    assert found[1] / found[0] == pytest.approx(np.exp(-2.0))
    found = weights([explained((0,), level), explained((1,), level, reference=-3.0)])
    assert found[1] / found[0] == pytest.approx(np.exp(-3.0))


def test_one_lucky_block_is_no_certainty() -> None:
    """Ten nats in one block of forty: a third of all bootstrap draws hardly hold it."""
    even, lucky = np.zeros(40), np.zeros(40)
    lucky[7], even[3] = 10.0, 9.0
    assert 0.2 < weights([explained((0,), lucky), explained((1,), even)])[0] < 0.85
    assert weights([explained((0,), np.full(40, 0.25)), explained((1,), np.zeros(40))])[0] > 0.999


def test_a_name_is_as_sure_as_the_sets_that_hold_it() -> None:
    rows = Rows(
        [term("friction.coulomb", "joint1"), term("elastic.joint", "joint1"), term("accel.scale", "x")]
    )
    table = rows.table(rows.target({}))
    rng = np.random.default_rng(2)
    level = rng.standard_normal(60)
    sure = [explained((), level - 3), explained((0,), level), explained((0, 2), level - 0.05)]
    torn = [explained((), level - 3), explained((0,), level), explained((1,), level)]
    weak = [explained((), level), explained((0,), level - 0.5)]
    one, other = ({table.term(s).kind[:2]} for s in (0, 1))
    high, middle, low = (confidence_of(table, one, visited) for visited in (sure, torn, weak))
    assert 0.0 < low < middle < high < 1.0
    assert low < 0.1 and high > 0.95
    assert confidence_of(table, other, torn) == pytest.approx(middle)
    assert confidence_of(table, one | other, torn) > 0.95  # one of the two is right, whichever


def test_a_place_more_says_nothing_against_the_name() -> None:
    """On x and y by one term or by two it is on x all the same; on x alone it is not on both."""
    rows = Rows([term("accel.bias", "x"), term("accel.bias", "y"), term("accel.bias", "x", "y", size=2)])
    table = rows.table(rows.target({}))
    level = np.zeros(20)
    both = [explained((2,), level), explained((0, 1), level)]
    assert confidence_of(table, {("accel.bias", ("x",))}, both) == pytest.approx(0.98)
    assert confidence_of(table, {("accel.bias", ("x", "y"))}, both) == pytest.approx(0.98)
    less = [*both, explained((0,), level + 0.25)]
    assert confidence_of(table, {("accel.bias", ("x", "y"))}, less) < 0.6
    assert confidence_of(table, {("accel.bias", ("x",))}, less) == pytest.approx(0.98)
