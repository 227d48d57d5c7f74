"""What every term of the catalogue promises, in every kind of apparatus; nothing here knows an effect."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from itertools import product

import numpy as np
import pytest
from impid_host.diagnosis.base import targets
from impid_host.diagnosis.correct import corrected
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.rows import columns_in
from impid_host.effects.bounds import numbers, outside, possible
from impid_host.effects.catalogue import CATALOGUE, telling_trial, terms
from impid_host.effects.effect import Term
from impid_host.effects.structure import structures
from impid_host.effects.view import ANGLE, FORCE, SPECIFIC_FORCE, TORQUE, Columns, View

from .apparatus import INSIDE, KINDS, Apparatus, apparatus

# Of diagnosis-format.md; a third joint is one more of the first.
PLACES = {"x", "y", "tip", "load", "sensor"}


@cache
def terms_in(kind: str) -> tuple[Term, ...]:
    return tuple(terms(apparatus(kind).setting))


CASES = [(kind, name) for kind in KINDS for name in sorted({t.effect for t in terms_in(kind)})]
MOVING = [(k, n) for k, n in CASES if any(t.undo for t in terms_in(k) if t.effect == n)]


def of(kind: str, effect: str) -> tuple[Apparatus, list[Term]]:
    return apparatus(kind), [term for term in terms_in(kind) if term.effect == effect]


def some_shapes(term: Term) -> list[float]:
    """First, middle and last."""
    return sorted({term.shapes[0], term.shapes[len(term.shapes) // 2], term.shapes[-1]})


def possible_beta(term: Term, shape: float) -> np.ndarray:
    """Parameters that the term calls possible, of an ordinary size; fails where there are none."""
    rng = np.random.default_rng(0)
    for size in (0.01, 0.1, 1.0, 1e-3, 1e-4):
        for _ in range(60):
            beta = size * rng.standard_normal(term.size)
            if possible(term, beta, shape):
                return beta
        for signs in product((1.0, -1.0), repeat=min(term.size, 5)):
            beta = size * np.resize(np.array(signs), term.size)
            if possible(term, beta, shape):
                return beta
    raise AssertionError(f"no possible parameters: {term.label} {term.variant} at {shape}")


def channels(view: View) -> dict[str, int]:
    """How many channels each family has in a trial."""
    return {family: block.shape[1] for family, block in targets(view).items()}


@pytest.mark.parametrize(("kind", "effect"), CASES)
def test_columns_are_finite_and_of_the_shape_that_is_promised(kind: str, effect: str) -> None:
    here, own = of(kind, effect)
    for term, view in product(own, here.views):
        for shape in some_shapes(term):
            for family, block in columns_in(term, view, shape).items():
                if family in channels(view):
                    assert block.shape == (len(view.t), channels(view)[family], term.size), term.variant
                else:
                    assert family in (TORQUE, SPECIFIC_FORCE, FORCE, ANGLE)
                assert np.all(np.isfinite(block)), (term.variant, shape)


@pytest.mark.parametrize(("kind", "effect"), CASES)
def test_every_parameter_shows_somewhere(kind: str, effect: str) -> None:
    """A column of zeros in all trials would be a parameter that nothing determines."""
    here, own = of(kind, effect)
    for term in own:
        shape = term.shapes[len(term.shapes) // 2]
        shows = np.zeros(term.size)
        for view in here.views:
            for family, block in columns_in(term, view, shape).items():
                if family in channels(view):
                    shows += np.sum(block**2, axis=(0, 1))
        assert np.all(shows > 0), (term.where, term.variant, term.when)


@pytest.mark.parametrize(("kind", "effect"), CASES)
def test_a_term_acts_in_the_trials_that_it_says(kind: str, effect: str) -> None:
    here, own = of(kind, effect)
    for term, view in product(own, here.views):
        columns = columns_in(term, view, term.shapes[0])
        loaded = view.load is not None
        if term.when == "load" or CATALOGUE[effect].acts_on == "load":
            assert loaded or all(not block.any() for block in columns.values()), term.variant
        if term.when == "free":
            assert not loaded or not columns
        q = term.size // max(len(term.own), 1)
        for block in columns.values():
            alive = np.flatnonzero(np.any(block != 0, axis=(0, 1)))
            names = {term.own[k // q] for k in alive} if term.own else set()
            assert names <= {view.name, view.load}, term.variant


@pytest.mark.parametrize(("kind", "effect"), CASES)
def test_what_is_read_has_the_catalogues_names_units_and_places(kind: str, effect: str) -> None:
    here, own = of(kind, effect)
    row = CATALOGUE[effect]
    joints = {f"joint{k + 1}" for k in range(here.setting.joints)}
    labels = {term.label for term in terms_in(kind)}
    for term in own:
        assert set(term.where) <= PLACES | joints
        assert len(set(term.where)) == len(term.where)
        assert set(term.holds) <= labels
        for shape in some_shapes(term):
            beta = possible_beta(term, shape)
            found = term.read(beta, shape)
            assert found
            for name, value in found.items():
                assert row.unit(name)
                assert term.units[name]
                assert all(np.isfinite(number) for number in numbers(value)), name
                if term.own:
                    assert isinstance(value, dict)
                    assert tuple(value) == term.own
            assert not outside(term, beta, shape)


@pytest.mark.parametrize(("kind", "effect"), CASES)
def test_what_is_not_finite_is_impossible(kind: str, effect: str) -> None:
    _, own = of(kind, effect)
    for term in own:
        beta = possible_beta(term, term.shapes[0])
        beta[-1] = np.nan
        assert not possible(term, beta, term.shapes[0])


def louder_answer(respond: Callable[[View], Columns], view: View) -> Columns:
    """Of a model that answers half as much again, but for the sensor's reading."""
    answer = respond(view)
    return {family: 1.5 * own if family != SPECIFIC_FORCE else own for family, own in answer.items()}


