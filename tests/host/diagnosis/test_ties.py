"""Alike columns tie; what holds another by its equation is said with it."""

import numpy as np
from impid_host.diagnosis.search import search
from impid_host.diagnosis.ties import chosen_slots, rivals

from .synthetic import Rows, term

GAIN, SCALE = term("actuator.gain", "joint1"), term("force.scale", "x")
DRY = term("friction.coulomb", "joint1")


def test_two_names_of_one_column_tie_and_a_third_does_not() -> None:
    rows = Rows([GAIN, SCALE, DRY], alike={SCALE.label: GAIN.label})
    found = search(rows.table(rows.target({GAIN.label: 0.5, DRY.label: 0.5})))
    by = {found.table.term(own.slot).label: own for own in rivals(found.walk, found.best)}
    (gain,) = (own for label, own in by.items() if label in (GAIN.label, SCALE.label))
    assert set(gain.labels) == {GAIN.label, SCALE.label}
    assert gain.se == (0.0,)
    assert by[DRY.label].others == ()


def test_columns_that_differ_are_told_apart() -> None:
    rows = Rows([GAIN, SCALE, DRY])
    found = search(rows.table(rows.target({GAIN.label: 0.5})))
    (own,) = rivals(found.walk, found.best)
    assert own.labels == (GAIN.label,)


def test_an_effect_on_x_is_no_rival_of_the_same_on_x_and_y() -> None:
    one, both = term("accel.scale", "x"), term("accel.scale", "x", "y", size=2)
    rows = Rows([one, both])
    rows.of(both, 0.0)[..., 0] = rows.of(one, 0.0)[..., 0]
    found = search(rows.table(rows.target({one.label: 0.5})))
    (own,) = rivals(found.walk, found.best)
    assert own.labels == (one.label,)


def test_what_is_held_by_an_equation_is_said_beside_the_name() -> None:
    spring = term("elastic.joint", "joint1", size=2, holds=("actuator.offset@joint1",))
    rows = Rows([spring])
    found = search(rows.table(rows.target({spring.label: [0.5, 0.5]})))
    (own,) = rivals(found.walk, found.best)
    assert own.labels == (spring.label, "actuator.offset@joint1")
    assert own.others == ()


def test_values_of_a_set_are_those_of_least_squares() -> None:
    rows = Rows([GAIN, DRY])
    table = rows.table(rows.target({GAIN.label: 0.5, DRY.label: -0.7}))
    found = search(table)
    parts = {part.term.label: part for part in chosen_slots(found.table, found.best)}
    # Independent columns of unit variance in 1,600 rows of unit noise.
    for label, truth in ((GAIN.label, 0.5), (DRY.label, -0.7)):
        sd = float(np.sqrt(parts[label].covariance[0, 0]))
        assert abs(sd - 1 / np.sqrt(1600)) < 0.002
        assert abs(parts[label].beta[0] - truth) < 4 * sd
