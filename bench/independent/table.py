"""Counts from judge's lines: by effect and strength, intervals, floors, reliability."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from .effects import EVERY

Line = dict[str, Any]
NAMED_VERDICTS = (
    "right",
    "tie",
    "too_much",
    "partial",
    "wrong",
    "wrong_tie",
    "silent",
    "failed",
    "unreadable",
)
ODD_VERDICTS = ("honest", "near", "tied", "pinned", "failed", "unreadable")


def wilson(hits: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson's interval for a share (E. B. Wilson 1927)."""
    if n == 0:
        return 0.0, 1.0
    p, d = hits / n, 1 + z * z / n
    middle = (p + z * z / (2 * n)) / d
    half = z / d * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return float(max(0.0, middle - half)), float(min(1.0, middle + half))


def share(hits: int, n: int) -> str:
    if n == 0:
        return "-"
    low, high = wilson(hits, n)
    return f"{hits}/{n} = {100 * hits / n:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def _odd(line: Line) -> bool:
    return any(EVERY[key].name is None for key, _ in line["wanted"])


def _noise(line: Line) -> str:
    return line.get("harmless") or ("unusual" if line["unusual"] else "usual")


def _grid(lines: list[Line], verdicts: tuple[str, ...], good: tuple[str, ...], title: str) -> list[str]:
    cells: dict[tuple[str, float], list[Line]] = defaultdict(list)
    for line in lines:
        key = " + ".join(sorted(k for k, _ in line["wanted"])) if len(line["wanted"]) < 3 else "three effects"
        cells[
            (key if len(line["wanted"]) < 2 else f"{len(line['wanted'])} effects", line["wanted"][0][1])
        ].append(line)
    out = [
        f"## {title}",
        "",
        f"| effect | strength | seen | n | {' | '.join(verdicts)} | {' or '.join(good)} |",
    ]
    out.append("|" + " --- |" * (len(verdicts) + 5))
    for (key, size), group in sorted(cells.items()):
        counts = [sum(g["verdict"] == v for g in group) for v in verdicts]
        hits = sum(g["verdict"] in good for g in group)
        seen = np.median([g["seen_strength"] for g in group])
        cut = " | ".join(str(c) if c else "" for c in counts)
        out.append(f"| {key} | {size:g} | {seen:.1f} | {len(group)} | {cut} | {share(hits, len(group))} |")
    return [*out, ""]


def _totals(lines: list[Line], good: tuple[str, ...], title: str) -> list[str]:
    """Shares by the strength wanted and by what the papers' parameters leave of it."""
    out = [f"## {title}", "", "| | " + " or ".join(good) + " |", "| --- | --- |"]
    sizes: dict[str, Callable[[dict[str, Any]], float]] = {
        "wanted": lambda g: g["wanted"][0][1],
        "seen": lambda g: g["seen_strength"],
    }
    for words, of in sizes.items():
        for low, high in ((0, 1), (1, 2), (2, 4), (4, 8), (8, 1e9)):
            group = [g for g in lines if low <= of(g) < high]
            hits = sum(g["verdict"] in good for g in group)
            upper = f"{high:g}" if high < 1e9 else "more"
            out.append(f"| strength {words} {low} to {upper} | {share(hits, len(group))} |")
    return [*out, ""]


def reliability(pairs: Iterable[tuple[float, bool]]) -> list[str]:
    all_pairs = list(pairs)
    edges = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0001)
    out = ["## Confidence", "", "| confidence | mean | right |", "| --- | --- | --- |"]
    for low, high in pairwise(edges):
        group = [(c, r) for c, r in all_pairs if low <= c < high]
        mean = f"{np.mean([c for c, _ in group]):.3f}" if group else "-"
        out.append(
            f"| {low:g} to {min(high, 1):g} | {mean} | {share(sum(r for _, r in group), len(group))} |"
        )
    return [*out, ""]


def _numbers(lines: list[Line]) -> list[str]:
    held = [k[3] for line in lines for k in line.get("K", [])]
    out = [
        "## Numbers",
        "",
        "| | |",
        "| --- | --- |",
        f"| K's interval holds the truth | {share(sum(held), len(held))} |",
    ]
    for words, test in (
        ("clean", lambda g: not g["wanted"]),
        ("named", lambda g: g["wanted"] and not _odd(g)),
        ("unnamed", _odd),
    ):
        some = [k[3] for line in lines if test(line) for k in line.get("K", [])]
        out.append(f"| the same, {words} studies | {share(sum(some), len(some))} |")
    floors = [v for line in lines for v in line.get("floors", {}).values()]
    fair = sum(0.8 <= v <= 1.25 for v in floors)
    out.append(f"| noise floor within 0.8 to 1.25 of the truth | {share(fair, len(floors))} |")
    if floors:
        out.append(
            f"| noise floor over the truth, 5, 50, 95 % | {', '.join(f'{q:.2f}' for q in np.percentile(floors, [5, 50, 95]))} |"
        )
    runs = [line["tool"] for line in lines]
    for key in ("seconds", "megabytes"):
        sizes = [r[key] for r in runs]
        out.append(f"| {key}, median and largest | {np.median(sizes):.1f}, {max(sizes):.1f} |")
    statuses = sorted({r["status"] for r in runs})
    counts = ", ".join(f"{s}: {sum(r['status'] == s for r in runs)}" for s in statuses)
    out.append(f"| exit statuses | {counts} |")
    untrusted = sum(line.get("trusted") is False for line in lines)
    out.append(f"| not trusted by its own checks | {share(untrusted, len(lines))} |")
    return [*out, ""]


def page(paths: list[Path]) -> str:
    """A markdown page of all lines in the files."""
    lines = [json.loads(text) for path in paths for text in path.read_text().splitlines()]
    if not lines:
        return "No lines.\n"
    odd = [g for g in lines if _odd(g)]
    named = [g for g in lines if g["wanted"] and not _odd(g)]
    clean = [g for g in lines if not g["wanted"]]
    out = ["# Judged by the independent simulator", ""]
    if named:
        out += _totals(named, ("right", "tie"), "Effects with a name, by strength")
        out += _grid(named, NAMED_VERDICTS, ("right", "tie"), "Effects with a name")
    if odd:
        out += _totals(odd, ("pinned",), "Effects without a name, by strength")
        out += _grid(odd, ODD_VERDICTS, ("pinned",), "Effects without a name")
    if clean:
        out += ["## Clean studies", "", "| noise | false alarms |", "| --- | --- |"]
        for words in sorted({_noise(g) for g in clean} | {"usual", "unusual"}):
            group = [g for g in clean if _noise(g) == words]
            alarms = sum(g["verdict"] == "false_alarm" for g in group)
            out.append(f"| {words} | {share(alarms, len(group))} |")
        failed = sum(g["verdict"] in {"failed", "unreadable"} for g in clean)
        out += [f"| failed or unreadable, either | {share(failed, len(clean))} |", ""]
    out += _numbers(lines)
    out += reliability((c, r) for line in lines for c, r in line.get("confidences", []))
    return "\n".join(out)
