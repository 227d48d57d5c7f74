"""The search on rows whose truth is known: what is there is found, what is not stays out."""

import numpy as np
import pytest
from impid_host.diagnosis.search import RULES, search, size_that_matters

from .synthetic import Rows, curve, term

MANY = [
    *(term(f"friction.{name}", "joint1") for name in ("coulomb", "stribeck", "quadratic")),
    *(term("elastic.joint", f"joint{k}", size=2) for k in (1, 2)),
    *(term("actuator.offset", f"joint{k}") for k in (1, 2)),
    *(term("accel.scale", axis) for axis in "xy"),
    curve("tau1", "theta1", 6),
    curve("tau1", "time", 6),
]


def names(found) -> set[str]:
    return {found.table.term(s).label for s in found.best.slots}


@pytest.mark.parametrize("seed", range(5))
def test_pure_noise_has_no_cause(seed: int) -> None:
    rows = Rows(MANY, seed=seed)
    assert not search(rows.table(rows.target({}))).best.slots


@pytest.mark.parametrize("seed", range(3))
def test_a_sparse_truth_is_found_and_nothing_else(seed: int) -> None:
    truth = {"friction.coulomb@joint1": 0.6, "elastic.joint@joint2": [0.5, -0.5], "accel.scale@x": -0.4}
    rows = Rows(MANY, seed=seed)
    found = search(rows.table(rows.target(truth)))
    assert names(found) == set(truth)
    terms = [found.table.term(s) for s in found.best.slots]
    place = [own.label for own in terms].index("accel.scale@x")
    first = sum(own.size for own in terms[:place])
    assert found.best.beta[first] == pytest.approx(-0.4, abs=4 / np.sqrt(1600))


def test_what_is_too_small_to_matter_is_not_named() -> None:
    """0.1 sd of the noise in 8,000 rows: nine standard errors, and one percent of a row's variance."""
    rows = Rows(MANY, trials=20)
    table = rows.table(rows.target({"friction.coulomb@joint1": 0.1}))
    assert not search(table).best.slots
    assert not size_that_matters(table, [0], 0)
    assert size_that_matters(rows.table(rows.target({"friction.coulomb@joint1": 0.4})), [0], 0)


def test_a_structure_without_a_name_is_left_without_one() -> None:
    label = MANY[-2].label
    rows = Rows(MANY)
    found = search(rows.table(rows.target({label: [0.5, 0.3, -0.4, 0.6, 0.2, -0.3]})))
    assert names(found) == {label}


def test_a_name_stands_before_a_structure_that_holds_it() -> None:
    """The structure's columns hold the name's: they predict alike, and the name is the simpler."""
    plain, wide = term("friction.coulomb", "joint1"), curve("tau1", "theta1", 4)
    rows = Rows([plain, wide])
    rows.of(wide, 0.0)[..., 0] = rows.of(plain, 0.0)[..., 0]
    found = search(rows.table(rows.target({plain.label: 0.6})))
    assert names(found) == {plain.label}


def test_parameters_out_of_bounds_are_no_explanation() -> None:
    shut = term("friction.coulomb", "joint1", gate=lambda beta, _shape: bool(beta[0] > 0))
    rows = Rows([shut])
    assert names(search(rows.table(rows.target({shut.label: 0.6})))) == {shut.label}
    assert not search(rows.table(rows.target({shut.label: -0.6}))).best.slots


def test_a_shape_between_those_that_were_tried_is_found() -> None:
    """A sine at 1.13 Hz; 20 s of it tell a frequency to sqrt(24 / N) / (amplitude pi T), some mHz."""
    wave = term("actuator.cogging", "joint1", shapes=tuple(np.linspace(0.9, 1.4, 11)))
    rows = Rows([wave])
    found = search(rows.table(rows.target({wave.label: 0.8}, shape=1.13)))
    (s,) = found.best.slots
    assert found.table.slots[s].shape == pytest.approx(1.13, abs=0.005)
    assert found.best.beta[0] == pytest.approx(0.8, abs=4 / np.sqrt(800))


def test_given_terms_stay_in() -> None:
    rows = Rows(MANY)
    found = search(rows.table(rows.target({"friction.coulomb@joint1": 0.6})), given=(0,))
    assert found.best.slots == ()


def test_the_rules_are_few() -> None:
    assert len(type(RULES).__dataclass_fields__) <= 14


@pytest.mark.parametrize("when", ["all", "free", "load"])
def test_an_effect_is_found_in_the_trials_that_have_it(when: str) -> None:
    """Two of six trials are under load; what is in all trials is not said of some."""
    loaded = frozenset({"free_02", "free_05"})
    rows = Rows(MANY, trials=6, loaded=loaded)
    target = rows.target({})
    for k in range(6):
        if when == "all" or (f"free_{k + 1:02d}" in loaded) == (when == "load"):
            target[:, k] += 0.8 * rows.of(MANY[0], 0.0)[:, k, :, 0]
    found = search(rows.table(target))
    assert names(found) == {MANY[0].label}
    assert [found.table.term(s).when for s in found.best.slots] == [when]
