"""What counts as right. Frozen before any verdict was looked at.

Names. A report's names are the effects added in its stages, but `unattributed`, and but those that a tie lists:
a name that stands in an entry of `ambiguous` was not chosen. A name at joints counts once per joint, so one
entry with a list in `where` equals two entries. At any other place (x, y, tip, load, sensor) the name alone
counts; where both the truth and the report say x or y, the report's axes must hold the truth's. Parameters and
`when` are not judged here. An effect that acts on both joints by one equation (a rotor that couples them) may
be reported at either or both.

Companions. A name that the hidden effect's own equation contains (`with`: Coulomb's friction in Stribeck's)
may stand beside it. An identical equation written with other names (`instead`: unequal friction is dry friction
and a constant torque) is as right as the name itself.

Verdicts on studies whose hidden effects all have names:
    right      the named set equals the hidden set (companions aside)
    tie        what is named is hidden, each hidden effect that is not named is a candidate in a tie, and no tie
               is without a hidden effect
    too_much   all hidden effects are named or in ties, and something else is named, or a tie holds nothing hidden
    partial    nothing wrong is named, some hidden effect is, another is not
    wrong      a name is given that is not hidden, and a hidden effect is neither named nor in a tie
    wrong_tie  nothing is chosen, ties are listed, none holds a hidden effect
    silent     nothing named, no tie
On studies with a hidden effect that has no name:
    honest     nothing is named beyond the hidden effects that have names, no tie
    near       the names beyond those are all among the effect's `near`: its equation in part
    tied       no name beyond those is chosen; a tie of names is listed
    pinned     another name is given
On clean studies: quiet, or false_alarm for any name or tie.
Any study: failed where the tool wrote no report, unreadable where the report breaks its own format.

Intervals. Each entry of each load's K in the last stage counts once: its `ci95` (a pair per entry, or a matrix of
lower ends and one of upper ends) holds the truth or not; a load without finite intervals is not counted. Loads
whose K is not one number for all times or amplitudes (truth: K_defined false) are left out.

Confidence. Each named effect counts once, right where (name, place) is hidden or a companion; `near` names are
left out of the count, names on studies without names are wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

JOINTS = ("joint1", "joint2")
Pair = tuple[str, str]
Json = dict[str, Any]


@dataclass(frozen=True)
class Claim:
    """One name with its places, as a report or the truth has it."""

    name: str
    places: frozenset[str]
    any_joint: bool = False
    confidence: float | None = None
    companions: frozenset[str] = frozenset()
    instead: tuple[frozenset[str], ...] = ()

    def pairs(self) -> set[Pair]:
        joints = self.places & set(JOINTS)
        return {(self.name, j) for j in joints} if joints else {(self.name, "*")}


def claim_of(name: str, where: str | list[str] | None, **more: Any) -> Claim:
    places = [where] if isinstance(where, str) else list(where or [])
    split = [part.strip() for place in places for part in place.replace("+", ",").split(",")]
    return Claim(name, frozenset(split), **more)


@dataclass(frozen=True)
class Report:
    """What a diagnosis says, in the terms of the rules."""

    named: tuple[Claim, ...]
    ties: tuple[tuple[Claim, ...], ...]


@dataclass(frozen=True)
class Truth:
    effects: tuple[Claim, ...]  # those with names
    nameless: bool
    near: frozenset[str] = field(default_factory=frozenset)


def read_truth(truth: Json) -> Truth:
    named = tuple(
        claim_of(
            e["name"],
            e["where"],
            any_joint=bool(e.get("any_joint")),
            companions=frozenset(e["with"]),
            instead=tuple(frozenset(i) for i in e.get("instead", [])),
        )
        for e in truth["effects"]
        if e["name"]
    )
    odd = [e for e in truth["effects"] if not e["name"]]
    return Truth(named, bool(odd), frozenset(n for e in odd for n in e["near"]))


def read_report(report: Json) -> Report:
    ties = tuple(tuple(_candidate(c) for c in entry["candidates"]) for entry in report["ambiguous"])
    listed = {(c.name, p) for tie in ties for c in tie for p in _places(c)}
    named = []
    for stage in report["stages"][1:]:
        added = stage["added"]
        claim = claim_of(added["effect"], added.get("where"), confidence=_confidence(added))
        tied = any((claim.name, p) in listed for p in _places(claim))
        if claim.name != "unattributed" and not tied:
            named.append(claim)
    return Report(tuple(named), ties)


def _candidate(words: str) -> Claim:
    """A tie's candidate, written name@place or name@place+place."""
    name, _, place = words.partition("@")
    return claim_of(name, place)


def _places(claim: Claim) -> set[str]:
    return {place for _, place in claim.pairs()}


def _confidence(added: Json) -> float | None:
    value = (added.get("evidence") or {}).get("confidence")
    return float(value) if value is not None else None


