"""What an answer is worth, given what was hidden: names, places, ties."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

NO_NAME = "unattributed"
_BOTH_AXES = frozenset(
    f"{sensor}.{error}" for sensor in ("accel", "force") for error in ("scale", "bias", "cross_axis")
)

Places = Mapping[str, frozenset[str]]


@dataclass(frozen=True)
class Verdict:
    """One study judged.

    Attributes:
        word: known effects: right, tie, extra (all of it and more), partial (some of it, nothing else), family,
            wrong, unattributed (structure without a name), missed; clean studies: right, false alarm, false
            structure; effects outside the catalogue: described, unseen, pinned.
        first_right: the name that was added first is one of those hidden.
        place_right: all names are right, and so are their places; None where they are not.
        tied: how many names the ties of the answer list, without repetition.
    """

    word: str
    first_right: bool
    place_right: bool | None
    tied: int


def judged(
    truth: Sequence[str], found: Sequence[str], ties: Sequence[Sequence[str]], *, structure: bool
) -> Verdict:
    """Judges an answer. All labels are name@place+place.

    Args:
        truth: what was hidden.
        found: what the host added, in order.
        ties: what it cannot tell apart.
        structure: whether it says that something without a name is left.
    """
    hidden, named = placed(truth), placed(found)
    # A hidden effect is part of a tie only with all of its places.
    tied = [{name for name, at in placed(tie).items() if hidden.get(name, at) <= at} for tie in ties]
    right = set(named) == set(hidden)
    return Verdict(
        word=_word(set(hidden), set(named), tied, structure=structure),
        first_right=bool(named) and next(iter(named)) in hidden,
        place_right=named == hidden if right and hidden else None,
        tied=len(set().union(*tied)) if tied else 0,
    )


def placed(labels: Sequence[str]) -> Places:
    """Name -> places, however many entries it came in; both axes of a sensor are the sensor."""
    result: dict[str, frozenset[str]] = {}
    for label in labels:
        name = _name(label)
        places = set(label.partition("@")[2].split("+"))
        if name in _BOTH_AXES and "sensor" in places:
            places = {"x", "y"}
        if name != NO_NAME:
            result[name] = result.get(name, frozenset()) | places
    return result


def _word(hidden: set[str], named: set[str], ties: Sequence[set[str]], *, structure: bool) -> str:
    if not hidden:
        return "false alarm" if named else "false structure" if structure else "right"
    if any(name.startswith("outside.") for name in hidden):
        return "pinned" if named else "described" if structure else "unseen"
    if not named and any(hidden <= tie for tie in ties):
        return "tie"
    if not named:
        return "unattributed" if structure else "missed"
    if named == hidden:
        return "right"
    # Where something is left over, what was named is not all but indistinguishable from the truth.
    return "tie" if not structure and _tied(hidden, named, ties) else _not_right(hidden, named)


def _not_right(hidden: set[str], named: set[str]) -> str:
    if hidden < named:
        return "extra"
    if named < hidden:
        return "partial"
    same_family = sorted(map(_family, named)) == sorted(map(_family, hidden))
    return "family" if same_family else "wrong"


def _tied(hidden: set[str], named: set[str], ties: Sequence[set[str]]) -> bool:
    """Whether every hidden effect is named or tied with a name, and every name is hidden or tied with one."""

    def held(one: str, others: set[str]) -> bool:
        return one in others or any(one in tie and tie & others for tie in ties)

    return all(held(one, named) for one in hidden) and all(held(one, hidden) for one in named)


def _name(label: str) -> str:
    return label.partition("@")[0]


def _family(name: str) -> str:
    return name.partition(".")[0]
