"""The table of a campaign as Markdown."""

from collections.abc import Sequence
from typing import Any

Json = dict[str, Any]


def page(summary: Json, command: str) -> str:
    """Tables of goals, strengths, effects, errors and failures."""
    s = summary
    parts = [
        f"{s['studies']} studies by version {', '.join(s['versions'])}, {_number(s['seconds_per_study'])} s of one core each"
        f" (median):\n\n    {command}",
        "## Goals",
        _table(
            ("what", "goal", "studies", "measured", "95 % interval"),
            [
                (what, row["goal"], row["of"], f"{row['count']} ({_percent(row['share'])})", _interval(row))
                for what, row in s["goals"].items()
            ],
        ),
        "## One effect, by strength",
        _groups(s["strengths"], "strength"),
        "## Two and three effects together",
        _groups(s["together"], "effects"),
        "## In free trials or under load only",
        _table(
            (
                "effect in",
                "right or a correct tie at 2 floors and above",
                "95 % interval",
                "named with the right trials",
                "verdicts",
            ),
            [
                (
                    f"{name} trials",
                    f"{row['right_or_tie']['count']} of {row['right_or_tie']['of']}",
                    _interval(row["right_or_tie"]),
                    f"{row['when_right']['count']} of {row['when_right']['of']}",
                    _words(row["verdicts"]),
                )
                for name, row in s["when"].items()
            ],
        ),
        "## Cases made by hand",
        _table(
            ("case", "verdicts", "intervals of K that hold the truth", "found"),
            [
                (
                    name,
                    _words(row["verdicts"]),
                    f"{row['K']['count']} of {row['K']['of']}",
                    "; ".join(row["found"]),
                )
                for name, row in s["situations"].items()
            ],
        ),
        "## Names by the confidence given with them",
        _table(
            ("confidence", "mean", "right", "share", "95 % interval"),
            [
                (
                    name,
                    _number(row["mean"]),
                    f"{row['count']} of {row['of']}",
                    _percent(row["share"]),
                    _interval(row),
                )
                for name, row in s["reliability"].items()
            ],
        ),
        "## By kind of noise, force sensor and encoder",
        _table(
            ("torque noise", "right or a correct tie at 2 floors and above", "95 % interval"),
            [(name, f"{row['count']} of {row['of']}", _interval(row)) for name, row in s["noises"].items()]
            + [
                (
                    f"any, {'with' if name == 'true' else 'without'} a force sensor",
                    f"{row['count']} of {row['of']}",
                    _interval(row),
                )
                for name, row in s["force_sensor"].items()
            ]
            + [
                (
                    f"any, payloads {'weighed' if name == 'true' else 'not weighed'}",
                    f"{row['count']} of {row['of']}",
                    _interval(row),
                )
                for name, row in s["weighed"].items()
            ]
            + [
                (
                    f"any, {counts} counts per turn",
                    f"{row['right_or_tie']['count']} of {row['right_or_tie']['of']}",
                    _interval(row["right_or_tie"]),
                )
                for counts, row in s["counts_per_rev"].items()
            ],
        ),
        "## Nothing hidden",
        _table(("torque noise", "verdicts"), [(name, _words(row)) for name, row in s["clean"].items()]),
        "## Effects outside the catalogue",
        _table(("hidden", "verdicts"), [(name, _words(row)) for name, row in s["outside"].items()]),
        "## One effect, by name",
        _effects(s["effects"]),
        "## What would have been reported, and what is",
        _bias(s["all_hidden"]["bias"]),
        "## The effects' own parameters, where the name is right",
        _table(
            ("parameter", "studies", "median error", "intervals that hold the truth"),
            [
                (name, row["studies"], _percent(row["relative"]), f"{row['covered']} of {row['of']}")
                for name, row in s["parameters"].items()
            ],
        ),
        "## Right names, but an error above 1.1 floors",
        _table(
            ("seed", "strength", "hidden", "rms over floor", "structure"),
            [
                (
                    row["seed"],
                    f"{row['strength']:g}",
                    " + ".join(row["hidden"]),
                    ", ".join(f"{name} {value}" for name, value in row["over_floor"].items()),
                    "; ".join(row["structure"])[:90],
                )
                for row in s["right_but_above"]
            ],
        ),
        "## Every study that was not right",
        _table(
            (
                "seed",
                "strength",
                "noise",
                "force sensor",
                "counts per turn",
                "hidden",
                "verdict",
                "found",
                "structure",
            ),
            [
                (
                    row["seed"],
                    f"{row['strength']:g}",
                    row["noise"],
                    "yes" if row["force_sensor"] else "no",
                    row["counts_per_rev"],
                    " + ".join(row["hidden"]) or "nothing",
                    row["verdict"],
                    row["found"] if isinstance(row["found"], str) else " + ".join(row["found"]) or "nothing",
                    "; ".join(row["structure"])[:90],
                )
                for row in s["not_right"]
            ],
        ),
    ]
    return "\n\n".join(parts) + "\n"


def _groups(groups: Json, first: str) -> str:
    return _table(
        (
            first,
            "studies",
            "verdicts",
            "right or tie",
            "95 % interval",
            "right first",
            "right place",
            "rms over floor, before",
            "after",
        ),
        [
            (
                name,
                row["studies"],
                _words(row["verdicts"]),
                _percent(row["right_or_tie"]["share"]),
                _interval(row["right_or_tie"]),
                _percent(row["first_right"]["share"]),
                _percent(row["place_right"]["share"]),
                _number(row["over_floor"]["before"]["largest"]),
                _number(row["over_floor"]["after"]["largest"]),
            )
            for name, row in groups.items()
        ],
    )


def _effects(effects: Json) -> str:
    rows = []
    for name, both in effects.items():
        row, faint = both["clear"], both["faint"]
        bias = row["bias"]["K"]
        rows.append(
            (
                name,
                f"{row['right_or_tie']['count']} of {row['studies']}",
                f"{faint['right_or_tie']['count']} of {faint['studies']}",
                _words({word: n for word, n in row["verdicts"].items() if word != "right"}),
                f"{row['place_right']['count']} of {row['place_right']['of']}",
                f"{_number(row['over_floor']['before']['largest'])} → {_number(row['over_floor']['after']['largest'])}",
                f"{_number(bias['before']['percent'])} → {_number(bias['after']['percent'])}",
            )
        )
    return _table(
        (
            "hidden",
            "right or tie, 2 floors and above",
            "below",
            "verdicts but right",
            "place right",
            "rms over floor",
            "error of K, %",
        ),
        rows,
    )


def _bias(bias: Json) -> str:
    rows = []
    for quantity, both in bias.items():
        for when, row in both.items():
            covered = f"{row['covered']} of {row['of']} ({_percent(row['covered'] / max(row['of'], 1))})"
            rows.append((quantity, when, _number(row["percent"]), _number(row["half_widths"]), covered))
    return _table(
        (
            "",
            "",
            "median error, %",
            "median error, half-widths of the interval",
            "95 % intervals that hold the truth",
        ),
        rows,
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    if not rows:
        return "None."
    lines = [list(head), ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "/") for cell in line) + " |" for line in lines)


def _words(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} {word}" for word, count in counts.items()) or "–"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.1f} %"


def _interval(row: Json) -> str:
    low, high = row["ci95"]
    return f"{100 * low:.1f} to {100 * high:.1f} %"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
