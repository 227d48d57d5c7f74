"""The first paper's tables and figures on its own protocol, simulated, beside its own numbers.

    python scripts/validate/first_paper.py [--out docs/validation] [--work build/validate] [--seed 11]

Runs the simulator's `dyck-2013-springs` and `dyck-2013-arm` (skipped where this same simulator has made the
study already), fits every trial alone as the paper does, and writes first_paper.md, first_paper.json and the figures. The simulator
hides nothing in these two: what is left is the method's own error.
"""

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from campaign import Result, Row, SignalPath, cells, run
from first_paper_arm import arm_numbers, pooled
from first_paper_figures import draw_campaign, draw_filters
from first_paper_page import SOURCES, write_page
from footnote_two import draw, sweep
from impid_host.signals.align import AccelerationSource

HERE = Path(__file__).parent
PUBLISHED = json.loads((HERE / "published_tables.json").read_text(encoding="utf-8"))
STIFFNESS = list(PUBLISHED["theory"]["K"])
MASSES = list(PUBLISHED["theory"]["m_kg"])
PATHS = (
    SignalPath("published", "published", "accelerometer"),
    SignalPath("default", "default", "accelerometer"),
    SignalPath("published, no accelerometer", "published", "angles"),
)
# Footnote 2: encoders of 400000 to 1000 counts per turn; with fewer the clocks can no longer be matched.
COARSER = (1, 10, 100, 400)
FEW = ("spring_K1_M1", "spring_K3_M3", "spring_K5_M5")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("docs/validation"))
    parser.add_argument("--work", type=Path, default=Path("build/validate"))
    parser.add_argument("--seed", type=int, default=11)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    springs = simulate("dyck-2013-springs", options.work, options.seed)
    arm = simulate("dyck-2013-arm", options.work, options.seed + 1)
    say("fitting 75 mass-spring trials by each signal path")
    results = {path.name: run(springs, path) for path in PATHS}
    say("encoder resolution (footnote 2)")
    coarse = {
        (factor, source): run(springs, SignalPath(f"{factor} {source}", "published", source, factor), FEW)
        for factor in COARSER
        for source in SOURCES
    }
    conditions = sweep()
    say("fitting the arm")
    arms = {path.name: run(arm, path) for path in PATHS[:2]}
    truth = json.loads((options.work / "dyck-2013-arm.truth.json").read_text(encoding="utf-8"))
    document = {
        "command": "python scripts/validate/first_paper.py",
        "scenarios": ["dyck-2013-springs", "dyck-2013-arm"],
        "seed": options.seed,
        "robot": {name: robot_numbers(result) for name, result in results.items()},
        "table_III": {name: table_three(result.rows) for name, result in results.items()},
        "table_IV": {name: table_four(result.rows) for name, result in results.items()},
        "footnote_2": footnote_numbers(coarse),
        "footnote_2_conditions": conditions,
        "table_V": {name: arm_numbers(result.rows) for name, result in arms.items()},
        "arm_pooled": pooled(arm, options.out / "first_paper_ellipses.png"),
        "arm_truth": next(t["load"] for t in truth["trials"].values() if t["kind"] == "arm"),
    }
    (options.out / "first_paper.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    draw_filters(options.out / "first_paper_fig3.png")
    draw_campaign(results, PUBLISHED, options.out / "first_paper_fig5.png")
    draw(conditions, options.out / "first_paper_footnote2.png")
    page = "\n".join(write_page(document, PUBLISHED)) + "\n"
    (options.out / "first_paper.md").write_text(page, encoding="utf-8")
    say(f"written to {options.out}")


def say(words: str) -> None:
    sys.stderr.write(words + "\n")


def simulate(scenario: str, work: Path, seed: int) -> Path:
    """The study folder of a scenario, made unless this simulator has made it with this seed."""
    study, stamp = work / scenario, work / f"{scenario}.made_by"
    own = f"{_simulator()} seed {seed}"
    if stamp.exists() and stamp.read_text(encoding="utf-8") == own:
        return study
    if study.exists():
        shutil.rmtree(study)
    work.mkdir(parents=True, exist_ok=True)
    say(f"simulating {scenario}")
    command = ["study", scenario, "--out", str(study), "--seed", str(seed)]
    program = Path(sys.executable).with_name("impid-sim")
    subprocess.run([str(program), *command, "--truth", str(work / f"{scenario}.truth.json")], check=True)
    stamp.write_text(own, encoding="utf-8")
    return study


def _simulator() -> str:
    """Fingerprint of the simulator's sources and of the firmware core that it runs."""
    root = HERE.parents[1]
    files = [
        f for part in ("hil_sim", "firmware/core", "firmware/boards/native") for f in (root / part).rglob("*")
    ]
    sources = sorted(f for f in files if f.suffix in (".py", ".c", ".h", ".toml"))
    return hashlib.sha256(b"".join(f.read_bytes() for f in sources)).hexdigest()[:16]


def robot_numbers(result: Result) -> dict[str, Any]:
    """alpha: pooled with its interval, and mean and scatter of the trials fitted alone, as in Table VI."""
    each = np.array([fit.estimate.value for fit in result.robots])
    return {
        "alpha": result.robot.estimate.value.tolist(),
        "ci95": result.robot.estimate.ci95.tolist(),
        "per_trial": [
            [float(m), float(s)] for m, s in zip(each.mean(axis=0), each.std(axis=0, ddof=1), strict=True)
        ],
        "vaf": [[float(v) for v in fit.vaf] for fit in result.robots],
    }


def table_three(rows: Sequence[Row]) -> dict[str, Any]:
    """As the paper: stiffness over the 15 trials of each K, mass over the 15 trials of each M."""
    out: dict[str, Any] = {}
    for method in ("method1", "method2"):
        by_K = {k: cells(_of(rows, 1, k), method, ("kxx", "kyy", "kxy")) for k in STIFFNESS}
        by_m = {m: cells(_of(rows, 2, m), method, ("mxx",)) for m in MASSES}
        out[method] = {"K": by_K, "m": by_m}
    return out


def table_four(rows: Sequence[Row]) -> dict[str, Any]:
    """Mean VAF of Method 1 per configuration, and the lowest single value by either method."""
    out: dict[str, Any] = {k: {} for k in STIFFNESS}
    for stiffness in STIFFNESS:
        for mass in MASSES:
            own = [r.vaf for r in _of(_of(rows, 1, stiffness), 2, mass) if r.method == "method1"]
            out[stiffness][mass] = np.mean(own, axis=0).tolist()
    for method in ("method1", "method2"):
        out[f"lowest_{method}"] = float(min(min(r.vaf) for r in rows if r.method == method))
    return out


def footnote_numbers(coarse: Mapping[tuple[int, AccelerationSource], Result]) -> list[dict[str, Any]]:
    """Largest error of Method 1 over the loads, with and without the accelerometer, per encoder resolution."""
    out = []
    for (factor, source), result in coarse.items():
        own = [row for row in result.rows if row.method == "method1"]
        error = [relative_errors(row) for row in own]
        alpha = result.robot.estimate.value / np.array(PUBLISHED["robot_alpha"]["alpha"]) - 1
        out.append(
            {
                "counts_per_rev": 400_000 // factor,
                "acceleration": source,
                "m_percent": 100 * max((e[0] for e in error), key=abs),
                "K_percent": 100 * max((e[1] for e in error), key=abs),
                "alpha_percent": (100 * alpha).tolist(),
                "lowest_vaf": float(min(min(row.vaf) for row in own)),
            }
        )
    return out


def relative_errors(row: Row) -> tuple[float, float]:
    """Errors of m, and the larger one of K's diagonal."""
    _, stiffness, mass = row.load.split("_")
    K, m = PUBLISHED["theory"]["K"][stiffness], PUBLISHED["theory"]["m_kg"][mass]
    of_K = max((row.values[name] / K[name] - 1 for name in ("kxx", "kyy")), key=abs)
    return row.values["mxx"] / m - 1, of_K


def _of(rows: Sequence[Row], part: int, name: str) -> list[Row]:
    return [row for row in rows if row.load.split("_")[part] == name]


if __name__ == "__main__":
    main()
