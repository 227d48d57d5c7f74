"""From the lines of a campaign to rates with their intervals, and medians."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from math import sqrt
from typing import Any

import numpy as np

from diagnosis_campaign.verdict import judged

Json = dict[str, Any]
_Z = 1.959964  # of 95 %
CLEAR = 1.8  # a strength of 2 that was met within 10 %
CHANNELS = ("largest", "together")


def wilson(count: int, of: int) -> tuple[float, float]:
    """95 % score interval of a rate (Wilson, J. Am. Stat. Assoc. 22 (1927), 209)."""
    if of == 0:
        return 0.0, 1.0
    share, z2 = count / of, _Z**2
    middle = (share + z2 / (2 * of)) / (1 + z2 / of)
    half = _Z / (1 + z2 / of) * sqrt(share * (1 - share) / of + z2 / (4 * of**2))
    return max(0.0, middle - half), min(1.0, middle + half)


def rate(lines: Sequence[Json], holds: Callable[[Json], bool]) -> Json:
    """How many of the lines hold, of how many, the share and its interval."""
    count = sum(holds(line) for line in lines)
    low, high = wilson(count, len(lines))
    share = count / len(lines) if lines else None
    return {"count": count, "of": len(lines), "share": share, "ci95": [low, high]}


def reached(line: Json) -> float:
    """Strength of the faintest effect in the study, as it was met; 0 where nothing is hidden."""
    return float(min(line.get("reached", {}).values(), default=line["strength"]))


def clear(line: Json) -> bool:
    """Every hidden effect is at two floors or more."""
    return reached(line) >= CLEAR


def is_right(line: Json) -> bool:
    """Right or a correct tie."""
    return line["verdict"] in ("right", "tie")


def is_false_alarm(line: Json) -> bool:
    """A clean study in which something was said to be."""
    return line["verdict"] in ("false alarm", "false structure", "error")


def over_floor(line: Json, when: str) -> tuple[float, float] | None:
    """Validation rms over the true floor: in the worst channel, and root mean square of all."""
    ratios = list(line.get("over_floor", {}).get(when, {}).values())
    return (max(ratios), float(np.sqrt(np.mean(np.square(ratios))))) if ratios else None


def median(values: Iterable[float | None]) -> float | None:
    """Of those that there are."""
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def verdicts(lines: Sequence[Json]) -> dict[str, int]:
    """How often each, the most frequent first."""
    return dict(Counter(line["verdict"] for line in lines).most_common())


def accuracy_of(lines: Sequence[Json], quantity: str, when: str) -> Json:
    """Median error of alpha, M or K, in per cent and in half-widths, and how many intervals hold the truth."""
    rows = [line["bias"][when][quantity] for line in lines if quantity in line.get("bias", {}).get(when, {})]
    covered, of = sum(row["covered"] for row in rows), sum(row["of"] for row in rows)
    return {
        "percent": median(row["percent"] for row in rows),
        "half_widths": median(row["half_widths"] for row in rows),
        "covered": covered,
        "of": of,
    }


INSTRUMENTS = frozenset({"accel", "actuator", "clock", "encoder", "force", "geometry"})


def on_a_wrong_instrument(line: Json) -> bool:
    """An instrument or a declared constant was named that is in order, and no tie says that it may be."""
    hidden = {label.partition("@")[0] for label in line["effects"]}
    accused = {label.partition("@")[0] for label in line.get("found", [])} - hidden
    return not is_right(line) and any(name.partition(".")[0] in INSTRUMENTS for name in accused)


def stiffness_covered(lines: Sequence[Json]) -> Json:
    """How many of the last stages' intervals of K hold the truth."""
    rows = [line["bias"]["after"]["K"] for line in lines if "K" in line.get("bias", {}).get("after", {})]
    count, of = sum(row["covered"] for row in rows), sum(row["of"] for row in rows)
    low, high = wilson(count, of)
    return {"count": count, "of": of, "share": count / of if of else None, "ci95": [low, high]}


