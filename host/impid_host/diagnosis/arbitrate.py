"""Arbitration: where two explanations are alike, what each would make of the patient's arm; nobody is blamed.

A tie whose members would report another robot or another load is material. Between instruments, or where the
name is not likely by itself, it is left open: the last stage's interval covers all of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.choice import Choice, probability
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Chosen, Number, Stage, Tie
from impid_host.diagnosis.search import RULES
from impid_host.diagnosis.stages import Bench
from impid_host.diagnosis.ties import Rivals, rivals
from impid_host.effects.bounds import possible
from impid_host.effects.catalogue import CATALOGUE, telling_trial

_MATERIAL = 0.005  # of a matrix's largest entry: nobody would report a difference below
# Of the deviance: of two names as simple, one that is better by less is no reason to leave the search's own.
_PREFERRED = 2 * RULES.close_nats
_INSTRUMENTS = ("actuator", "sensor", "clock")


@dataclass(frozen=True, slots=True)
class Verdict:
    """What arbitration says.

    Attributes:
        open_slots: names that a material tie between instruments leaves open.
        covering: alpha and loads whose intervals cover all members of the ties; None where there is nothing
            to cover.
    """

    ties: tuple[Tie, ...]
    open_slots: tuple[int, ...]
    covering: Stage | None


def exactly_compared(
    choice: Choice, bench: Bench, named: Mapping[int, Chosen], fit: Refit
) -> tuple[Choice, dict[int, Chosen], Refit]:
    """Each name exchanged for a rival alike to first order, where the exact refits prefer the rival."""
    kept = dict(named)
    no_cause = {part.term.label for part, _ in choice.resembled}
    for own in rivals(choice.walk, choice.best):
        if own.slot not in kept:
            continue
        best, slot, part = fit, own.slot, kept[own.slot]
        for rival in own.others:
            tried = _as_chosen(choice, own.slot, rival)
            if tried.term.label in no_cause:
                continue
            other = bench.fit([tried if s == own.slot else p for s, p in kept.items()])
            more = tried.term.parameters - part.term.parameters
            margin = _PREFERRED if more == 0 else 1.0  # the simpler one is preferred as it is
            if more <= 0 and other.deviance < best.deviance - margin and _stands(other):
                best, slot, part = other, rival, tried
        if slot != own.slot:
            kept = {slot if s == own.slot else s: part if s == own.slot else p for s, p in kept.items()}
            everything = tuple(slot if s == own.slot else s for s in choice.best.slots)
            names = tuple(slot if s == own.slot else s for s in choice.named)
            choice = replace(choice, best=choice.walk.score(everything), named=names)
            fit = best
    return choice, kept, fit


def _stands(fit: Refit) -> bool:
    return all(possible(part.term, part.beta, part.shape) for part in fit.chosen)


def arbitrated(choice: Choice, bench: Bench, chosen: Mapping[int, Chosen], fit: Refit) -> Verdict:
    """Ties of the chosen names, with the exact refits of their members compared.

    Args:
        chosen: the named slots' terms at their refitted values; fit: all of them together.
    """
    ties, left_open, stages = [], [], []
    plain = bench.stage(fit, None) if chosen else None
    for own in rivals(choice.walk, choice.best):
        if own.slot not in chosen or plain is None:
            continue
        members = _members(choice, bench, chosen, fit, own)
        under = {chosen[own.slot].term.label: plain} | {label: stage for stage, label in members}
        labels = [label for label in own.labels if label in under or label in chosen[own.slot].term.holds]
        if len(labels) < 2:
            continue
        doubtful = probability(choice.walk, [own.slot]) < RULES.likely
        material = doubtful or _differ(list(under.values()))
        ties.append(
            Tie(
                tuple(labels),
                telling_trial(labels),
                {label: (stage.alpha, stage.loads) for label, stage in under.items()} if material else {},
            )
        )
        if material:
            stages += list(under.values())
            if doubtful or _between_instruments(list(under)):
                left_open.append(own.slot)
    covering = None if plain is None or not stages else _covered(plain, stages)
    return Verdict(tuple(_once(ties)), tuple(left_open), covering)


def _members(
    choice: Choice, bench: Bench, chosen: Mapping[int, Chosen], fit: Refit, own: Rivals
) -> list[tuple[Stage, str]]:
    """The rivals whose exact refit is not clearly worse, with what they would report."""
    result = []
    for slot, se in zip(own.others, own.se, strict=True):
        rival = _as_chosen(choice, own.slot, slot)
        other = bench.fit([*(part for s, part in chosen.items() if s != own.slot), rival])
        worse = 0.5 * (other.deviance - fit.deviance)
        if worse < max(RULES.close_sigmas * se, RULES.close_nats) and _stands(other):
            result.append((bench.stage(other, None), rival.term.label))
    return result


def _as_chosen(choice: Choice, slot: int, rival: int) -> Chosen:
    """A rival in the slot's place, with the value that the search has for it."""
    entry = choice.table.slots[rival]
    term = entry.term if entry.term.shaped else replace(entry.term, shapes=(entry.shape,))
    rest = tuple(s for s in choice.best.slots if s != slot)
    beta = choice.walk.score((*rest, rival)).beta[-term.size :]
    return Chosen(term, entry.shape, beta, np.eye(term.size))


def _differ(stages: Sequence[Stage]) -> bool:
    """Whether any two would report another robot or load, by more than nobody would care about."""
    first = _numbers(stages[0])
    return any(
        name not in own or _apart(number, own[name])
        for own in (_numbers(other) for other in stages[1:])
        for name, number in first.items()
    )


def _apart(one: Number, other: Number) -> bool:
    if one.value.shape != other.value.shape:
        return True
    size = float(np.max(np.abs(one.value))) + 1e-300
    gap = np.abs(one.value - other.value)
    return bool(np.any((gap > _MATERIAL * size) & (gap > np.minimum(one.half, other.half))))


def _numbers(stage: Stage) -> dict[tuple[str, str], Number]:
    """Everything that a stage reports, by load and letter."""
    loads = {(name, letter): own for name, load in stage.loads.items() for letter, own in load.items()}
    return {("", "alpha"): stage.alpha, **loads}


def _between_instruments(labels: Sequence[str]) -> bool:
    return all(CATALOGUE[label.partition("@")[0]].acts_on in _INSTRUMENTS for label in labels)


def _covered(stage: Stage, others: Sequence[Stage]) -> Stage:
    """The stage with intervals that cover those of all others."""
    alpha = _hull([stage.alpha, *(other.alpha for other in others)])
    loads = {
        name: {
            letter: _hull([number, *(o.loads[name][letter] for o in others if letter in o.loads[name])])
            for letter, number in load.items()
        }
        for name, load in stage.loads.items()
    }
    return replace(stage, alpha=alpha, loads=loads)


def _hull(numbers: Sequence[Number]) -> Number:
    alike = [own for own in numbers if own.value.shape == numbers[0].value.shape]
    low = np.min([own.ci95[..., 0] for own in alike], axis=0)
    high = np.max([own.ci95[..., 1] for own in alike], axis=0)
    return replace(numbers[0], ci95=np.stack([low, high], axis=-1))


def _once(ties: Sequence[Tie]) -> list[Tie]:
    """Each set of candidates once."""
    seen: dict[frozenset[str], Tie] = {}
    for tie in ties:
        seen.setdefault(frozenset(tie.candidates), tie)
    return list(seen.values())
