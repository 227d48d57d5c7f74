"""The textbook model on measured arms: learned on one record, judged on another, in every band.

    python scripts/validate/measured_arms.py [--data ../shared/data] [--out docs/validation]

Textbook: inertia and gravity (base parameters), viscous and dry friction and an offset per joint, nothing else. Data
are found where IMPID_DATA points or beside the checkout (docs/data.md says where they come from).
"""

import argparse
import json
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import default_chain
from impid_host.impedance.force import compare_forces
from impid_host.impedance.identify import RobotParameters, identify_robot, robot_equation
from impid_host.impedance.physical import physical_robot
from impid_host.impedance.rows import Split
from impid_host.robot.model import robot_model
from impid_host.robot.terms import RobotStructure, robot_structure
from impid_host.signals.align import AlignedTrial, align
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import DEFAULT, Chain
from impid_host.study.importing import import_logs
from impid_host.study.model import Study
from markdown import table

CHECKOUT = Path(__file__).resolve().parents[2]
MAPPINGS = CHECKOUT / "docs" / "mappings"
TERMS = ("friction.coulomb", "actuator.offset")
BANDS_HZ = (4.5, 20.0, 50.0)


@dataclass(frozen=True, slots=True)
class Case:
    """A machine: on which records the model is learned, on which it is judged.

    Attributes:
        judged: other records; none: the last fifth of the learned one.
        trial: the one trial of the mapping that is meant, where it has several.
    """

    title: str
    mapping: str
    learned: str
    judged: tuple[str, ...] = ()
    trial: str | None = None
    physical: bool = False


UR = "ur10e/exc_20_02_{}.parquet"
CASES = (
    Case("KUKA LWR4, repeated motion", "kuka_lwr4", "kuka_lwr4/measurements_1.parquet", ("kuka_lwr4/measurements_2.parquet",), physical=True),
    Case("Franka Panda, tail", "franka_panda", "franka_panda/exciting.parquet", physical=True),
    Case("Staubli TX40, tail", "staubli_tx40", "staubli_tx40/exciting.parquet", physical=True),
    Case("UR10e, 30 s to 40 s", "ur10e", UR.format("10_30sec_12harm"), (UR.format("12_40sec_12harm"),), physical=True),
    Case("UR10e, 30 s to 50 s", "ur10e", UR.format("10_30sec_12harm"), (UR.format("19_14harm50sec"),), physical=True),
    Case("UR10e, 40 s to 30 s", "ur10e", UR.format("12_40sec_12harm"), (UR.format("10_30sec_12harm"),)),
    Case("UR10e, 50 s to 30 s", "ur10e", UR.format("19_14harm50sec"), (UR.format("10_30sec_12harm"),)),
    *(Case(f"UR10e joint {k} alone, tail", "ur10e_single_joint", f"ur10e/single_joint_{k}.parquet", trial=f"joint{k}_01") for k in (1, 3, 4, 6)),
    *(Case(f"UR10e joint {k} alone, by the URDF, tail", "ur10e", f"ur10e/single_joint_{k}.parquet") for k in (1, 3, 4)),
    Case("EMPS, tail", "emps", "emps/bangbang.parquet"),
    Case("double pendulum, tail", "dfki_double_pendulum", "dfki_double_pendulum/A0_exciting_061157.parquet"),
    Case("pendubot, tail", "pendubot_torque_sensor", "pendubot_torque_sensor/apr2020_harmonic_A_0.7854_v_0.5.parquet"),
)  # fmt: skip


def textbook(study: Study) -> RobotStructure:
    """Of a study's robot: the terms, and gravity where the model has none of its own and a trial may show it."""
    model = robot_model(study.setup.robot)
    return replace(robot_structure(model, TERMS), gravity=bool(model.gravity_parameters))


def load(data: Path, case: Case, name: str) -> Study:
    """One record of a case as a study."""
    logs = [data / name]
    if case.trial is not None:
        # A mapping of several files wants them all.
        logs = sorted((data / name).parent.glob("single_joint_*.parquet"))
    study = import_logs(logs, MAPPINGS / f"{case.mapping}.toml", case.title)
    kept = tuple(trial for trial in study.trials if case.trial in (None, trial.name))
    return Study(study.name, study.setup, kept)


def judge(data: Path, case: Case, chain: Chain, *, physical: bool = False) -> dict[str, Any]:
    """Errors of one case in one band, % of the judged torque, whole and joint by joint."""
    split = Split(0.0 if case.judged else 10.0)
    study = load(data, case, case.learned)
    structure = textbook(study)
    started = time.perf_counter()
    trials = [align(trial, study.setup, structure.model, chain) for trial in study.trials]
    try:
        fit = identify_robot(trials, structure, chain, split)
    except UndeterminedError as error:
        return {"cutoff_Hz": chain.finish.cutoff_hz if chain.finish else None, "refused": str(error)}
    seconds = time.perf_counter() - started
    judged = [
        align(trial, other.setup, structure.model, chain)
        for other in (load(data, case, name) for name in case.judged)
        for trial in other.trials
    ] or trials
    entry: dict[str, Any] = {
        "cutoff_Hz": chain.finish.cutoff_hz if chain.finish else None,
        "fit_s": round(seconds, 2),
        "joints": [joint + 1 for joint in fit.joints],
        **errors(judged, structure, fit.parameters.value, chain, split, fit.joints),
    }
    if physical:
        possible = physical_robot(fit, trials, chain, split)
        entry["possible_inertias"] = errors(judged, structure, possible.value, chain, split, fit.joints)
    return entry