def matches(hidden: Claim, given: Claim) -> bool:
    """Whether a report's claim names the hidden effect or a part of its places."""
    if hidden.name != given.name:
        return False
    axes = {"x", "y"}
    if hidden.places <= axes and given.places and given.places <= axes:
        return hidden.places <= given.places
    if "*" in _places(hidden) or "*" in _places(given):
        return True
    return given.places <= hidden.places or hidden.any_joint


def _covered(hidden: Claim, given: list[Claim]) -> bool:
    """Whether claims together name the hidden effect at all its places, by its name or by its other names."""
    for names in (frozenset({hidden.name}), *hidden.instead):
        if all(_everywhere(hidden, name, given) for name in names):
            return True
    return False


def _everywhere(hidden: Claim, name: str, given: list[Claim]) -> bool:
    own = [g for g in given if g.name == name]
    if not own:
        return False
    if name == hidden.name and "*" not in _places(hidden) and hidden.any_joint:
        return True
    places = set().union(*(_places(g) for g in own))
    if hidden.places <= {"x", "y"} and all(g.places and g.places <= {"x", "y"} for g in own):
        return hidden.places <= set().union(*(g.places for g in own))
    return "*" in places or "*" in _places(hidden) or _places(hidden) <= places


def _belongs(given: Claim, truth: Truth) -> bool:
    """Whether a claim is a hidden effect, its companion or its other name, at hidden places only."""
    for hidden in truth.effects:
        allowed = {hidden.name, *hidden.companions, *(n for names in hidden.instead for n in names)}
        if given.name not in allowed:
            continue
        if given.name == hidden.name:
            if matches(hidden, given):
                return True
        elif "*" in _places(given) or "*" in _places(hidden) or _places(given) <= _places(hidden):
            return True
    return False


def verdict(truth: Truth, report: Report) -> str:
    """One word for a report, see above."""
    foreign = [c for c in report.named if not _belongs(c, truth)]
    idle_ties = [t for t in report.ties if not any(_belongs(c, truth) for c in t)]
    if truth.nameless:
        return _verdict_nameless(truth, foreign, idle_ties)
    if not truth.effects:
        return "false_alarm" if report.named or report.ties else "quiet"
    chosen = list(report.named)
    offered = chosen + [c for tie in report.ties for c in tie]
    if all(_covered(h, offered) for h in truth.effects):
        if foreign or idle_ties:
            return "too_much"
        return "right" if all(_covered(h, chosen) for h in truth.effects) and not report.ties else "tie"
    if foreign:
        return "wrong"
    something = bool(report.named) or len(idle_ties) < len(report.ties)
    return "partial" if something else "wrong_tie" if report.ties else "silent"


def _verdict_nameless(truth: Truth, foreign: list[Claim], idle_ties: list[tuple[Claim, ...]]) -> str:
    if not foreign:
        return "tied" if idle_ties else "honest"
    return "near" if all(c.name in truth.near for c in foreign) else "pinned"


def confidences(truth: Truth, report: Report) -> list[tuple[float, bool]]:
    out = []
    for claim in report.named:
        if claim.confidence is None or (claim.name in truth.near and not _belongs(claim, truth)):
            continue
        out.append((claim.confidence, _belongs(claim, truth)))
    return out


def coverage(truth: Json, report: Json) -> list[tuple[str, int, int, bool, float]]:
    """Each K entry of the last stage: (load, row, column, holds the truth, half width over the truth's size)."""
    if not truth["K_defined"]:
        return []
    loads = report["stages"][-1]["parameters"].get("loads", {})
    out = []
    for name, said in truth["loads"].items():
        K = (loads.get(name) or {}).get("K")
        if not K or K.get("ci95") is None:
            continue
        true, ends = np.array(said["K"]), np.array(K["ci95"], dtype=float)
        if ends.shape != (2, 2, 2) or not np.isfinite(ends).all():
            continue
        low, high = (ends[..., 0], ends[..., 1]) if _ordered(ends) else ends
        size = float(np.linalg.norm(true, 2))
        out += [
            (
                name,
                i,
                j,
                bool(low[i, j] <= true[i, j] <= high[i, j]),
                float((high[i, j] - low[i, j]) / 2 / size),
            )
            for i in range(2)
            for j in range(2)
        ]
    return out


def _ordered(ends: np.ndarray) -> bool:
    return bool((ends[..., 0] <= ends[..., 1]).all())


def floor_ratios(truth: Json, report: Json) -> dict[str, float]:
    """The report's noise floors over the true ones, where both are there."""
    said = report.get("noise_floor") or {}
    true = truth["noise_rms_4.5Hz"]
    return {c: float(said[c] / true[c]) for c in true if said.get(c) is not None and true[c]}


def last_over_floor(truth: Json, report: Json) -> dict[str, float]:
    """Validation error of the last stage over the true noise floor."""
    said = report["stages"][-1].get("validation_rms") or {}
    true = truth["noise_rms_4.5Hz"]
    return {c: float(said[c] / true[c]) for c in true if said.get(c) is not None and true[c]}
