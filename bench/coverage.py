"""How often the time domain's 95 % intervals hold the truth, and its squared error over the Cramer-Rao bound.

    python bench/coverage.py [STUDIES] [--markdown FILE] [--keep FILE] [--workers N]

Studies done are kept in a file (build/coverage.jsonl) and not done again, so a run may be broken off and
taken up; the file begins with a fingerprint of the estimators, and is begun anew when they change. `--markdown`
writes a JSON file with every parameter, and a figure, beside the page.
"""

import argparse
import json
import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import coverage_study
import impid_host.impedance
import impid_host.robot
import impid_host.signals
import numpy as np
from coverage_figure import draw
from coverage_study import LOADS, POLES_HZ, Values, one_study
from impid_host.errors import UndeterminedError
from kept import Kept
from scipy.stats import binom


def code() -> list[Path]:
    """Files that the results depend on."""
    packages = (impid_host.impedance, impid_host.signals, impid_host.robot)
    own = [file for package in packages for file in sorted(Path(package.__path__[0]).glob("*.py"))]
    return [Path(coverage_study.__file__), *own]


def job(seed: int, kind: str, colour: str) -> tuple[str, Values]:
    """One study under its name; nothing in it where it was refused."""
    try:
        return f"{seed} {kind} {colour}", one_study(seed, kind, colour)
    except UndeterminedError as error:
        print(f"refused: {error}", file=sys.stderr)
        return f"{seed} {kind} {colour}", {}


def run(studies: int, path: Path, workers: int) -> dict[str, Values]:
    """Every study asked for, all rows' first seeds first."""
    kept = Kept(path, code())
    done: dict[str, Values] = kept.answers
    todo = [(seed, kind, colour) for seed in range(studies) for kind in LOADS for colour in POLES_HZ]
    todo = [part for part in todo if "{} {} {}".format(*part) not in done]
    with ProcessPoolExecutor(workers) as pool:
        for name, values in pool.map(job, *zip(*todo, strict=True), chunksize=6) if todo else ():
            kept.put(name, values)
    return done


def counted(done: dict[str, Values], kind: str, colour: str, studies: int) -> dict[str, dict[str, float]]:
    """Coverage (%) and mean squared error over the bound, per parameter, over the first so many studies."""
    every: Values = defaultdict(list)
    for seed in range(studies):
        for name, rows in done[f"{seed} {kind} {colour}"].items():
            every[name] += rows
    out = {}
    for name, rows in every.items():
        value, true, low, high, bound = np.array(rows).T
        square = (value - true) ** 2 / np.mean(bound)
        out[name] = {
            "studies": len(rows),
            "coverage_percent": float(100 * np.mean((low <= true) & (true <= high))),
            "mse_over_crb": float(np.mean(square)),
            "mse_over_crb_standard_error": float(np.std(square) / np.sqrt(len(square))),
            "bias_over_sd": float(np.mean(value - true) / np.std(value)),
        }
    return out


def page(result: dict[str, dict[str, dict[str, float]]], studies: int) -> str:
    """The Markdown page."""
    every = [(where, name, entry) for where, part in result.items() for name, entry in part.items()]
    cover = np.array([entry["coverage_percent"] for *_, entry in every])
    ratio = np.array([entry["mse_over_crb"] for *_, entry in every])
    lines = [
        "# Intervals and efficiency in the time domain",
        "",
        f"`python bench/coverage.py {studies}`: {studies} simulated studies per row. A true 95 % counted in so many has "
        f"a standard error of {100 * np.sqrt(0.95 * 0.05 / studies):.1f} % per parameter, a true ratio of 1.0 one of "
        f"{np.sqrt(2 / studies):.2f}. Lowest and highest are over the parameters, equilibrium included. The bound for "
        "Method 1 is that of robot and load fitted jointly from all torques; all bounds know the accelerations as well as "
        "the accelerometer does, and the noise's spectra. Every parameter is in "
        "`coverage.json`.",
        "",
        "| load, noise | part | coverage: mean (lowest, highest) % | MSE / bound: mean (highest) |",
        "| --- | --- | --- | --- |",
    ]
    for where, part in result.items():
        for method in ("robot", "method 1", "method 2"):
            own = {name: entry for name, entry in part.items() if name.startswith(method)}
            low, high = (pick(own, key=lambda n: own[n]["coverage_percent"]) for pick in (min, max))
            worst = max(own, key=lambda n: own[n]["mse_over_crb"])
            mean = np.mean([entry["coverage_percent"] for entry in own.values()])
            short = {name: name.removeprefix(method).strip() for name in own}
            lines.append(
                f"| {where} | {method} | {mean:.1f} ({own[low]['coverage_percent']:.1f} {short[low]}, "
                f"{own[high]['coverage_percent']:.1f} {short[high]}) | "
                f"{np.mean([entry['mse_over_crb'] for entry in own.values()]):.2f} "
                f"({own[worst]['mse_over_crb']:.2f} {short[worst]}) |"
            )
    outside = [(w, n, e) for w, n, e in every if not 93 <= e["coverage_percent"] <= 97]
    above = [(w, n, e) for w, n, e in every if e["mse_over_crb"] > 1.2]
    chance = binom.cdf(np.ceil(0.93 * studies) - 1, studies, 0.95) + binom.sf(
        np.floor(0.97 * studies), studies, 0.95
    )
    lines += [
        "",
        f"All {len(every)} parameters: coverage {cover.mean():.1f} % on average, {len(outside)} outside 93 to 97 % "
        f"(intervals that were exactly right would put {chance * len(every):.1f} there by chance)"
        + "".join(f"; {w}, {n}: {e['coverage_percent']:.1f} %" for w, n, e in outside)
        + f". MSE over the bound {ratio.mean():.2f} on average, {len(above)} above 1.2"
        + "".join(
            f"; {w}, {n}: {e['mse_over_crb']:.2f} ± {e['mse_over_crb_standard_error']:.2f}"
            for w, n, e in above
        )
        + ".",
    ]
    lines += [
        "",
        "![Coverage and efficiency](coverage.png)",
        "",
        "Light grey: 93 to 97 %; darker: where 19 of 20 parameters of exact intervals would fall by chance.",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("studies", type=int, nargs="?", default=500)
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--keep", type=Path, default=Path("build/coverage.jsonl"))
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    done = run(options.studies, options.keep, options.workers)
    result = {
        f"{kind}, {colour}": counted(done, kind, colour, options.studies)
        for kind in LOADS
        for colour in POLES_HZ
    }
    text = page(result, options.studies)
    print(text)
    if options.markdown is not None:
        options.markdown.write_text(text, encoding="utf-8")
        document = {"command": f"python bench/coverage.py {options.studies}", "rows": result}
        json_file = options.markdown.with_suffix(".json")
        json_file.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        draw(result, options.studies, options.markdown.with_suffix(".png"))


if __name__ == "__main__":
    main()
