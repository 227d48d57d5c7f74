"""Bias and coverage of least squares, instruments, output error and the choice by evidence, where truth is known.

    python bench/estimators.py [STUDIES] [--slow STUDIES] [--only WORDS] [--kept] [--markdown FILE] [--keep FILE]

Studies of bench/estimator_cases.py through `fit`'s own regression; STUDIES each, --slow of those that simulate.
Answers are kept in a file that begins with a fingerprint of the estimators, so a run may be broken off. Where
IMPID_DATA holds the measured EMPS record, its parameters stand beside the published ones.
"""

import argparse
import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import estimator_cases
import impid_host.impedance
import numpy as np
from estimator_cases import Case, axis, birdy, paper
from impid_host.impedance.campaign import Options, fit_study
from impid_host.impedance.estimators.choose import Regression
from impid_host.impedance.estimators.estimated import ESTIMATORS, EstimatorWish
from impid_host.impedance.identify import RobotFit
from impid_host.impedance.rows import Split
from impid_host.signals.chain import CHAINS, DEFAULT
from impid_host.study.importing import import_logs
from kept import Kept

ROOT = Path(__file__).resolve().parents[1]
PUBLISHED = {
    "M": (95.1089, 0.1085),
    "Fv": (203.5034, 1.146),
    "Fc": (20.3935, 0.1012),
    "offset": (-3.1648, 0.0444),
}
TERMS = ("friction.coulomb", "actuator.offset")


@dataclass(frozen=True)
class Row:
    """Studies of one kind by one estimator; `slow`: 1 where the model is simulated, 2 where that takes a minute."""

    what: str
    noise: str
    wish: EstimatorWish
    make: Callable[[int], Case]
    slow: int


def rows() -> Iterator[Row]:
    """All of the page."""
    fast: tuple[EstimatorWish, ...] = ("least-squares", "instruments", "auto")
    with_reference: tuple[EstimatorWish, ...] = ("instruments", "output-error")
    without_choice: tuple[EstimatorWish, ...] = ("least-squares", *with_reference)
    for factor in (1.0, 5.0, 25.0):
        noise = f"accelerometer × {factor:g}"
        for wish in (*fast, "output-error"):
            yield Row("one axis", noise, wish, partial(axis, factor=factor), int(wish == "output-error"))
        for wish in with_reference:
            yield Row("one axis, reference logged", noise, wish, partial(axis, factor=factor, told=True), 1)
    in_the_loop: tuple[tuple[bool, tuple[EstimatorWish, ...]], ...] = (
        (False, ("least-squares", "instruments")),
        (True, (*with_reference, "auto")),
    )
    for told, wishes in in_the_loop:
        name = "one axis, force of 0.3 N rms in the loop" + (", reference logged" if told else "")
        for wish in wishes:
            make = partial(axis, factor=1.0, told=told, disturbed=0.3)
            yield Row(name, "accelerometer × 1", wish, make, int(told))
    for kind in ("mass-spring", "arm"):
        for factor in (1.0, 5.0, 25.0):
            noise = f"accelerometer × {factor:g}"
            for wish in fast if factor == 5.0 else (*fast, "output-error"):
                make = partial(paper, factor=factor, kind=kind)
                yield Row(f"the paper's robot, {kind}", noise, wish, make, int(wish == "output-error"))
        make = partial(paper, factor=25.0, kind=kind, told=True)
        name = f"the paper's robot, {kind}, reference logged"
        yield Row(name, "accelerometer × 25", "instruments", make, 1)
    for degrees in (1e-3, 1e-2):
        for wish in without_choice:
            make = partial(_two_links, degrees=degrees)
            yield Row("two links, free (BIRDy's noise)", f"angles {degrees:g} deg", wish, make, 2)


def _two_links(seed: int, degrees: float) -> Case:
    return birdy([seed], degrees)[0]


