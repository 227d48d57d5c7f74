"""What is sealed, counted by hand."""

from types import SimpleNamespace
from typing import cast

import numpy as np
from impid_host.diagnosis.holdout import FIT, SEALED, Holdout, hold_out, settled
from impid_host.effects.view import View


def trial(name: str, load: str | None = None, seconds: float = 30.0) -> View:
    t = np.arange(0.0, seconds, 0.01)
    return cast(
        View, SimpleNamespace(name=name, load=load, t=t, valid=np.ones(len(t), dtype=bool), report_hz=4.5)
    )


def test_of_three_trials_the_last_is_sealed_of_two_the_last_third_of_each() -> None:
    parts = [trial("free_01"), trial("free_02"), trial("free_03"), trial("A_01", "A"), trial("B_01", "B")]
    found = hold_out(parts)
    assert found.fit == ("A_01", "B_01", "free_01", "free_02")
    assert found.validation == ("A_01", "B_01", "free_03")
    whole, none = found.mask(parts[2], SEALED), found.mask(parts[2], FIT)
    assert whole.all() and not none.any()
    assert found.mask(parts[0], FIT).all() and not found.mask(parts[0], SEALED).any()


def test_a_split_trial_pauses_before_its_sealed_third() -> None:
    own = trial("A_01", "A")
    found = hold_out([own])
    fit, sealed = found.mask(own, FIT), found.mask(own, SEALED)
    assert not np.any(fit & sealed)
    assert own.t[fit].max() < 19.0 < 19.9 < own.t[sealed].min() <= 20.0
    assert own.t[sealed].max() == own.t[-1]


def test_an_event_is_cut_from_the_fit_part_and_stays_in_the_sealed_one() -> None:
    own = trial("A_01", "A")
    found = Holdout(("A_01",), ("A_01",), (("A_01", 5.0, 8.0), ("A_01", 22.0, 25.0), ("other", 0.0, 30.0)))
    fit, sealed = found.mask(own, FIT), found.mask(own, SEALED)
    assert not fit[(own.t > 5.0) & (own.t < 8.0)].any()
    assert fit[own.t <= 5.0].all()
    assert sealed[own.t >= 20.0].all()


def test_rows_that_are_not_valid_are_in_neither_part() -> None:
    own = trial("A_01", "A")
    own.valid[100:200] = False
    found = hold_out([own])
    assert not found.mask(own, FIT)[100:200].any()


def test_ends_lose_more_than_gaps() -> None:
    mask = np.ones(1000, dtype=bool)
    mask[500:510] = False
    inner = settled(mask, 100.0, 0.5)
    assert not inner[:50].any() and not inner[-50:].any()
    assert inner[51:469].all() and inner[541:949].all()
    assert not inner[471:539].any()
    assert not settled(np.zeros(10, dtype=bool), 100.0, 0.5).any()
