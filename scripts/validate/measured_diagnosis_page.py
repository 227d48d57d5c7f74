"""The page that measured_diagnosis.py writes: tables of what was named, and of what carries over."""

from itertools import pairwise
from typing import Any

import numpy as np
from impid_host.diagnosis.result import UNATTRIBUTED
from markdown import table


def page(result: dict[str, Any]) -> str:
    """The page in Markdown."""
    lines = [
        "# Diagnoses of measured data",
        "",
        "`python scripts/validate/measured_diagnosis.py`; sources and licences of the data in `docs/data.md`. None of "
        "them is ours. Errors are of data that took no part in choosing or fitting: the last third of a record, or the "
        "last of five. Relative error is 100 |y - y^| / |y| of the logged torque in the band that is reported.",
        "",
        "What had been seen before: unequal viscous slopes became a variant of `friction.asymmetric`, and the rule that a "
        "curve stands beside names that explain 95 %, after looks at EMPS; the band of a single joint and the reflex as a "
        "variant of `load.delay` after looks at the ankles' records (the reflex's form and bounds are the literature's). "
        "Other rules (a pull back of a late load, names that must lower the reported error) were written after looks at an "
        "earlier run of this page. No threshold was set on any of these records' held-out parts. Where a name's interval "
        "includes zero, or its tie is listed, take it for a description of the residual, not for a cause.",
        "",
    ]
    lines += _summary(result["records"])
    for entry in result["records"].values():
        lines += _record_part(entry)
    lines += _published_part(result["emps_as_published"])
    lines += _carried_part(result["carried_over"])
    return "\n".join(lines)


def _summary(entries: dict[str, dict[str, Any]]) -> list[str]:
    rows = []
    for entry in entries.values():
        named = [stage for stage in entry["stages"] if not stage["model"].startswith(UNATTRIBUTED)]
        shares = [
            ", ".join(f"{v:.2f}" for v in s["relative_percent"].values()) for s in (named[0], named[-1])
        ]
        names = ", ".join(stage["model"] for stage in named[1:]) or "none"
        rows.append([entry["title"], *shares, names, "; ".join(entry["structure"])])
    head = ["record", "papers' model (%)", "with names (%)", "names", "left without a name"]
    return [*table(head, rows), ""]


def _record_part(entry: dict[str, Any]) -> list[str]:
    keys = list(entry["stages"][0]["rms"])
    rows = []
    for stage in entry["stages"]:
        values = "; ".join(f"{name} {_number(number)}" for name, number in stage["parameters"].items())
        shares = (f"{stage['relative_percent'][key]:.2f}" for key in keys if key in stage["relative_percent"])
        rows.append(
            [
                stage["model"],
                ", ".join(f"{stage['rms'][key]:.3g}" for key in keys),
                ", ".join(shares),
                values,
                stage["runner_up"] or "",
            ]
        )
    lines = [f"## {entry['title']}", "", entry["words"], ""]
    head = ["model", f"rms {', '.join(keys)}", "relative error (%)", "parameters (95 %)", "runner-up"]
    lines += [*table(head, rows), ""]
    for name, load in entry["loads"].items():
        told = ", ".join(f"{key} {' '.join(f'{v:.4g}' for v in values)}" for key, values in load.items())
        lines += [f"Load {name} at the end: {told}.", ""]
    if entry["structure"]:
        lines += ["Without a name: " + "; ".join(entry["structure"]) + ".", ""]
    if entry["ambiguous"]:
        lines += ["Not told apart: " + "; ".join(" / ".join(tie) for tie in entry["ambiguous"]) + ".", ""]
    return lines


def _number(number: dict[str, Any]) -> str:
    value, ci = np.atleast_1d(number["value"]).ravel(), np.atleast_2d(number["ci95"]).reshape(-1, 2)
    told = ", ".join(f"{v:.4g} ± {0.5 * (c[1] - c[0]):.2g}" for v, c in zip(value, ci, strict=True))
    return (
        f"{told} {number['unit']}".replace(" 1", "") if number["unit"] == "1" else f"{told} {number['unit']}"
    )


def _published_part(rows: list[dict[str, Any]]) -> list[str]:
    return [
        "## EMPS in its authors' processing",
        "",
        "100 Hz, central differences, rows at 100 Hz, as in their description; published errors there (fitted and judged "
        "on the whole record): 4.08 % with symmetric friction and offset, 3.11 % with unequal friction. Ours: fitted on "
        "the first two thirds, judged on the last.",
        "",
        *table(
            ["model", "relative error (%)", "rms (N)"],
            [[row["model"], f"{row['relative_percent']:.2f}", f"{row['rms_N']:.3f}"] for row in rows],
        ),
        "",
    ]


def _carried_part(parts: dict[str, list[dict[str, Any]]]) -> list[str]:
    lines = [
        "## What carries over to another record",
        "",
        "Robot and effects from one record alone, saved and read back; nothing is fitted on the other, which is judged "
        "whole. An effect that raises the error there did not carry over. EMPS and UR10e have one record each of a kind: "
        "its halves stand for two.",
        "",
    ]
    machines = dict.fromkeys(title.split(",")[0] for title in parts)
    both = [[machine, *_both_ways(machine, parts)] for machine in machines]
    lines += [
        *table(["machine", "found and carried over both ways", "found one way, or not carried over"], both),
        "",
    ]
    for title, rows in parts.items():
        body = []
        for k, row in enumerate(rows):
            lower = k > 0 and _lower(row, rows[k - 1])
            body.append(
                [
                    row["model"],
                    ", ".join(f"{v:.3g}" for v in row["rms"]),
                    ", ".join(f"{v:.2f}" for v in row["relative_percent"]),
                    "" if k == 0 else ("yes" if lower else "no"),
                ]
            )
        lines += [
            f"### {title}",
            "",
            *table(["model", "rms", "relative error (%)", "carries over"], body),
            "",
        ]
    return lines


def _lower(row: dict[str, Any], before: dict[str, Any]) -> bool:
    return bool(sum(row["rms"]) < sum(before["rms"]))


def _both_ways(machine: str, parts: dict[str, list[dict[str, Any]]]) -> tuple[str, str]:
    """Names that either record gives and that lower the error on the other; and the rest."""
    own = [rows for title, rows in parts.items() if title.split(",")[0] == machine]
    good = [{row["model"] for before, row in pairwise(rows) if _lower(row, before)} for rows in own]
    every = {row["model"] for rows in own for row in rows[1:]}
    carried_both = set.intersection(*good)
    return ", ".join(sorted(carried_both)) or "none", ", ".join(sorted(every - carried_both)) or "none"
