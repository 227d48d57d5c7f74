"""The tables of a campaign."""

from collections.abc import Sequence
from typing import Any

from mistakes_campaign.mistakes import MISTAKES

Line = dict[str, Any]
DISAGREE = ("methods.disagree", "trials.disagree", "accelerations.disagree", "clocks.disagree")
MOST = 3


def named(line: Line, names: Sequence[str]) -> bool:
    """Whether the mistake is among at most three names that were given, in however many trials each."""
    said = {what for what, _, _ in line["said"]}
    return bool(said & set(names)) and len(said) <= MOST


def in_order(line: Line) -> bool:
    """Whether a study without a mistake was given no mistake, and nothing was called impossible."""
    return all(what in DISAGREE and verdict != "impossible" for what, _, verdict in line["said"])


def page(lines: Sequence[Line], command: str) -> str:
    """Everything below the words of docs/validation/mistakes.md."""
    by_mistake: dict[str, list[Line]] = {}
    for line in lines:
        by_mistake.setdefault(line["mistake"], []).append(line)
    clean = by_mistake.pop("", [])
    names = {mistake.name: mistake.names for mistake in MISTAKES}
    wrong = [line for line in lines if line["mistake"]]
    right = [line for line in wrong if named(line, names[line["mistake"]])]
    silent = [line for line in wrong if not line["said"]]
    quiet = [line for line in clean if in_order(line)]
    text = [
        f"Command: `{command}`" if command else "",
        "",
        "| what | of | number | share |",
        "| --- | --- | --- | --- |",
        _row("mistake named, or among at most three named", len(wrong), len(right)),
        _row("nothing said at all", len(wrong), len(silent)),
        _row("no mistake named and nothing impossible, in studies without one", len(clean), len(quiet)),
        "",
        "| mistake | expected name | named | what was said where it was not |",
        "| --- | --- | --- | --- |",
    ]
    for mistake, own in by_mistake.items():
        good = sum(named(line, names[mistake]) for line in own)
        others = sorted({_labels(line) for line in own if not named(line, names[mistake])})
        text.append(
            f"| {mistake} | {' or '.join(names[mistake])} | {good} of {len(own)} | {'; '.join(others)} |"
        )
    text += ["", "Studies without a mistake in which one was named, or something called impossible:", ""]
    text += [
        f"- {line['seed']} ({line['kind']}): {_labels(line)}" for line in clean if not in_order(line)
    ] or ["- none"]
    disagreeing = [line for line in clean if line["said"] and in_order(line)]
    text += ["", f"Disagreements reported in {len(disagreeing)} of the others:", ""]
    text += [f"- {line['seed']} ({line['kind']}): {_labels(line)}" for line in disagreeing] or ["- none"]
    return "\n".join(text) + "\n"


def _row(what: str, of: int, number: int) -> str:
    return f"| {what} | {of} | {number} | {100 * number / max(of, 1):.1f} % |"


def _labels(line: Line) -> str:
    said = [f"{what}@{where}" if where else what for what, where, _ in line["said"]]
    return ", ".join(said) or "nothing"