def answer(row: Row, seed: int) -> dict[str, Any]:
    """One study: relative errors of robot and load, and which intervals hold the truth."""
    case = row.make(seed)
    regression = Regression(row.wish, DEFAULT, Split())
    robot = regression.robot(case.free, case.structure)
    own = robot.estimate
    out: dict[str, Any] = {
        "alpha": (own.value - case.alpha).tolist(),
        "alpha_true": case.alpha.tolist(),
        "alpha_held": held(own.ci95, case.alpha),
        "by": [row.wish if robot.estimated is None else robot.estimated.by],
    }
    if case.load is None:
        return out
    model, value = case.load
    known = robot.parameters
    fit = regression.load(case.loaded, model, case.structure, known, known, 0.0)
    out["by"].append(row.wish if fit.estimated is None else fit.estimated.by)
    for letter, signal in (("M", "a"), ("B", "v"), ("K", "x")):
        columns = [q for q, column in enumerate(model.columns) if column.signal == signal]
        if columns:
            S = model.matrix_map(signal)  # type: ignore[arg-type]
            out[letter] = (S @ (fit.estimate.value - value)).tolist()
            out[f"{letter}_true"] = (S @ value).tolist()
            out.setdefault("held", []).extend(held(fit.estimate.ci95[columns], value[columns]))
    return out


def held(ci95: np.ndarray, truth: np.ndarray) -> list[bool]:
    """Which intervals hold the truth."""
    return [bool(low <= own <= high) for (low, high), own in zip(ci95, truth, strict=True)]


def code() -> list[Path]:
    """Files that the answers depend on."""
    folder = Path(impid_host.impedance.__path__[0])
    files = [Path(estimator_cases.__file__), *sorted((folder / "estimators").glob("*.py"))]
    return files + [folder / f"{name}.py" for name in ("linear", "identify", "colour", "kernel", "rows")]


