"""Write a study, run the tool on it as a process of its own, judge its report by the truth.

The rules are in ``rules``. The tool is met on its command line and in its JSON only. Seeds 1 to 99999 are for
development; those from 700000 on judge, each once, and need ``--judging``, so that nobody looks by accident.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import rules
from .effects import EVERY, NAMED, NAMED2, UNNAMED, UNNAMED2
from .folder import write
from .harmless import HARMLESS
from .study import make

STRENGTHS = (2.0, 4.0, 8.0, 1.0)
JUDGING = 700000
FIRST = {**NAMED, **UNNAMED}
BOOKS = {
    "any": FIRST,
    "named": NAMED,
    "unnamed": UNNAMED,
    "pairs": NAMED,
    "triples": NAMED,
    "named2": NAMED2,
    "unnamed2": UNNAMED2,
}
KINDS = (*BOOKS, "clean", "unusual", "unusual2")


@dataclass(frozen=True)
class Wish:
    """What a seed's study holds."""

    effects: list[tuple[str, float]]
    unusual: bool
    harmless: str | None = None


def describe(parser: argparse.ArgumentParser) -> None:
    """Options that say what is hidden."""
    parser.add_argument("--effect", nargs="+", choices=sorted(EVERY), metavar="NAME", help="see list")
    parser.add_argument("--strength", type=float, help="footprint over noise; by the seed where not given")
    parser.add_argument("--measure", choices=("seen", "raw"), default="seen", help="the strength that is set")
    parser.add_argument("--clean", action="store_true", help="nothing hidden")
    parser.add_argument("--unusual", action="store_true", help="noise of unusual kinds")
    parser.add_argument("--harmless", choices=sorted(HARMLESS), help="nothing hidden, and logged in this way")
    parser.add_argument(
        "--kind", choices=KINDS, default="any", help="what the seed may choose, without --effect"
    )


def describe_runs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--tool", default=str(Path(sys.executable).with_name("impid-host")))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=600.0, help="s for one diagnosis")
    parser.add_argument("--judging", action="store_true", help=f"allow seeds from {JUDGING} on")
    parser.add_argument("--keep", type=Path, help="keep studies, truths and reports there")


def wanted_of(seed: int, args: argparse.Namespace) -> Wish:
    """The effects of a seed with their strengths, and what is unusual in its noise.

    Consecutive seeds run through all effects in turn, then through the strengths.
    """
    kind = "clean" if args.clean else args.kind
    if kind in {"clean", "unusual"}:
        return Wish([], args.unusual or kind == "unusual")
    if args.harmless or kind == "unusual2":
        return Wish([], args.unusual, args.harmless or sorted(HARMLESS)[seed % len(HARMLESS)])
    if args.effect:
        keys = list(args.effect)
        turn = 0
    else:
        book = sorted(BOOKS[kind])
        turn = seed // len(book)
        keys = [book[seed % len(book)]]
        rng = np.random.default_rng([seed, 11])
        while len(keys) < {"pairs": 2, "triples": 3}.get(kind, 1):
            other = str(rng.choice(book))
            if EVERY[other].name not in {EVERY[k].name for k in keys}:
                keys.append(other)
    size = args.strength or STRENGTHS[turn % len(STRENGTHS)]
    return Wish([(k, size) for k in keys], args.unusual)


def _diagnose(tool: str, study: Path, report: Path, timeout: float) -> dict[str, Any]:
    """Run the tool; its status, wall time (s), memory (MB, never below this process's own) and last words."""
    errors = report.with_suffix(".txt")
    begin = time.monotonic()
    with errors.open("w") as sink:
        process = subprocess.Popen(
            ["timeout", "--signal=KILL", str(timeout), tool, "diagnose", str(study), "--json", str(report)],
            stdout=subprocess.DEVNULL,
            stderr=sink,
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    return {
        "status": process.returncode,
        "seconds": round(time.monotonic() - begin, 2),
        "cpu_seconds": round(usage.ru_utime + usage.ru_stime, 2),
        "megabytes": round(usage.ru_maxrss / 1024),
        "last_words": errors.read_text(errors="replace").strip()[-400:],
    }


def assess(truth: dict[str, Any], report: dict[str, Any]) -> dict[str, Any]:
    """One report under the rules."""
    hidden, said = rules.read_truth(truth), rules.read_report(report)
    return {
        "verdict": rules.verdict(hidden, said),
        "named": [f"{c.name}@{'+'.join(sorted(c.places))}" for c in said.named],
        "ties": [entry["candidates"] for entry in report["ambiguous"]],
        "confidences": rules.confidences(hidden, said),
        "K": rules.coverage(truth, report),
        "floors": rules.floor_ratios(truth, report),
        "last_over_floor": rules.last_over_floor(truth, report),
        "checks": [f"{c.get('what')}:{c.get('verdict')}" for c in report.get("checks", [])],
        "trusted": report.get("trusted"),
        "above_floor": (report.get("unexplained") or {}).get("above_noise_floor"),
        "sentence": report.get("verdict"),
    }


def one(seed: int, args: argparse.Namespace) -> dict[str, Any]:
    """Write, run, judge one seed."""
    wish = wanted_of(seed, args)
    line: dict[str, Any] = {
        "seed": seed, "wanted": wish.effects, "unusual": wish.unusual, "harmless": wish.harmless,
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch) if args.keep is None else args.keep / str(seed)
        begin = time.monotonic()
        study = make(seed, wish.effects, wish.unusual, args.measure, wish.harmless)
        folder = write(study, place)
        line["write_seconds"] = round(time.monotonic() - begin, 2)
        truth = json.loads((place / "truth.json").read_text())
        line["effects"] = truth["effects"]
        line["seen_strength"] = truth["seen_strength"]
        line["force_sensor"] = study.laboratory.instruments.force
        line["tool"] = _diagnose(args.tool, folder, place / "report.json", args.timeout)
        try:
            report = json.loads((place / "report.json").read_text())
        except (OSError, ValueError):
            return line | {"verdict": "failed"}
        try:
            return line | assess(truth, report)
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as reason:
            return line | {"verdict": "unreadable", "reason": repr(reason)}


def run(args: argparse.Namespace) -> None:
    first, last = (int(part) for part in args.seeds.split(":"))
    if last >= JUDGING and not args.judging:
        sys.exit(f"seeds from {JUDGING} on judge the tool, each once: --judging says that this is meant")
    done = set()
    if args.out.exists():
        done = {json.loads(text)["seed"] for text in args.out.read_text().splitlines()}
    left = [seed for seed in range(first, last + 1) if seed not in done]
    with ProcessPoolExecutor(args.jobs) as pool, args.out.open("a") as sink:
        for line in pool.map(one, left, [args] * len(left)):
            print(json.dumps(line), file=sink, flush=True)
            hidden = ", ".join(f"{k} x{s:g}" for k, s in line["wanted"]) or line["harmless"] or "nothing"
            print(f"{line['seed']}: {hidden}: {line['verdict']} {line.get('named', '')}", flush=True)
