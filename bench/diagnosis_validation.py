"""Validation of `diagnose` on random laboratories: every effect, effects in company, none, and unknown ones.

    python bench/diagnosis_validation.py --out validation.jsonl --first-seed 10000 --strengths 1.3 3 10

One line of JSON per study; studies that are in the file already are not run again, so that a campaign may be
interrupted. `--table` prints the summary of a file.
"""

import argparse
import json
import shutil
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.result import Diagnosis
from impid_host.errors import ImpidError
from impid_host.study.folder import read_study

from hil_sim.effects.catalogue import ROWS
from hil_sim.errors import SimError
from hil_sim.scenarios.random import SMALL, random_scenario
from hil_sim.study.write import write_study

KNOWN = tuple(name for name in ROWS if not name.startswith("outside."))
OUTSIDE = tuple(name for name in ROWS if name.startswith("outside."))


def cases(first: int, studies: int, strengths: list[float]) -> list[tuple[int, float, tuple[str, ...]]]:
    """(seed, strength, effects) of every study, each with a seed of its own."""
    wanted: list[tuple[float, tuple[str, ...]]] = []
    rng = np.random.default_rng(first)
    for _ in range(studies):
        wanted += [(strength, (name,)) for strength in strengths for name in KNOWN]
        wanted += [(strengths[-1], (name,)) for name in OUTSIDE]
        wanted += [(1.0, ())] * 10
        for _ in range(5):
            wanted.append((strengths[len(strengths) // 2], tuple(rng.choice(KNOWN, 2, replace=False))))
    return [(first + k, strength, effects) for k, (strength, effects) in enumerate(wanted)]


def verdict(truth: list[str], answer: Diagnosis) -> str:
    """right, tie, family, missed, wrong, false alarm, or (for unknown effects) unpinned and pinned."""
    found = [stage.added.effect for stage in answer.stages if stage.added is not None]
    if not truth:
        return "false alarm" if found or answer.structure else "right"
    if truth[0].startswith("outside."):
        return "pinned" if found else "unpinned"
    if sorted(found) == sorted(truth):
        return "right"
    tied = {label.split("@")[0] for tie in answer.ambiguous for label in tie.candidates}
    if set(truth) <= tied | set(found) and len(found) <= len(truth):
        return "tie"
    if not found:
        return "missed"
    families = [name.split(".")[0] for name in truth]
    return "family" if sorted(name.split(".")[0] for name in found) == sorted(families) else "wrong"


def run(seed: int, strength: float, effects: tuple[str, ...]) -> dict[str, Any]:
    """One study from simulation to verdict."""
    line: dict[str, Any] = {"seed": seed, "strength": strength, "effects": list(effects)}
    folder = Path(tempfile.mkdtemp(prefix="impid-diagnosis-"))
    try:
        scenario, reached = random_scenario(seed, SMALL, effects, strength)
        write_study(scenario, folder / "study", seed)
        begin = time.perf_counter()
        answer = diagnose(read_study(folder / "study"))
    except (SimError, ImpidError) as error:
        return line | {"verdict": "error", "error": str(error)}
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    first, last = answer.stages[0].rms, answer.stages[-1].rms
    return line | {
        "reached": reached,
        "verdict": verdict(list(effects), answer),
        "found": [f"{s.added.effect}@{'+'.join(s.added.where)}" for s in answer.stages if s.added],
        "structure": [row.words for row in answer.structure],
        "before_over_floor": max(first[key] / answer.floor[key] for key in first),
        "after_over_floor": max(last[key] / answer.floor[key] for key in first),
        "seconds": time.perf_counter() - begin,
    }


def table(path: Path) -> str:
    """Verdicts by strength and effect, as Markdown."""
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    groups: dict[tuple[str, float], Counter[str]] = {}
    for line in lines:
        name = " + ".join(line["effects"]) or "nothing"
        groups.setdefault((name, line["strength"]), Counter())[line["verdict"]] += 1
    rows = ["| hidden | strength | verdicts |", "| --- | --- | --- |"]
    for (name, strength), counts in sorted(groups.items()):
        words = ", ".join(f"{count} {what}" for what, count in counts.most_common())
        rows.append(f"| {name} | {strength:g} | {words} |")
    total = Counter(line["verdict"] for line in lines)
    return "\n".join([*rows, "", ", ".join(f"{count} {what}" for what, count in total.most_common())])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--first-seed", type=int, default=10000)
    parser.add_argument("--studies", type=int, default=1)
    parser.add_argument("--strengths", type=float, nargs="+", default=[1.3, 3.0, 10.0])
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    if options.table:
        print(table(options.out))
        return
    done = set()
    if options.out.exists():
        done = {json.loads(line)["seed"] for line in options.out.read_text().splitlines()}
    with options.out.open("a", encoding="utf-8") as out:
        for seed, strength, effects in cases(options.first_seed, options.studies, options.strengths):
            if seed not in done:
                line = run(seed, strength, effects)
                out.write(json.dumps(line) + "\n")
                out.flush()
                print(line["seed"], line["strength"], line["effects"], line["verdict"], line.get("found"))


if __name__ == "__main__":
    main()