def errors(
    trials: Sequence[AlignedTrial],
    structure: RobotStructure,
    value: Floats,
    chain: Chain,
    split: Split,
    joints: Sequence[int],
) -> dict[str, Any]:
    """100 |tau - Y value| / |tau| over the judged rows."""
    residual, torque = [], []
    for trial in trials:
        equation = robot_equation(trial, structure, chain, joints)
        rows = split.masks(trial, chain)[1]
        residual.append(equation.target[rows] - equation.design[rows] @ value)
        torque.append(equation.target[rows])
    left, whole = np.concatenate(residual), np.concatenate(torque)
    size = np.linalg.norm(whole, axis=0)
    # A joint without a drive has no torque to err from.
    each = 100 * np.linalg.norm(left, axis=0)[size > 0] / size[size > 0]
    return {
        "relative_percent": round(float(100 * np.linalg.norm(left) / np.linalg.norm(whole)), 2),
        "by_joint_percent": np.round(each, 1).tolist(),
        "rms": np.round(np.sqrt(np.mean(left**2, axis=0)), 3).tolist(),
    }


def leg(data: Path) -> list[dict[str, Any]]:
    """The leg's virtual force against its sensor: unfitted, and textbook fitted under the load's first part."""
    study = import_logs(
        [data / "leg_force_sensor" / "press_cycles.parquet"], MAPPINGS / "leg_force_sensor.toml", "leg"
    )
    model = robot_model(study.setup.robot)
    out = []
    for cutoff in BANDS_HZ:
        chain = DEFAULT.with_cutoff(cutoff)
        trials = [align(trial, study.setup, model, chain) for trial in study.trials]
        for terms in ((), TERMS[:1], TERMS):
            structure = robot_structure(model, terms)
            size = len(structure.parameter_names)
            unknown = RobotParameters(structure, np.full(size, np.nan), np.zeros((size, size)), "unknown")
            compared = compare_forces(trials, unknown, chain, Split())
            for error in compared.errors if not terms else compared.errors[1:]:
                words = error.by if not terms else f"{error.by}; with {', '.join(terms)}"
                out.append(
                    {
                        "cutoff_Hz": cutoff,
                        "by": words,
                        "rms_N": np.round(error.rms, 2).tolist(),
                        "relative_percent": np.round(error.relative_percent, 1).tolist(),
                    }
                )
    return out


def bands(study: Study, wanted: Sequence[float]) -> list[Chain]:
    """The default one and those asked for that the log's rate carries."""
    step = float(np.median(np.diff(study.trials[0].robot.t)))
    return [default_chain(study), *(DEFAULT.with_cutoff(hz) for hz in wanted if hz < 0.4 / step)]


def page(results: dict[str, list[dict[str, Any]]], forces: list[dict[str, Any]]) -> str:
    """The results as Markdown."""
    rows = []
    for title, entries in results.items():
        for k, entry in enumerate(entries):
            if "refused" in entry:
                rows.append([title if k == 0 else "", f"{entry['cutoff_Hz']:g}", "too few rows", "", "", ""])
                continue
            possible = entry.get("possible_inertias")
            rows.append(
                [
                    title if k == 0 else "",
                    f"{entry['cutoff_Hz']:g}" + (" (default)" if k == 0 else ""),
                    f"{entry['relative_percent']:.2f}",
                    "" if possible is None else f"{possible['relative_percent']:.2f}",
                    ", ".join(f"{value:g}" for value in entry["by_joint_percent"]),
                    f"{entry['fit_s']:.1f}",
                ]
            )
    head = ["record", "cut-off, Hz", "error, %", "possible inertias, %", "joint by joint, %", "fit, s"]
    legs = [
        [f"{row['cutoff_Hz']:g}", row["by"], *(f"{value:g}" for value in row["rms_N"]), *(f"{value:g}" for value in row["relative_percent"])]
        for row in forces
    ]  # fmt: skip
    lines = [
        "# Textbook models of measured arms",
        "",
        "Written by `python scripts/validate/measured_arms.py`. Inertia and gravity, viscous and dry friction and an",
        "offset per joint, learned on one record and judged on another, or on its own last fifth (tail), which took no",
        "part. Error: 100 |τ - τ̂| / |τ| over all joints that move. It is the baseline for anything that is found beyond it.",
        "",
        *table(head, rows),
        "",
        "## The leg: virtual against physical force, last fifth of the record",
        "",
        *table(["cut-off, Hz", "virtual force by", "Fx rms, N", "Fy rms, N", "Fx, %", "Fy, %"], legs),
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    default = Path(os.environ.get("IMPID_DATA", CHECKOUT.parent / "shared" / "data"))
    parser.add_argument("--data", type=Path, default=default)
    parser.add_argument("--out", type=Path, default=CHECKOUT / "docs" / "validation")
    parser.add_argument("--bands", type=float, nargs="+", default=BANDS_HZ, metavar="HZ")
    arguments = parser.parse_args()
    if not (arguments.data / "emps").is_dir():
        raise SystemExit(f"measured data not found at {arguments.data}; set IMPID_DATA (docs/data.md)")
    results = {}
    for case in CASES:
        chains = bands(load(arguments.data, case, case.learned), arguments.bands)
        results[case.title] = [
            judge(arguments.data, case, chain, physical=case.physical and k == 0)
            for k, chain in enumerate(chains)
        ]
    forces = leg(arguments.data)
    document = {"torque": results, "leg_force": forces}
    (arguments.out / "measured_arms.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    (arguments.out / "measured_arms.md").write_text(page(results, forces), encoding="utf-8")


if __name__ == "__main__":
    main()