def run(
    studies: int, slow: int, path: Path, only: str, *, kept: bool
) -> dict[tuple[str, str, str], list[dict[str, Any]]]:
    """Every study that was asked for, from the file where it is there."""
    answers = Kept(path, code())
    done = answers.answers
    result: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for row in rows():
        if only not in row.what:
            continue
        names = [
            f"{row.what} {row.noise} {row.wish} {seed}"
            for seed in range(slow // row.slow if row.slow else studies)
        ]
        for seed, name in enumerate(names):
            if name not in done and not kept:
                answers.put(name, answer(row, seed))
        found = [done[name] for name in names if name in done]
        if len(found) > 1:
            result[row.what, row.noise, row.wish] = found
    return result


def relative(found: list[dict[str, Any]], key: str) -> tuple[float, float, float]:
    """Bias, its standard error and the rms error of a matrix, % of its size (root of its squares)."""
    error = np.array([one[key] for one in found])
    size = float(np.linalg.norm(found[0][f"{key}_true"]))
    bias = np.linalg.norm(error.mean(axis=0))
    spread = np.sqrt(np.sum(error.var(axis=0, ddof=1)) / len(error))
    rms = np.sqrt(np.mean(np.sum(error**2, axis=1)))
    return tuple(100 * float(part) / size for part in (bias, spread, rms))  # type: ignore[return-value]


def summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Of one row of the page."""
    out: dict[str, Any] = {"studies": len(found)}
    for key in ("alpha", "M", "B", "K"):
        if key in found[0]:
            bias, error, rms = relative(found, key)
            out[key] = {"bias_percent": bias, "bias_error_percent": error, "rms_percent": rms}
    out["robot_held_percent"] = 100 * float(np.mean([one["alpha_held"] for one in found]))
    if "held" in found[0]:
        out["load_held_percent"] = 100 * float(np.mean([one["held"] for one in found]))
    chosen = [by for one in found for by in one["by"]]
    out["instruments_percent"] = 100 * chosen.count("instruments") / len(chosen)
    return out


def emps() -> dict[str, Any] | None:
    """The measured axis by every estimator, value and standard deviation; None without the record."""
    record = Path(os.environ.get("IMPID_DATA", "")) / "emps" / "bangbang.parquet"
    if "IMPID_DATA" not in os.environ or not record.exists():
        return None
    study = import_logs([record], ROOT / "docs" / "mappings" / "emps.toml", "emps")
    out: dict[str, Any] = {}
    for wish in ESTIMATORS:
        fit = fit_study(study, Options(CHAINS["emps"], None, TERMS, Split(0.0), estimator=wish)).robot
        assert isinstance(fit, RobotFit)
        own = fit.estimate
        values = [[float(v), float(s)] for v, s in zip(own.value, own.sd, strict=True)]
        out[wish] = {
            "values": dict(zip(own.names, values, strict=True)),
            "error_percent": own.relative_error_percent,
        }
    return out


def cell(own: dict[str, Any], key: str) -> str:
    """Bias ± its standard error, and rms error."""
    if key not in own:
        return ""
    part = own[key]
    return f"{part['bias_percent']:.2f} ± {part['bias_error_percent']:.2f}; {part['rms_percent']:.2f}"


def page(result: list[dict[str, Any]], measured: dict[str, Any] | None, command: str) -> str:
    """The Markdown page."""
    lines = [
        "# Estimators: bias and coverage",
        "",
        f"`{command}`. What each estimator is: [estimators](../estimators.md). Studies are two free and two loaded trials of "
        "30 s at 100 Hz (`bench/estimator_cases.py`); the accelerometer's usual noise is 10 mm/s² rms per sample. Each cell: "
        "bias ± its standard error; rms error, both in % of the matrix's (or vector's) size. A bias is a mean's length, so "
        "that pure chance leaves about its standard error. Held: 95 % intervals that hold the truth. Each row says how many "
        "studies it has.",
        "",
        "Instruments are the angles where the reference is not logged, else the simulated model. The two links' controller "
        "differentiates noisy angles: at 0.01 deg the arm itself dithers, which smooths its dry friction at reversals, and all "
        "estimators report the friction that is left of it.",
        "",
        "| case | noise | estimator | studies | M | B | K | robot | load held (%) | robot held (%) |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for own in result:
        load = f"{own['load_held_percent']:.1f}" if "load_held_percent" in own else ""
        by = own["estimator"]
        if by == "auto":
            by += f" (instruments in {own['instruments_percent']:.0f} %)"
        cells = " | ".join(cell(own, key) for key in ("M", "B", "K", "alpha"))
        lines.append(
            f"| {own['case']} | {own['noise']} | {by} | {own['studies']} | {cells} | {load} | "
            f"{own['robot_held_percent']:.1f} |"
        )
    lines += ["", "## The measured EMPS axis", ""]
    if measured is None:
        lines += ["Not compared: IMPID_DATA does not hold the record.", ""]
        return "\n".join(lines)
    lines += [
        "Authors' chain (`--chain emps --with friction.coulomb --with actuator.offset --validate 0`), reference logged; "
        "published: Janot, Gautier and Brunot 2019, least squares. Value (standard deviation); theirs holds for white noise.",
        "",
        "| estimator | M (kg) | Fv (N s/m) | Fc (N) | offset (N) | relative error (%) |",
        "| --- | --- | --- | --- | --- | --- |",
        "| published | " + " | ".join(f"{v:.2f} ({s:.2f})" for v, s in PUBLISHED.values()) + " | 4.08 |",
    ]
    for wish, own in measured.items():
        cells = " | ".join("{:.2f} ({:.2f})".format(*own["values"][name]) for name in PUBLISHED)
        lines.append(f"| {wish} | {cells} | {own['error_percent']:.2f} |")
    return "\n".join([*lines, ""])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("studies", type=int, nargs="?", default=100)
    parser.add_argument("--slow", type=int, default=20)
    parser.add_argument("--only", default="", help="cases whose name has this in it")
    parser.add_argument("--kept", action="store_true", help="only studies that are in the file already")
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--keep", type=Path, default=Path("build/estimators.jsonl"))
    options = parser.parse_args()
    found = run(options.studies, options.slow, options.keep, options.only, kept=options.kept)
    result = [
        {"case": what, "noise": noise, "estimator": wish, **summary(own)}
        for (what, noise, wish), own in found.items()
    ]
    command = f"python bench/estimators.py {options.studies} --slow {options.slow}"
    measured = emps()
    text = page(result, measured, command)
    print(text)
    if options.markdown is not None:
        options.markdown.write_text(text, encoding="utf-8")
        document = {"command": command, "rows": result, "emps": measured}
        options.markdown.with_suffix(".json").write_text(
            json.dumps(document, indent=1) + "\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