@pytest.mark.parametrize(("kind", "effect"), CASES)
def test_only_what_says_so_follows_the_present_model(kind: str, effect: str) -> None:
    """Columns that change with the model's torque, stiffness or response must be made anew with it."""
    here, own = of(kind, effect)
    for view in (here.views[0], here.loaded):
        assert view.respond is not None
        louder = louder_answer(view.respond, view)
        stiffer = replace(
            view,
            response=louder,
            torque_model=1.3 * view.torque_model + 0.1,
            x0=view.x0 + 0.01,
            K=1.5 * view.K,
            alpha=None if view.alpha is None else 1.2 * view.alpha,
            respond=partial(louder_answer, view.respond),
        )
        for term in own:
            shape = term.shapes[len(term.shapes) // 2]
            before, after = columns_in(term, view, shape), columns_in(term, stiffer, shape)
            same = set(before) == set(after) and all(np.array_equal(before[f], after[f]) for f in before)
            assert same or term.by_model, (term.where, term.variant)


def added(view: View, columns: Columns, beta: np.ndarray) -> View:
    """The trial with an effect in what was measured; the force sensor reads the load's force on the robot."""
    tau = view.tau + columns[TORQUE] @ beta if TORQUE in columns else view.tau
    measured, force = view.measured, view.force
    if SPECIFIC_FORCE in columns and measured is not None:
        measured = measured + columns[SPECIFIC_FORCE] @ beta
    if FORCE in columns and force is not None:
        force = force - columns[FORCE] @ beta
    return replace(view, tau=tau, measured=measured, force=force)


@pytest.mark.parametrize(("kind", "effect"), CASES)
def test_what_was_added_is_taken_out_again(kind: str, effect: str) -> None:
    here, own = of(kind, effect)
    for term, view in product((term for term in own if term.undo is None), here.views):
        shape = term.shapes[-1]
        beta = possible_beta(term, shape)
        chosen = Chosen(term, shape, beta, np.eye(term.size))
        whole = corrected(added(view, columns_in(term, view, shape), beta), [chosen])
        for family, truth in targets(view).items():
            assert np.abs(targets(whole)[family] - truth).max() < 1e-9, (term.variant, family)


def left(view: View) -> dict[str, np.ndarray]:
    """What the present model leaves of a trial, by family, without the ends."""
    assert view.respond is not None
    answer = view.respond(view)
    result = {}
    for family, measured in targets(view).items():
        model = 0.0 if family in (ANGLE, SPECIFIC_FORCE) else answer[family]
        result[family] = (measured - model)[INSIDE]
    return result


@pytest.mark.parametrize(("kind", "effect"), MOVING)
def test_taking_out_is_what_the_columns_say_to_second_order(kind: str, effect: str) -> None:
    """Undoing beta in a trial without the effect leaves minus its columns; the error falls with beta^2.

    The match of the clocks is free to move all angles of a trial, by less than a hundredth of what it finds.
    """
    here, own = of(kind, effect)
    for term, view in product(own, here.views):
        if term.undo is None or not term.acts_in(view):
            continue
        columns = columns_in(term, view, term.shapes[0])
        beta = 1e-3 * np.resize([1.0, -0.7, 0.5], term.size)
        beta = np.abs(beta) if not possible(term, beta, term.shapes[0]) else beta
        errors = []
        for part in (1.0, 0.5):
            own_left = left(term.undo(view, part * beta, term.shapes[0]))
            gap, size = 0.0, 0.0
            for family, r in own_left.items():
                block = columns.get(family, np.zeros((len(view.t), r.shape[1], term.size)))
                expected = -(block @ (part * beta))[INSIDE]
                scale = max(float(np.std(view.tau)), 1e-3) if family == TORQUE else 1.0
                gap += float(np.sum(((r - expected) / scale) ** 2))
                size += float(np.sum((expected / scale) ** 2))
            errors.append((np.sqrt(gap), np.sqrt(size)))
        (far, size), (near, _) = errors
        assert far < 0.03 * size + 1e-9, (term.where, term.variant, view.name, far / max(size, 1e-300))
        assert near < 0.3 * far + 5e-3 * size + 1e-9, term.variant


@pytest.mark.parametrize(("kind", "effect"), MOVING)
def test_undoing_nothing_changes_nothing(kind: str, effect: str) -> None:
    here, own = of(kind, effect)
    for term, view in product(own, here.views):
        if term.undo is None:
            continue
        same = term.undo(view, np.zeros(term.size), term.shapes[0])
        for family, truth in targets(view).items():
            assert np.abs(targets(same)[family] - truth)[INSIDE].max() < 1e-9, (term.variant, family)


@pytest.mark.parametrize("kind", KINDS)
def test_no_two_terms_are_the_same(kind: str) -> None:
    """The search and saved models find a term again by effect, place, variant and when."""
    kinds = [(t.effect, t.where, t.variant, t.when) for t in terms_in(kind)]
    assert len(kinds) == len(set(kinds)), sorted({k for k in kinds if kinds.count(k) > 1})


@pytest.mark.parametrize("kind", KINDS)
def test_what_the_model_holds_already_is_left_out(kind: str) -> None:
    setting = apparatus(kind).setting
    assert all(term.effect != "friction.coulomb" for term in terms(setting, without=("friction.coulomb",)))
    assert any(term.effect == "friction.coulomb" for term in terms(setting))


@pytest.mark.parametrize("kind", KINDS)
def test_unnamed_structures_keep_the_same_promises(kind: str) -> None:
    here = apparatus(kind)
    own = structures(here.views, here.setting)
    assert own
    kinds = [(t.where, t.variant) for t in own]
    assert len(kinds) == len(set(kinds))
    for term in own:
        shows = np.zeros(term.size)
        for view in here.views:
            for family, block in term.columns(view, 0.0).items():
                assert block.shape == (len(view.t), channels(view)[family], term.size), term.variant
                assert np.all(np.isfinite(block)), term.variant
                shows += np.sum(block**2, axis=(0, 1))
        assert not term.named
        assert shows.any()


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=lambda effect: effect.name)
def test_every_row_says_where_it_is_from_what_tells_it_and_what_it_belongs_to(effect) -> None:
    assert effect.equation and effect.source
    assert effect.carries in ("machine", "record", "load")
    assert effect.acts_on in ("robot", "actuator", "sensor", "clock", "load")
    assert set(effect.tells) <= {"", *CATALOGUE}
    assert all(effect.tells.values())
    assert all(row.unit and row.low <= row.high for row in effect.parameters)
    assert len({row.name for row in effect.parameters}) == len(effect.parameters)
    assert set(effect.adds_to) <= {row.name for row in effect.parameters}
    for other in CATALOGUE:
        assert telling_trial([f"{effect.name}@load", f"{other}@sensor"])


def test_every_row_can_be_tried_somewhere() -> None:
    assert {name for _, name in CASES} == set(CATALOGUE)