def reliability(lines: Sequence[Json]) -> Json:
    """Of names given with a confidence, by tenths of it: how many were right."""
    given = [
        (confidence, label.partition("@")[0] in {one.partition("@")[0] for one in line["effects"]})
        for line in lines
        for label, confidence in zip(line.get("found", []), line.get("confidence", []), strict=False)
        if confidence is not None and not label.startswith("unattributed")
    ]
    result: Json = {}
    for tenth in range(10):
        inside = [right for confidence, right in given if min(int(10 * confidence), 9) == tenth]
        if inside:
            low, high = wilson(sum(inside), len(inside))
            mean = np.mean([c for c, _ in given if min(int(10 * c), 9) == tenth])
            result[f"{tenth / 10:g} to {(tenth + 1) / 10:g}"] = {
                "mean": float(mean),
                "count": sum(inside),
                "of": len(inside),
                "share": sum(inside) / len(inside),
                "ci95": [low, high],
            }
    return result


def group(lines: Sequence[Json]) -> Json:
    """All that is said of a set of studies with something hidden."""
    ratios = {when: [over_floor(line, when) for line in lines] for when in ("before", "after")}
    return {
        "studies": len(lines),
        "verdicts": verdicts(lines),
        "right_or_tie": rate(lines, is_right),
        "first_right": rate(lines, lambda line: bool(line.get("first_right"))),
        "place_right": rate(
            [line for line in lines if line["verdict"] == "right"], lambda line: bool(line["place_right"])
        ),
        "over_floor": {
            when: {
                name: median(None if ratio is None else ratio[k] for ratio in ratios[when])
                for k, name in enumerate(CHANNELS)
            }
            for when in ratios
        },
        "within_1.1": rate([line for line in lines if over_floor(line, "after")], _within),
        "bias": {
            quantity: {when: accuracy_of(lines, quantity, when) for when in ("before", "after")}
            for quantity in ("alpha", "M", "K")
        },
    }


def _within(line: Json) -> bool:
    ratio = over_floor(line, "after")
    return ratio is not None and ratio[0] <= 1.1


def own_parameters(lines: Sequence[Json]) -> dict[str, Json]:
    """By effect and parameter: median relative error, median half-width, coverage; right answers alone."""
    rows: dict[str, list[Json]] = {}
    for line in lines:
        if line["verdict"] == "right":
            for effect, values in line.get("parameters", {}).items():
                for name, row in values.items():
                    rows.setdefault(f"{effect} {name}", []).append(row)
    return {
        name: {
            "studies": len(some),
            "relative": median(row["relative"] for row in some),
            "covered": sum(row["covered"] for row in some),
            "of": sum(row["of"] for row in some),
        }
        for name, some in sorted(rows.items())
    }


def judged_again(line: Json) -> Json:
    """The line with the verdict of today's rules."""
    if line["verdict"] == "error":
        return line
    verdict = judged(line["hidden"], line["found"], line["ties"], structure=bool(line["structure"]))
    return {
        **line,
        "verdict": verdict.word,
        "first_right": verdict.first_right,
        "place_right": verdict.place_right,
        "tied": verdict.tied,
    }


