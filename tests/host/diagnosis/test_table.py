"""The table's sums of squares against numpy's least squares on the rows themselves."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.table import Table, residuals, solve, swept

from .synthetic import Rows, stacked, term

TERMS = [
    term("friction.coulomb", "joint1"),
    term("elastic.joint", "joint1", size=2),
    term("actuator.offset", "joint1"),
    term("actuator.cogging", "joint1", shapes=(0.5, 1.0, 2.0)),
]


@pytest.fixture(scope="module")
def made() -> tuple[Table, np.ndarray, list[np.ndarray]]:
    """Table, all targets, base columns run by run."""
    rows = Rows(TERMS, count=200, channels=2, trials=3)
    target = rows.target({"friction.coulomb@joint1": 0.5, "elastic.joint@joint1": [1.0, -2.0]})
    base = [rows.base_columns[c, k] for c in range(2) for k in range(3)]
    return rows.table(target), target.reshape(-1), base


def least_squares(table: Table, target: np.ndarray, base: list[np.ndarray], slots: list[int]):
    X = stacked(table, base, slots)
    beta, *_ = np.linalg.lstsq(X, target, rcond=None)
    left = target - X @ beta
    return beta[2:], float(left @ left), left


@pytest.mark.parametrize("slots", [[], [0], [1, 0], [0, 1, 2, 4]])
def test_coefficients_and_squares_are_numpys(made, slots: list[int]) -> None:
    table, target, base = made
    beta, squares, left = least_squares(table, target, base, slots)
    own, rss = solve(table.G, table.columns(slots))
    assert own == pytest.approx(beta, rel=1e-5, abs=1e-6)
    assert rss == pytest.approx(squares, rel=1e-6)
    assert np.concatenate(residuals(table, table.columns(slots))) == pytest.approx(left, abs=1e-5)


def test_sweeping_out_leaves_what_is_left(made) -> None:
    table, target, base = made
    left = swept(table, table.columns([0, 1]))
    assert left.left == pytest.approx(least_squares(table, target, base, [0, 1])[1], rel=1e-6)
    P = left.G - left.W.T @ left.W
    assert np.abs(P[1:4]).max() < 1e-5 * np.abs(table.G).max()


@pytest.mark.parametrize(("active", "s"), [([], 0), ([0], 1), ([0, 1], 3)])
def test_a_drop_is_the_difference_of_two_fits(made, active: list[int], s: int) -> None:
    table, target, base = made
    before, after = (least_squares(table, target, base, own)[1] for own in (active, [*active, s]))
    left = swept(table, table.columns(active))
    assert left.drop(table.slots[s].columns) == pytest.approx(before - after, rel=1e-4, abs=1e-3)


def test_what_the_model_holds_already_drops_nothing(made) -> None:
    table, _, _ = made
    left = swept(table, table.columns([1]))
    assert left.drop(table.slots[1].columns) == pytest.approx(0.0, abs=1e-6)


def test_further_shapes_are_as_if_they_had_been_there() -> None:
    wide = term("actuator.cogging", "joint1", shapes=(0.5, 1.0, 2.0, 0.7, 1.3))
    narrow = replace(wide, shapes=wide.shapes[:3])
    target = Rows([wide], count=200).target({})
    one, other = Rows([wide], count=200), Rows([narrow], count=200)
    whole = one.table(target)
    grown = other.table(target)
    grown = grown.with_shapes(grown.term(0), [0.7, 1.3])
    assert [slot.shape for slot in grown.slots] == [slot.shape for slot in whole.slots]
    assert pytest.approx(whole.G, rel=1e-5, abs=1e-3) == grown.G
    every = np.arange(len(whole.G) - 1)
    for run, own in zip(whole.runs, grown.runs, strict=True):
        assert own.columns(every) == pytest.approx(run.columns(every), abs=1e-6)


def test_blocks_of_two_seconds_and_their_neighbours(made) -> None:
    table, _, _ = made
    # Two seconds of rows each 50 ms: 40 rows, ten seconds: five blocks of each of three trials.
    assert table.units.blocks == 15
    assert np.all(table.units.rows == 40)
    # A block, and its neighbours in its own trial: 2 at the ends, 3 inside.
    assert sorted(table.units.near.sum(axis=0).astype(int)) == [2] * 6 + [3] * 9


def test_columns_that_a_run_lacks_are_zero(made) -> None:
    table, _, _ = made
    run = replace(table.runs[0], used=np.array([1, 4]), design=np.ones((200, 2)))
    assert run.columns(np.array([0, 1, 4, 5])) == pytest.approx(np.tile([0.0, 1.0, 1.0, 0.0], (200, 1)))


LOADED = frozenset({"free_02", "free_03"})


def in_trials(rows: Rows, when: str) -> np.ndarray:
    """1 in the trials of that kind, 0 elsewhere, (channels, trials, 1)."""
    names = [f"free_{k + 1:02d}" in LOADED for k in range(rows.trials)]
    return np.array([own == (when == "load") for own in names], dtype=float)[None, :, None]


@pytest.mark.parametrize("when", ["free", "load"])
@pytest.mark.parametrize("active", [[], [1, 2]])
@pytest.mark.parametrize("s", [0, 3])
def test_a_drop_in_some_trials_only_is_the_difference_of_two_fits(when, active: list[int], s: int) -> None:
    rows = Rows(TERMS, count=200, channels=2, trials=3, loaded=LOADED)
    target = rows.target({"friction.coulomb@joint1": 0.5, "elastic.joint@joint1": [1.0, -2.0]})
    table = rows.table(target)
    base = [rows.base_columns[c, k] for c in range(2) for k in range(3)]
    own = rows.of(table.term(s), table.slots[s].shape) * in_trials(rows, when)[..., None]
    X = stacked(table, base, active)
    before, after = (squares_left(A, target) for A in (X, np.column_stack([X, own.reshape(len(X), -1)])))
    left = swept(table, table.columns(active), when)
    assert left.drop(table.slots[s].columns) == pytest.approx(before - after, rel=1e-4, abs=1e-3)


def squares_left(X: np.ndarray, target: np.ndarray) -> float:
    y = target.reshape(-1)
    r = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    return float(r @ r)


@pytest.mark.parametrize("when", ["free", "load"])
def test_a_term_in_some_trials_only_has_its_columns_there_and_none_elsewhere(when) -> None:
    rows = Rows(TERMS, count=200, channels=2, trials=3, loaded=LOADED)
    whole = rows.table(rows.target({"friction.coulomb@joint1": 0.5}))
    table = whole.only_in(whole.term(3), when)
    fresh = [s for s in range(len(table.slots)) if s >= len(whole.slots)]
    assert [table.slots[s].shape for s in fresh] == list(TERMS[3].shapes)
    assert all(table.term(s).when == when for s in fresh)
    for run in table.runs:
        here = float((run.trial in LOADED) == (when == "load"))
        assert run.columns(table.columns(fresh)) == pytest.approx(
            here * run.columns(table.columns([3, 4, 5]))
        )
    left, half = swept(table, table.columns([1])), swept(table, table.columns([1]), when)
    for s, of in zip(fresh, (3, 4, 5), strict=True):
        drop = left.drop(table.slots[s].columns)
        assert drop == pytest.approx(half.drop(table.slots[of].columns), rel=1e-4, abs=1e-3)
