"""The members of a diagnosis' ties as columns of one regression, and what the study says of them already.

Names are looked up in the catalogue and nowhere else; of several forms of one name (in some trials only, with
another period) the one that the study supports best stands for it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from impid_host.design.divergence import Index, Member, fitted, triangle
from impid_host.design.tie_file import Named, OpenQuestions
from impid_host.diagnosis.base import lacking
from impid_host.diagnosis.case import Case
from impid_host.diagnosis.noise import Taps, whitened
from impid_host.diagnosis.refit import Refit, refit, with_slope
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.rows import Run, Slot, rows_of, slots_of
from impid_host.effects.catalogue import terms
from impid_host.effects.effect import Term
from impid_host.errors import InputError
from impid_host.signals.arrays import Floats

_PER_PARAMETER = 2.0  # squares that a parameter must lower, of unit noise (Akaike)


@dataclass(frozen=True, slots=True)
class Tied:
    """One tie.

    Attributes:
        labels: of its members; pairs: those of them that a trial could tell apart. What a member holds of
            others by its equation is beside it in every trial, and is in no pair.
    """

    labels: tuple[str, ...]
    pairs: tuple[tuple[Member, Member], ...]


@dataclass(frozen=True, slots=True)
class Known:
    """What the study says.

    Attributes:
        case: its base may hold loads that no trial has had yet.
        plain: the model without effects.
        slots: places of all members' columns, behind those of the base.
        rows: the triangle of the study's whitened rows, (k, k).
    """

    case: Case
    taps: Taps
    plain: Refit
    slots: tuple[Slot, ...]
    rows: Floats
    ties: tuple[Tied, ...]


def known(case: Case, taps: Taps, questions: OpenQuestions) -> Known:
    """The study with the ties' members fitted to it.

    Raises:
        InputError: the diagnosis names what this study could not hold.
    """
    plain = refit(case, [], taps)
    offered = lacking(case.base, terms(case.setting))
    beside, members = _wanted(offered, questions)
    tried = slots_of({term.kind: term for forms in (*beside, *members.values()) for term in forms}.values())
    rows, target = _stacked(_study_runs(case, plain, tried, taps), case.base.size, tried)
    base = np.arange(case.base.size)
    common: list[Chosen] = []
    columns = base
    for forms in beside:
        part, own = _best(rows, target, columns, _of(tried, forms, case.base.size))
        common.append(part)
        columns = np.concatenate([columns, own])
    chosen = {
        label: _best(rows, target, columns, _of(tried, forms, case.base.size))[0]
        for label, forms in members.items()
    }
    parts = [*common, *chosen.values()]
    slots = slots_of([with_slope(part) for part in parts])
    rows, target = _stacked(_study_runs(case, plain, slots, taps), case.base.size, slots)
    places = [_place(slot, case.base.size) for slot in slots]
    with_common = np.concatenate([base, *places[: len(common)]])
    plainly = fitted(rows, target, with_common)[0]
    fits = {
        label: fitted(rows, target, np.concatenate([with_common, place]))[0]
        for label, place in zip(chosen, places[len(common) :], strict=True)
    }
    ties = tuple(_tied(labels, chosen, fits, plainly) for labels in questions.ties)
    return Known(case, taps, plain, tuple(slots), rows, ties)


def _tied(labels: Sequence[str], chosen: dict[str, Chosen], fits: dict[str, Member], plainly: Member) -> Tied:
    """All pairs of the labelled; of one alone, whether it is there."""
    if len(labels) == 1:
        return Tied(tuple(labels), ((fits[labels[0]], plainly),))
    held = {name for label in labels for name in chosen[label].term.holds}
    told = [label for label in labels if label not in held]
    pairs = [(fits[one], fits[other]) for one, other in combinations(told, 2)]
    return Tied(tuple(labels), tuple(pairs))


def _wanted(
    offered: Sequence[Term], questions: OpenQuestions
) -> tuple[list[list[Term]], dict[str, list[Term]]]:
    """Forms of each effect that stands beside the ties, and of each of their members."""
    members: dict[str, list[Term]] = {}
    for label in dict.fromkeys(label for tie in questions.ties for label in tie):
        members[label] = [term for term in offered if term.label == label]
        if not members[label]:
            what = f"names {label}, which no form of the catalogue can be in this study"
            raise InputError(questions.path, what, "diagnose this study again with this version")
    beside = []
    for own in questions.named:
        tied = {place for label in members for place in _places(label, own.effect)}
        beside += [
            [term for term in offered if (term.effect, term.where) == (own.effect, places)]
            for places in _entries(offered, own)
            if not tied & set(places)
        ]
    return beside, members


def _places(label: str, effect: str) -> tuple[str, ...]:
    name, _, where = label.partition("@")
    return tuple(where.split("+")) if name == effect else ()


def _entries(offered: Sequence[Term], own: Named) -> list[tuple[str, ...]]:
    """The effect's places as one term has them, or as several do."""
    there = {term.where for term in offered if term.effect == own.effect}
    if own.where in there:
        return [own.where]
    return [(place,) for place in own.where if (place,) in there]


def _study_runs(case: Case, plain: Refit, slots: Sequence[Slot], taps: Taps) -> list[Run]:
    runs: list[Run] = []
    for view in plain.views:
        if view.name in case.holdout.fit:
            runs += whitened(rows_of(view, case.base, slots, case.holdout), taps)
    return runs if case.references is None else [*runs, case.references]


def design_of(runs: Iterable[Run], slots: Sequence[Slot]) -> Floats:
    """[base | columns of the slots] of all runs, (N, k)."""
    wanted = np.arange(slots[-1].columns.stop if slots else 0)
    return np.concatenate([np.column_stack([run.base, run.columns(wanted)]) for run in runs])


def _stacked(runs: Sequence[Run], size: int, slots: Sequence[Slot]) -> tuple[Floats, Floats]:
    """Design and target of all rows, by the triangle that stands for them."""
    target = np.concatenate([run.target for run in runs])
    whole = triangle(np.column_stack([design_of(runs, slots), target]))
    assert whole.shape[1] == size + (slots[-1].columns.stop if slots else 0) + 1
    return whole[:, :-1], whole[:, -1]


def _place(slot: Slot, size: int) -> Index:
    return np.arange(size + slot.columns.start, size + slot.columns.stop)


def _of(slots: Sequence[Slot], forms: Sequence[Term], size: int) -> list[tuple[Slot, Index]]:
    kinds = {term.kind for term in forms}
    return [(slot, _place(slot, size)) for slot in slots if slot.term.kind in kinds]


def _best(
    rows: Floats, target: Floats, beside: Index, options: Sequence[tuple[Slot, Index]]
) -> tuple[Chosen, Index]:
    """The form and shape that leave least, a price for each parameter counted."""
    best: tuple[float, Slot, Index, Floats] | None = None
    for slot, own in options:
        member, left = fitted(rows, target, np.concatenate([beside, own]))
        score = left + _PER_PARAMETER * slot.term.parameters
        if best is None or score < best[0]:
            best = (score, slot, own, member.value[len(beside) :])
    assert best is not None
    _, slot, own, beta = best
    term = slot.term if slot.term.shaped else replace(slot.term, shapes=(slot.shape,))
    return Chosen(term, slot.shape, beta, np.eye(len(beta))), own