def summary(lines: Sequence[Json]) -> Json:
    """Everything that the page shows, as numbers. Verdicts are made again from what the lines say was found."""
    lines = [judged_again(line) for line in lines]
    part = {
        name: [line for line in lines if line["part"] == name]
        for name in ("known", "when", "together", "outside", "clean", "situation")
    }
    hidden = part["known"] + part["when"] + part["together"]
    effects = sorted({label.split("@")[0] for line in part["known"] for label in line["effects"]})
    unknown = sorted({label.split("@")[0] for line in part["outside"] for label in line["effects"]})

    def of(some: Sequence[Json], name: str) -> list[Json]:
        return [line for line in some if any(label.split("@")[0] == name for label in line["effects"])]

    seconds = [sum(line["seconds"].values()) for line in lines if "seconds" in line]
    return {
        "studies": len(lines),
        "versions": sorted({line.get("version", "") for line in lines}),
        "seconds_per_study": median(seconds),
        "goals": {
            "right or a correct tie, one effect at 2 floors and above": rate(
                [line for line in part["known"] if clear(line)], is_right
            )
            | {"goal": ">= 98 %"},
            "right or a correct tie, two or three effects at 2 floors and above": rate(
                [line for line in part["together"] if clear(line)], is_right
            )
            | {"goal": ">= 95 %"},
            "right or a correct tie, one effect in free trials or under load only": rate(
                [line for line in part["when"] if clear(line)], is_right
            )
            | {"goal": ">= 95 %"},
            "an instrument that is in order was named": rate(
                [line for line in hidden + part["outside"] if clear(line)], on_a_wrong_instrument
            )
            | {"goal": "<= 1 %"},
            "intervals of K that hold the truth, last stage": stiffness_covered(
                [line for line in hidden if clear(line)]
            )
            | {"goal": "93 to 97 %"},
            "intervals of K that hold the truth, effects outside the catalogue": stiffness_covered(
                part["outside"]
            )
            | {"goal": ">= 90 %"},
            "false alarms": rate(part["clean"], is_false_alarm) | {"goal": "none"},
            "outside the catalogue, pinned on a name": rate(
                part["outside"], lambda line: line["verdict"] in ("pinned", "error")
            )
            | {"goal": "<= 2 %"},
            "final validation rms within 1.1 of the floor in every channel": rate(
                [line for line in hidden if over_floor(line, "after")], _within
            )
            | {"goal": "all"},
        },
        "strengths": {
            f"{strength:g}": group([line for line in part["known"] if line["strength"] == strength])
            for strength in sorted({line["strength"] for line in part["known"]})
        },
        "effects": {
            name: {
                "clear": group([line for line in of(part["known"], name) if clear(line)]),
                "faint": group([line for line in of(part["known"], name) if not clear(line)]),
            }
            for name in effects
        },
        "together": {
            f"{count}": group([line for line in part["together"] if len(line["effects"]) == count])
            for count in (2, 3)
        },
        "when": {
            kind: {
                "right_or_tie": rate([line for line in some if clear(line)], is_right),
                "when_right": rate(
                    [line for line in some if line.get("when_right") is not None],
                    lambda line: bool(line["when_right"]),
                ),
                "verdicts": verdicts(some),
            }
            for kind in ("free", "load")
            for some in [[line for line in part["when"] if line["effects"][0].endswith(":" + kind)]]
        },
        "situations": {
            name: {
                "verdicts": verdicts(some),
                "K": stiffness_covered(some),
                "found": sorted({" + ".join(line.get("found", [])) or "nothing" for line in some}),
            }
            for name in dict.fromkeys(line["situation"] for line in part["situation"])
            for some in [[line for line in part["situation"] if line["situation"] == name]]
        },
        "reliability": reliability(hidden),
        "outside": {name: verdicts(of(part["outside"], name)) for name in unknown},
        "clean": {
            noise: verdicts([line for line in part["clean"] if line["noise"] == noise])
            for noise in sorted({line["noise"] for line in part["clean"]})
        },
        "all_hidden": group(hidden),
        "noises": {
            noise: rate([line for line in hidden if line["noise"] == noise and clear(line)], is_right)
            for noise in sorted({line["noise"] for line in hidden})
        },
        "counts_per_rev": {
            str(counts): {
                "right_or_tie": rate(
                    [line for line in hidden if line["counts_per_rev"] == counts and clear(line)], is_right
                ),
                "false_alarms": rate(
                    [line for line in part["clean"] if line["counts_per_rev"] == counts], is_false_alarm
                ),
            }
            for counts in sorted({line["counts_per_rev"] for line in lines})
        },
        "force_sensor": {
            str(there).lower(): rate(
                [line for line in hidden if line["force_sensor"] is there and clear(line)], is_right
            )
            for there in (True, False)
        },
        "weighed": {
            str(there).lower(): rate(
                [line for line in hidden if line["weighed"] is there and clear(line)], is_right
            )
            for there in (True, False)
        },
        "parameters": own_parameters(hidden),
        "ties": {
            "answers with a tie": rate(hidden, lambda line: bool(line.get("tied"))),
            "names in a tie": median(line["tied"] for line in hidden if line.get("tied")),
        },
        "right_but_above": [
            {
                "seed": line["seed"],
                "strength": line["strength"],
                "hidden": line["effects"],
                "over_floor": {
                    name: round(v, 2) for name, v in line["over_floor"]["after"].items() if v > 1.1
                },
                "structure": line["structure"],
            }
            for line in hidden
            if is_right(line) and not _within(line)
        ],
        "not_right": [
            {
                "seed": line["seed"],
                "strength": line["strength"],
                "noise": line["noise"],
                "force_sensor": line["force_sensor"],
                "counts_per_rev": line["counts_per_rev"],
                "hidden": line["effects"],
                "verdict": line["verdict"],
                "found": line.get("found", line.get("error")),
                "structure": line.get("structure", []),
            }
            for line in lines
            if line["verdict"] not in ("right", "tie", "described", "unseen")
        ],
    }
