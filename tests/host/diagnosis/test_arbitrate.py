"""Ties between instruments, with refits written by hand."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from impid_host.diagnosis.arbitrate import Verdict, arbitrated
from impid_host.diagnosis.choice import Choice
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Chosen, Number, Stage
from impid_host.diagnosis.search import search
from impid_host.diagnosis.stages import Bench
from impid_host.effects.effect import Term

from .synthetic import Rows, term


def number(value: float, half: float, unit: str) -> Number:
    return Number(np.array([[value]]), np.array([[[value - half, value + half]]]), unit)


class Table:
    """A bench on which each label alone decides what would be reported and how well it fits."""

    def __init__(self, K: dict[str, float], deviance: dict[str, float]) -> None:
        self.K, self.deviance = K, deviance

    def fit(self, chosen: list[Chosen]) -> Refit:
        labels = [part.term.label for part in chosen]
        deviance = sum(self.deviance.get(label, 0.0) for label in labels)
        return Refit((), tuple(chosen), np.eye(len(chosen)), np.zeros(0), deviance)

    def stage(self, fit: Refit, added: Any) -> Stage:
        K = sum(self.K.get(part.term.label, 0.0) for part in fit.chosen)
        load = {"K": number(K, 1.0, "N/m")}
        return Stage(added, {"fx": 1.0}, {"fx": 99.0}, number(0.07, 1e-3, "SI"), ("a",), {"A": load})


def settled(one: Term, other: Term, K: dict[str, float], deviance: dict[str, float] | None = None) -> Verdict:
    rows = Rows([one, other], alike={other.label: one.label})
    found = search(rows.table(rows.target({one.label: 0.5})))
    (s,) = found.best.slots
    choice = SimpleNamespace(walk=found.walk, best=found.best, table=found.walk.table, named=(s,))
    part = Chosen(found.table.term(s), 0.0, found.best.beta, np.eye(1))
    bench = Table(K, deviance or {})
    return arbitrated(cast(Choice, choice), cast(Bench, bench), {s: part}, bench.fit([part]))


GAIN, SCALE = term("actuator.gain", "joint1"), term("force.scale", "x")
APART = {GAIN.label: 300.0, SCALE.label: 315.0}


def test_a_material_tie_between_instruments_leaves_both_open_and_covers_both() -> None:
    found = settled(GAIN, SCALE, APART)
    (tie,) = found.ties
    assert set(tie.candidates) == {GAIN.label, SCALE.label}
    assert "weighed payload" in tie.tell_apart_by
    assert {label: float(loads["A"]["K"].value[0, 0]) for label, (_, loads) in tie.under.items()} == APART
    assert len(found.open_slots) == 1
    assert found.covering is not None
    low, high = found.covering.loads["A"]["K"].ci95[0, 0]
    assert low <= 299.0
    assert high >= 316.0


def test_a_tie_that_moves_nothing_is_said_and_decided() -> None:
    found = settled(GAIN, SCALE, dict.fromkeys(APART, 300.0))
    assert len(found.ties) == 1
    assert not found.ties[0].under
    assert not found.open_slots


def test_a_robots_part_and_an_instrument_are_no_two_instruments() -> None:
    """Which it is stays open as a tie, with both consequences; the interval covers them all the same."""
    dry = term("friction.coulomb", "joint1")
    found = settled(dry, SCALE, {dry.label: 300.0, SCALE.label: 315.0})
    assert len(found.ties) == 1
    assert found.covering is not None
    assert float(np.ptp(found.covering.loads["A"]["K"].ci95)) > 15.0


@pytest.mark.parametrize(("worse", "tied"), [(1.0, True), (100.0, False)])
def test_an_exact_refit_that_is_clearly_worse_breaks_the_tie(worse: float, *, tied: bool) -> None:
    level = dict.fromkeys((GAIN.label, SCALE.label), 0.0)
    rows = Rows([GAIN, SCALE], alike={SCALE.label: GAIN.label})
    found = search(rows.table(rows.target({GAIN.label: 0.5})))
    chosen = found.table.term(found.best.slots[0]).label
    other = SCALE.label if chosen == GAIN.label else GAIN.label
    assert bool(settled(GAIN, SCALE, APART, level | {other: worse}).ties) == tied
