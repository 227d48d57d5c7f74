"""Effects that these data cannot tell apart, and the trial that could."""

from collections.abc import Sequence

import numpy as np

from impid_host.diagnosis.evidence import solve
from impid_host.diagnosis.result import Tie
from impid_host.diagnosis.support import block_grams
from impid_host.diagnosis.table import Table, admissible, ranking, score_of
from impid_host.effects.effect import Candidate
from impid_host.signals.arrays import Floats

_DECISIVE = 12.0  # twice a log-likelihood difference of six: odds of 400 to 1
_NO_WORSE = 4.0
_STANDARD_ERRORS = 2.5
_RIVALS = 12

# What would tell a pair of families apart; the first match counts.
_TRIALS: tuple[tuple[frozenset[str], str], ...] = (
    (
        frozenset({"actuator.gain"}),
        "a load trial with a force sensor, or a weighed payload",
    ),
    (
        frozenset({"encoder.zero"}),
        "a mechanical stop or a square against which each joint's zero is checked by itself",
    ),
    (
        frozenset({"friction.asymmetric", "actuator.offset"}),
        "a trial with long rests: an offset stays at standstill, dry friction does not",
    ),
    (
        frozenset({"elastic.cartesian", "actuator.offset"}),
        "a trial at rest at several places, with the drives off and on",
    ),
    (
        frozenset({"elastic.joint", "actuator.offset"}),
        "the torque at rest with the spring taken off, or its rest position measured",
    ),
    (frozenset({"load.damping", "load.delay"}), "a load trial with faster motion, up to 5 Hz"),
    (frozenset({"elastic.cartesian", "elastic.joint"}), "a free trial over a larger range of both joints"),
    (frozenset({"gravity.tilt", "accel.bias"}), "a free trial in which link 2 turns by 90 degrees or more"),
    (frozenset({"accel.scale", "inertia.extra"}), "a free trial with a known payload"),
    (
        frozenset({"friction.coulomb", "friction.stribeck"}),
        "a free trial with slow reversals and one with fast steady motion",
    ),
)
_ANY = "a free trial over a larger range and with a wider band of speeds"


def ties(table: Table, active: Sequence[int]) -> list[Tie]:
    """For each effect, the rivals that would do about as well in its place, the other effects given."""
    found = []
    for s in active:
        rest = [other for other in active if other != s]
        labels = [table.slots[s].candidate.label]
        near = [rival for rival in _rivals(table, rest, s) if within_reach(table, rest, s, rival)]
        labels += [table.slots[rival].candidate.label for rival in near]
        labels = list(dict.fromkeys([*labels, *decomposed(table.slots[s].candidate, joints_of(table))]))
        if len(labels) > 1:
            found.append(Tie(tuple(labels), telling_trial(labels)))
    return found


def joints_of(table: Table) -> int:
    """How many channels of torque there are."""
    return len({run.channel for run in table.runs if run.family == "torque"})


def telling_trial(labels: Sequence[str]) -> str:
    """What would tell the labelled effects apart."""
    names = {label.split("@", maxsplit=1)[0] for label in labels}
    return next((words for pair, words in _TRIALS if pair <= names), _ANY)


def within_reach(table: Table, rest: Sequence[int], s: int, rival: int) -> bool:
    """Whether the rival's likelihood is as good, or not worse by a significant amount (Vuong's test)."""
    lead = score_of(table, rest, s) - score_of(table, rest, rival)
    more = table.slots[rival].candidate.size > table.slots[s].candidate.size
    # A rival with more parameters that explains no more is the same effect with idle parts, not a rival.
    if lead < (_NO_WORSE if more else _DECISIVE):
        return True
    if more:
        return False
    ours = _block_squares(table, [*rest, s])
    theirs = _block_squares(table, [*rest, rival])
    difference = theirs - ours
    spread = float(np.std(difference) * np.sqrt(len(difference)))
    return bool(difference.sum() < _STANDARD_ERRORS * spread)


def _rivals(table: Table, rest: Sequence[int], s: int) -> list[int]:
    own = table.slots[s].candidate
    seen = {own.label}
    result: list[int] = []
    top = score_of(table, rest, s)
    for score, other in ranking(table, rest):
        candidate = table.slots[other].candidate
        if score < 0.8 * top - _DECISIVE or len(result) >= _RIVALS:
            break
        if candidate.label in seen or _same_thing(candidate, own) or not admissible(table, [*rest, other]):
            continue
        seen.add(candidate.label)
        result.append(other)
    return result


def _same_thing(one: Candidate, other: Candidate) -> bool:
    """An effect on x and the same effect on x and y are no rivals."""
    return one.effect == other.effect and bool(set(one.where) & set(other.where))


def decomposed(candidate: Candidate, joints: int) -> list[str]:
    """What the effect holds besides itself, so that nobody can say whether that is there too.

    While a joint moves, unequal dry friction is equal dry friction beside a constant torque; a spring's rest
    position is a constant torque, about a joint exactly, at the end-effector nearly.
    """
    place = candidate.where[0]
    if candidate.effect == "friction.asymmetric":
        return [f"friction.coulomb@{place}", f"actuator.offset@{place}"]
    if candidate.effect == "elastic.joint":
        return [f"actuator.offset@{place}"]
    if candidate.effect == "elastic.cartesian":
        return [f"actuator.offset@joint{joint + 1}" for joint in range(joints)]
    return []


def _block_squares(table: Table, active: Sequence[int]) -> Floats:
    blocks = block_grams(table, active)
    beta, _ = solve(blocks.sum(axis=0), range(blocks.shape[1] - 1))
    weights = np.concatenate([[1.0], -beta])
    result: Floats = np.einsum("i,bij,j->b", weights, blocks, weights)
    return result
