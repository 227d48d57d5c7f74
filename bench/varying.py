"""How often bands of K(t), B(t) and x0(t) hold the whole true curve, and how often a constant arm is said to change.

    python bench/varying.py [ARMS] [--axes 1 2] [--markdown FILE] [--keep FILE] [--workers N]

Arms are those of bench/varying_arm.py: ARMS whose courses differ and ARMS that are constant, for each number of
axes. Arms done are kept in a file that begins with a fingerprint of the estimator, so a run may be broken off.
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import impid_host.impedance
import impid_host.impedance.varying
import numpy as np
import varying_arm
from impid_host.impedance.loads import arm as arm_model
from impid_host.impedance.varying.expand import Scheduled
from impid_host.impedance.varying.fit import CLAIMED_BELOW, VaryingFit, fit_varying
from impid_host.signals.chain import DEFAULT
from kept import Kept

AXES = {1: ("x",), 2: ("x", "y")}


def code() -> list[Path]:
    """Files that the results depend on."""
    folders = (impid_host.impedance, impid_host.impedance.varying)
    files = [Path(varying_arm.__file__)]
    files += [Path(folders[0].__path__[0]) / name for name in ("colour.py", "rows.py", "loads.py")]
    own = ("asked", "bands", "curves", "expand", "fit", "posterior")
    return files + [Path(folders[1].__path__[0]) / f"{name}.py" for name in own]


def truths(arm: varying_arm.Arm, fit: VaryingFit) -> dict[str, np.ndarray]:
    """The true curve of each of the fit's, by its name, at its places."""
    axes, t = fit.model.axes, arm.trial.elapsed
    out = {}
    for name in fit.curves:
        if name.endswith("0"):
            own = arm.x0[:, axes.index(name[0])]
        else:
            i, j = (axes.index(letter) for letter in (name[1:] or "xx"))
            own = (arm.K if name[0] == "k" else arm.B)[:, i, j]
        out[name] = np.interp(fit.places, t, own)
    return out


def one(seed: int, d: int, constant: bool) -> dict[str, Any]:
    """What became of one arm."""
    arm = varying_arm.arm(seed, d, constant=constant)
    part = Scheduled(arm.trial, arm.trial.elapsed)
    fit = fit_varying([part], arm_model(AXES[d]), DEFAULT, robot=None)
    inside, width = {}, {}
    for name, true in truths(arm, fit).items():
        own = fit.curves[name]
        inside[name] = bool(np.all((own.low <= true) & (true <= own.high)))
        width[name] = float(np.mean(own.high - own.low) / 2 / np.mean(np.abs(true)))
    mass = dict(fit.M)
    i = [AXES[d].index(n[1]) if d > 1 else 0 for n in mass]
    j = [AXES[d].index(n[2]) if d > 1 else 0 for n in mass]
    for (name, own), r, c in zip(mass.items(), i, j, strict=True):
        inside[name] = bool(own.low[0] <= arm.M[r, c] <= own.high[0])
    return {
        "courses": arm.courses,
        "inside": inside,
        "width": width,
        "p": {asked.group: asked.p_value for asked in fit.asked},
        "vaf": [fit.vaf_constant.tolist(), fit.vaf_varying.tolist()],
    }


def run(todo: Sequence[tuple[int, int, bool]], path: Path, workers: int) -> dict[str, Any]:
    """Every arm asked for."""
    kept = Kept(path, code())
    done = kept.answers
    todo = [job for job in todo if "{} {} {}".format(*job) not in done]
    with ProcessPoolExecutor(workers) as pool:
        for job, found in zip(todo, pool.map(one, *zip(*todo, strict=True)) if todo else (), strict=True):
            kept.put("{} {} {}".format(*job), found)
    return done


def counted(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Coverage in per cent by curve and by course of K, claims in per cent."""
    inside: dict[str, list[bool]] = defaultdict(list)
    by_course: dict[str, list[bool]] = defaultdict(list)
    width: dict[str, list[float]] = defaultdict(list)
    for entry in found:
        for name, own in entry["inside"].items():
            inside[name].append(own)
            if name[0] in "kb" or name.endswith("0"):
                group = "x0" if name.endswith("0") else name[0].upper()
                by_course[f"{group} {entry['courses'][group]}"].append(own)
        for name, own_width in entry["width"].items():
            width[name].append(own_width)
    claims = {group: [entry["p"][group] < CLAIMED_BELOW for entry in found] for group in ("K", "B", "x0")}
    true = {group: [entry["courses"][group] != "constant" for entry in found] for group in claims}
    return {
        "arms": len(found),
        "coverage_percent": {name: 100 * float(np.mean(own)) for name, own in inside.items()},
        "coverage_by_course_percent": {name: 100 * float(np.mean(own)) for name, own in sorted(by_course.items())},
        "half_width_median_percent": {name: 100 * float(np.median(own)) for name, own in width.items()},
        "claimed_where_constant": {
            group: [sum(c for c, t in zip(claims[group], true[group], strict=True) if not t),
                    sum(not t for t in true[group])]
            for group in claims
        },
        "claimed_where_changing": {
            group: [sum(c for c, t in zip(claims[group], true[group], strict=True) if t), sum(true[group])]
            for group in claims
        },
        "any_claim": sum(any(claims[g][k] for g in claims) for k in range(len(found))),
        "any_claim_of_K_or_B": sum(claims["K"][k] or claims["B"][k] for k in range(len(found))),
    }  # fmt: skip


def page(result: dict[str, dict[str, Any]], command: str) -> str:
    """The Markdown page."""
    lines = [
        "# Impedance over time: bands and claims",
        "",
        f"`{command}`; arms of `bench/varying_arm.py`, 60 s each: a sum of sinusoids to 3.5 Hz, 1.2 cm rms; K, B and x0 each a "
        "ramp, a soft step, a sine, a bump or constant, K by 10 to 90 %; force noise white or with a pole at 1.5 or 0.3 Hz, over a "
        "tenfold range of sizes. A band counts as right where the whole true curve lies inside.",
        "",
        "| arms | curve | whole curve inside (%) | half width, median (%) |",
        "| --- | --- | --- | --- |",
    ]
    for where, own in result.items():
        lines += [
            f"| {where}, {own['arms']} | {name} | {own['coverage_percent'][name]:.1f} | "
            + (
                f"{own['half_width_median_percent'][name]:.0f} |"
                if name in own["half_width_median_percent"]
                else "|"
            )
            for name in own["coverage_percent"]
        ]
    lines += [
        "",
        "By course, over all entries of the matrix:",
        "",
        "| arms | course | inside (%) |",
        "| --- | --- | --- |",
    ]
    lines += [
        f"| {where} | {name} | {value:.1f} |"
        for where, own in result.items()
        for name, value in own["coverage_by_course_percent"].items()
    ]
    lines += [
        "",
        f"Claims (p below {CLAIMED_BELOW} for each of K, B and x0):",
        "",
        "| arms | | K | B | x0 | any of K, B | any |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for where, own in result.items():
        for word, key in (("claimed though constant", "claimed_where_constant"),
                          ("claimed where it changes", "claimed_where_changing")):  # fmt: skip
            if all(own[key][g][1] == 0 for g in own[key]):
                continue
            cells = " | ".join(f"{a} of {b}" for a, b in own[key].values())
            whole = own["arms"] if key == "claimed_where_constant" and "constant" in where else None
            tail = (
                f"{own['any_claim_of_K_or_B']} of {whole} | {own['any_claim']} of {whole}" if whole else " | "
            )
            lines.append(f"| {where} | {word} | {cells} | {tail} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("arms", type=int, nargs="?", default=200)
    parser.add_argument("--axes", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--keep", type=Path, default=Path("build/varying.jsonl"))
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    todo = [
        (seed, d, constant)
        for d in options.axes
        for seed in range(options.arms)
        for constant in (False, True)
    ]
    done = run(todo, options.keep, options.workers)
    result = {
        f"{d} {'axis' if d == 1 else 'axes'}, {'constant' if constant else 'changing'}": counted(
            [done[f"{seed} {d} {constant}"] for seed in range(options.arms)]
        )
        for d in options.axes
        for constant in (False, True)
    }
    command = f"python bench/varying.py {options.arms} --axes {' '.join(map(str, options.axes))}"
    text = page(result, command)
    print(text)
    if options.markdown is not None:
        options.markdown.write_text(text, encoding="utf-8")
        document = {"command": command, "rows": result}
        options.markdown.with_suffix(".json").write_text(
            json.dumps(document, indent=1) + "\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
