"""The page that planted.py writes: the plan's verdicts, counted and one by one."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

Runs = Sequence[dict[str, Any]]
GOOD = ("right", "tie", "there before", "silent")
LOOKED_AT = ("ur10e_joint1", "ur10e_joint3", "ur10e_joint4", "ur10e_joint6")
"""Records whose plants were looked at while the choice was changed: they judge nothing any more."""


def page(runs: Runs, planned: Sequence[tuple[str, str]], strengths: Sequence[float]) -> str:
    """The whole page."""
    lines = [
        "# Planted truth on measured records: what came of it",
        "",
        "Written by `python scripts/validate/planted.py`; the plan, with what the words mean, was fixed before the first run:",
        "`planted_plan.md`. Everything that was run is here.",
        "",
        f"Run: {len(runs)} plants in {len({run['record'] for run in runs})} records.",
        "",
        "The search that the plan was written for gave a wrong name in 5 of 7 plants of twice the residual (on ur10e_joint4). The",
        f"choice was then changed with the plants of {', '.join(LOOKED_AT)} in view, and its numbers frozen before the other records",
        "were run. So there are two tables: only the first judges.",
        "",
        "## Records that nobody had looked at",
        "",
        *_counts([run for run in runs if run["record"] not in LOOKED_AT], strengths),
        "",
        "## Records that were looked at before",
        "",
        *_counts([run for run in runs if run["record"] in LOOKED_AT], strengths),
        "",
        "## Each run",
        "",
        *_table(runs),
        "",
    ]
    missing = [
        key for key in dict.fromkeys(key for key, _ in planned) if key not in {run["record"] for run in runs}
    ]
    if missing:
        lines += [f"Not run for want of time: {', '.join(missing)}.", ""]
    return "\n".join(lines)


def _counts(runs: Runs, strengths: Sequence[float]) -> list[str]:
    """Shares of the verdicts, by strength."""
    free = [run for run in runs if not run["capped"]]
    return [
        "| strength, in units of the residual | runs | right or tie (%) | missed (%) | wrong (%) | refused | undone (%) | "
        "without the diagnosis (%) |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
        *(_summary(f"{k:g}", [run for run in free if run["strength"] == k]) for k in strengths),
        _summary("capped, so weaker", [run for run in runs if run["capped"]]),
    ]


def _summary(name: str, own: Runs) -> str:
    if not own:
        return f"| {name} | 0 | | | | | | |"
    words = Counter(run["verdict"] for run in own)
    judged = len(own) - words["refused"]
    told = [run for run in own if "undone" in run]
    entries = max(sum(run["undone"][1] for run in told), 1)
    parts = (
        sum(words[word] for word in GOOD),
        words["missed"],
        words["wrong"],
    )
    after = 100 * sum(run["undone"][0] for run in told) / entries
    without = 100 * sum(run["without_diagnosis"][0] for run in told) / entries
    cells = [
        *(f"{100 * count / max(judged, 1):.0f}" for count in parts),
        str(words["refused"]),
        f"{after:.0f}",
        f"{without:.0f}",
    ]
    return f"| {name} | {len(own)} | " + " | ".join(cells) + " |"


def _table(runs: Runs) -> list[str]:
    lines = [
        "| record | plant | strength | s (SI) | expected | verdict | new names | new ties |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for run in sorted(runs, key=lambda run: (run["record"], run["plant"], -run["strength"])):
        cells = [
            run["record"],
            run["plant"],
            f"{run['strength']:g}",
            f"{run['s']:.3g}",
            run["expected"] or "no name",
            run["verdict"],
            ", ".join(run.get("new", [])),
            "; ".join(" or ".join(tie) for tie in run.get("ties", [])),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines
