"""What a record has for itself is found anew in it: constant torques and a drift, put in exactly."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from impid_host.diagnosis.base import Base, base_of, textbook_structure
from impid_host.diagnosis.own_record import own_of_record, refitted
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.saved_parts import SavedEffect

from ..effects.apparatus import ALPHA
from ..effects.closed_form import FREE, HAND, Body, K, body, recorded, term

CONSTANT = np.array([0.03, -0.02])
RATE = np.array([2e-3, -1e-3])
PARTS = [recorded(FREE), recorded(HAND)]
BASE = base_of(PARTS, textbook_structure(PARTS[0].model))
TRUE: Body = body(PARTS[0].t)


def model() -> np.ndarray:
    """The known robot without dry friction and constants, and the known load, by its regression on itself."""
    value = np.zeros(BASE.size)
    value[:5] = ALPHA
    block = BASE.columns(PARTS[1])["force"][:, :, BASE.slot("hand")]
    rows = block.reshape(-1, block.shape[2])
    value[BASE.slot("hand")] = np.linalg.lstsq(rows, TRUE.pulls(HAND).ravel(), rcond=None)[0]
    return value


def disturbed() -> list[Any]:
    """Both trials with constant torques; the hand's rest wanders as well."""
    free, hand = PARTS
    moved = (hand.t - 0.5 * hand.t[-1])[:, None] * RATE
    wander = TRUE.lifted(-moved @ K)
    return [replace(free, tau=free.tau + CONSTANT), replace(hand, tau=hand.tau + CONSTANT + wander)]


def none(own) -> Chosen:
    return Chosen(own, 0.0, np.zeros(own.size), np.zeros((own.size, own.size)))


def constants(base: Base, value: np.ndarray) -> np.ndarray:
    names = base.structure.parameter_names
    return value[[k for k, name in enumerate(names) if "offset" in name]]


def test_constants_and_a_drift_are_found_and_all_else_stays() -> None:
    before = model()
    drift = term("load.drift", "load")
    value, present, words = refitted(disturbed(), BASE, before, [], [none(drift)])
    assert constants(BASE, value) == pytest.approx(CONSTANT, abs=1e-6)
    (own,) = present
    assert own.beta == pytest.approx(RATE, abs=1e-7)
    changed = np.flatnonzero(value != before)
    assert len(changed) == 2
    assert len(words) == 3
    assert words[2].startswith("load.drift@load: rate 0.002")


def test_an_effect_that_went_along_is_taken_out_first() -> None:
    spring = term("elastic.joint", "joint1")
    beta = np.array([2.0, -1.2])
    parts = [
        replace(view, tau=view.tau + np.outer(2.0 * view.theta[:, 0] - 1.2, [1.0, 0.0]))
        for view in disturbed()
    ]
    known = Chosen(spring, 0.0, beta, np.zeros((2, 2)))
    value, (own,), _ = refitted(parts, BASE, model(), [known], [none(term("load.drift", "load"))])
    assert constants(BASE, value) == pytest.approx(CONSTANT, abs=1e-6)
    assert own.beta == pytest.approx(RATE, abs=1e-7)
    # Without it the constants would take up what they can of the spring.
    alone, _, _ = refitted(parts, BASE, model(), [], [none(term("load.drift", "load"))])
    assert np.abs(constants(BASE, alone) - CONSTANT).max() > 0.05


def test_what_moves_no_torque_is_left_out() -> None:
    bias = none(term("accel.bias", "x"))
    value, present, words = refitted(disturbed(), BASE, model(), [], [bias])
    assert present == []
    assert len(words) == 2
    assert constants(BASE, value)[0] == pytest.approx(CONSTANT[0], abs=5e-3)


def test_a_model_without_constants_and_own_effects_is_left_as_it_is() -> None:
    bare = replace(BASE, structure=replace(BASE.structure, terms=()))
    value = np.arange(float(bare.size))
    again, present, words = refitted(disturbed(), bare, value, [], [])
    assert again is value
    assert (present, words) == ([], [])


def saved(
    effect: str, *where: str, own: tuple[str, ...] = (), variant: str = "", size: int = 1
) -> SavedEffect:
    return SavedEffect(effect, where, variant, "all", own, 0.0, np.full(size, 0.5), np.eye(size))


def test_only_what_another_record_has_otherwise_is_the_records_own() -> None:
    rows = [
        saved("actuator.offset", "joint1"),
        saved("accel.bias", "x"),
        saved("elastic.joint", "joint1", size=2),
        saved("not.known", "joint1"),
        saved("load.drift", "load", own=("old_01", "old_02"), variant="each", size=4),
        saved("load.damping", "load", variant="equal in x and y"),
    ]
    parts = [recorded(FREE), recorded("spring_A_01"), recorded(HAND)]
    base = base_of(parts, textbook_structure(parts[0].model))
    found = own_of_record(rows, parts, base, None)
    assert [own.term.label for own in found] == [
        "actuator.offset@joint1",
        "accel.bias@x",
        "load.drift@load",
    ]
    assert all(not own.beta.any() and len(own.beta) == own.term.size for own in found)
    # One value for each of this record's trials, not of the old one's.
    assert found[2].term.own == ("spring_A_01", "hand_01")
