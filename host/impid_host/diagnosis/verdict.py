"""The opening sentence of a diagnosis: how much was unexplained and is now, the cause, what it does to K."""

from collections.abc import Mapping, Sequence

import numpy as np

from impid_host.checks.check import Checks
from impid_host.diagnosis.result import UNATTRIBUTED, Finding, Number, Stage, Structure, Tie
from impid_host.diagnosis.search import RULES

_SURE = 0.9


def sentence(
    stages: Sequence[Stage],
    floor: Mapping[str, float | None],
    ties: Sequence[Tie],
    structure: Sequence[Structure],
    above: bool | None,
    *,
    units: Mapping[str, str],
    widened: bool,
) -> str:
    """One sentence, in plain words."""
    first, last = stages[0], stages[-1]
    key = _most_changed(stages)
    level = floor.get(key)
    by = "" if level is None else f", the noise floor being {level:.2g}"
    unit = units.get(key, "N" if key.startswith("f") else "N*m")
    before = f"of {first.rms[key]:.2g} {unit} unexplained in {key} on data not used"
    named = [
        stage.added for stage in stages if stage.added is not None and stage.added.effect != UNATTRIBUTED
    ]
    open_ties = [tie for tie in ties if tie.under]
    if not named and not open_ties and not structure:
        left = f"{first.rms[key]:.2g} {unit}"
        if above is False:
            return f"nothing is missing: {left} are left in {key} on data not used{by}"
        if above is None:
            return f"no effect was found: {left} are left in {key}, and nothing tells the noise floor"
        return f"more than noise is left ({left} in {key}{by}), and nothing tells what it depends on"
    parts = [f"{before}, {last.rms[key]:.2g} is left{by}"]
    if named:
        causes = [_cause(own) for own in named]
        parts.append(("cause: " if len(causes) == 1 else "causes: ") + " and ".join(causes))
    if open_ties:
        parts += [f"these data cannot tell {' from '.join(tie.candidates)}" for tie in open_ties]
    if structure:
        parts.append(f"without a known cause: {structure[0].words}")
    parts += _consequence(stages)
    if widened:
        parts.append("the intervals are widened by what is left unexplained")
    return "; ".join(parts)


def _most_changed(stages: Sequence[Stage]) -> str:
    first, last = stages[0].rms, stages[-1].rms
    return max(first, key=lambda key: (first[key] / max(last.get(key, first[key]), 1e-300), first[key]))


def _cause(own: Finding) -> str:
    sure = own.evidence.confidence
    word = "sure" if sure >= _SURE else "likely" if sure >= RULES.likely else "possible"
    return f"{own.effect} on {' and '.join(own.where)}, {word} ({sure:.2f})"


def _consequence(stages: Sequence[Stage]) -> list[str]:
    """What happens to the stiffness (or mass) that changes most."""
    if len(stages) < 2:
        return []
    best = None
    for name, load in stages[-1].loads.items():
        before = stages[0].loads.get(name, {})
        for letter in ("K", "M"):
            if letter in load and letter in before:
                change = _largest(before[letter], load[letter])
                if change is not None and (best is None or change[0] > best[0]):
                    entry = change[1].format(letter)
                    values = f"{change[2]:.4g} to {change[3]:.4g} {load[letter].unit}"
                    best = (change[0], f"{entry} of {name} goes from {values}")
    return [best[1]] if best is not None and best[0] > 0.002 else []


def _largest(before: Number, after: Number) -> tuple[float, str, float, float] | None:
    if before.value.shape != after.value.shape or before.value.ndim != 2:
        return None
    size = float(np.max(np.abs(before.value))) + 1e-300
    k = np.unravel_index(int(np.argmax(np.abs(after.value - before.value))), before.value.shape)
    axes = "xyz"
    label = "{}" if before.value.size == 1 else "{}_" + axes[int(k[0])] + axes[int(k[1])]
    a, b = float(before.value[k]), float(after.value[k])
    return abs(b - a) / size, label, a, b


def beside_checks(words: str, checks: Checks) -> str:
    """The sentence, headed by what makes the study not to be trusted."""
    worst = next((own for own in checks.entries if own.verdict != "suspect"), None)
    if worst is None:
        return words
    head = f"these numbers are not to be trusted ({worst.what}): {worst.words}"
    return head if words.startswith("nothing is missing") else f"{head}; {words}"
