"""Diagnoses of measured data: what was named, the error before and after each name, and what carries over.

    python scripts/validate/measured_diagnosis.py [--data ../shared/data] [--out docs/validation]

Data are found where IMPID_DATA points or beside the checkout (docs/data.md says where they come from). Of every
record the last third (or, of three and more, the last) takes no part in choosing or fitting; errors are of that
part. A model that is to serve another record is learned on one record alone and judged on the other, whole.
"""

import argparse
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.diagnosis.base import base_of
from impid_host.diagnosis.case import prepare
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.holdout import hold_out
from impid_host.diagnosis.prepare import views
from impid_host.diagnosis.proof import aligned, chain_of
from impid_host.diagnosis.result import UNATTRIBUTED, Chosen, Diagnosis
from impid_host.diagnosis.reuse import carried, cleaned_trials
from impid_host.diagnosis.saved import read_model, save_model
from impid_host.diagnosis.stages import Bench
from impid_host.impedance.rows import finish
from impid_host.robot.model import robot_model
from impid_host.signals.align import align
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import CHAINS, DEFAULT
from impid_host.study.importing import import_logs
from impid_host.study.model import RobotLog, Study, Trial
from measured_diagnosis_page import page

CHECKOUT = Path(__file__).resolve().parents[2]
MAPPINGS = CHECKOUT / "docs" / "mappings"
PENDULUM_RECORDS = ("A0_sysid_00", "A0_sysid_01", "A0_sysid_02", "A0_sysid_03", "A0_sysid_05")
UR10E_JOINTS = (1, 3, 4, 6)
ANKLES = {"z_df": "dorsiflexors_01", "z_pf": "plantarflexors_01", "z_df2": "dorsiflexors_02"}


@dataclass(frozen=True, slots=True)
class Record:
    """One study to be diagnosed, and what a reader must know of it."""

    key: str
    title: str
    study: Study
    words: str


def emps(data: Path) -> Study:
    """The bang-bang record of the positioning axis."""
    return import_logs([data / "emps" / "bangbang.parquet"], MAPPINGS / "emps.toml", "emps")


def pendulum(data: Path, records: Sequence[str]) -> Study:
    """Records of design A.0 as one study."""
    files = [data / "dfki_double_pendulum" / f"{name}.parquet" for name in records]
    return import_logs(files, MAPPINGS / "dfki_double_pendulum.toml", "pendulum")


def ankle(data: Path, name: str) -> Study:
    """One minute of one ankle."""
    files = [data / "ankle_impedance" / f"{other}.parquet" for other in ANKLES]
    study = import_logs(files, MAPPINGS / "ankle_impedance.toml", name)
    return only(study, ANKLES[name])


def only(study: Study, *names: str) -> Study:
    """The study with the named trials."""
    return replace(study, trials=tuple(trial for trial in study.trials if trial.name in names))


def leg(data: Path) -> Study:
    """The leg by itself: the measured force is taken out of its torques, so that the trial counts as free."""
    study = import_logs(
        [data / "leg_force_sensor" / "press_cycles.parquet"], MAPPINGS / "leg_force_sensor.toml", "leg"
    )
    (trial,) = study.trials
    log, model = trial.robot, robot_model(study.setup.robot)
    assert log.force is not None
    known = np.isfinite(log.force).all(axis=1) & np.isfinite(log.tau).all(axis=1)
    theta, force = log.theta[known], log.force[known]
    tau = log.tau[known] + np.einsum("kij,ki->kj", model.jacobian(theta), force)
    free = Trial("press_01", "free", "press", RobotLog(log.t[known], theta, tau))
    return replace(study, trials=(free,))


def ur10e(data: Path, joint: int) -> Study:
    """One joint of the arm, moved alone."""
    files = [data / "ur10e" / f"single_joint_{number}.parquet" for number in UR10E_JOINTS]
    study = import_logs(files, MAPPINGS / "ur10e_single_joint.toml", f"joint{joint}")
    return only(study, f"joint{joint}_01")


def records(data: Path) -> list[Record]:
    """Everything that is diagnosed."""
    band = "Band 4.5 Hz."
    return [
        Record("emps", "EMPS, prismatic axis", emps(data), f"{band} Starts at M and Fv alone."),
        Record(
            "pendulum_exciting",
            "Double pendulum, record exciting_061157",
            pendulum(data, ["A0_exciting_061157"]),
            f"{band} Accelerations from the angles.",
        ),
        Record(
            "pendulum_sysid",
            "Double pendulum, five records of system identification",
            pendulum(data, PENDULUM_RECORDS),
            f"{band} The last record is held out whole.",
        ),
        *(
            Record(
                name,
                f"Human ankle, {name}",
                ankle(data, name),
                "Band as wide as the motion. The papers' model is I, B, K.",
            )
            for name in ANKLES
        ),
        Record(
            "leg",
            "Planar leg on a force sensor",
            leg(data),
            f"{band} The sensor's force is taken out of the torques, so what is left is the leg's own: gravity, "
            "friction, drives.",
        ),
        *(
            Record(
                f"ur10e_joint{joint}",
                f"UR10e, joint {joint} alone",
                ur10e(data, joint),
                f"{band} 95 Hz, current times the authors' gain; gravity is not in the model of a single joint.",
            )
            for joint in UR10E_JOINTS
        ),
    ]


def signal_rms(study: Study) -> dict[str, float]:
    """Rms of the logged torque in the band that is reported, on the rows that are judged."""
    model = robot_model(study.setup.robot)
    parts, _ = views(study, model)
    holdout = hold_out(parts)
    squares: list[Floats] = []
    for view in parts:
        trial = aligned(view)
        mask = holdout.mask(view, "validation") & trial.valid
        squares.append(finish(chain_of(view), trial.tau, trial.rate_hz)[mask] ** 2)
    mean = np.mean(np.concatenate(squares), axis=0)
    return {f"tau{k + 1}": float(np.sqrt(value)) for k, value in enumerate(mean)}


def entry_of(record: Record, answer: Diagnosis) -> dict[str, Any]:
    """Stages with their errors, and what was not claimed."""
    signal = signal_rms(record.study)
    stages = []
    for stage in answer.stages:
        added = stage.added
        entry: dict[str, Any] = {
            "model": "papers' model" if added is None else f"{added.effect}@{'+'.join(added.where)}",
            "rms": dict(stage.rms),
            "relative_percent": {k: 100 * v / signal[k] for k, v in stage.rms.items() if k in signal},
            "parameters": {},
            "runner_up": None,
        }
        if added is not None:
            entry["parameters"] = {
                name: {"value": n.value.tolist(), "ci95": n.ci95.tolist(), "unit": n.unit}
                for name, n in added.parameters.items()
            }
            if added.runner_up is not None:
                rival = added.runner_up
                entry["runner_up"] = (
                    f"{rival.effect}@{'+'.join(rival.where)}, {100 * rival.margin:.0f} % less"
                )
        stages.append(entry)
    return {
        "title": record.title,
        "words": record.words,
        "signal_rms": signal,
        "stages": stages,
        "loads": {
            name: {key: n.value.ravel().tolist() for key, n in load.items()}
            for name, load in answer.stages[-1].loads.items()
        },
        "ambiguous": [list(tie.candidates) for tie in answer.ambiguous],
        "structure": [row.words for row in answer.structure],
        "noise_floor": dict(answer.floor),
    }


def halves(study: Study) -> tuple[Study, Study]:
    """The record cut in the middle, as if it were two of one machine."""
    (trial,) = study.trials
    t = trial.robot.t
    middle = 0.5 * (t[0] + t[-1])
    parts = []
    for number, rows in enumerate((t < middle, t >= middle)):
        log = trial.robot
        own = RobotLog(log.t[rows], log.theta[rows], log.tau[rows])
        parts.append(replace(study, trials=(replace(trial, name=f"half_{number + 1:02d}", robot=own),)))
    return parts[0], parts[1]


def carried_over(learned: Study, judged: Study, scratch: Path) -> list[dict[str, Any]]:
    """Error on another record, whole and without any fitting, by the robot and the effects of the first one.

    At each stage robot and effects are those that the first record gives when no further effect is known; the
    last stage goes through the model file, as `fit --model` reads it.
    """
    answer = diagnose(learned)
    save_model(answer, learned, scratch)
    saved = read_model(scratch)
    scratch.unlink()
    case = prepare(learned)
    bench = Bench(case.views, case.base, case.holdout, case.taps, 0.0, None)
    parts, _ = views(judged, case.base.model)
    base = base_of(parts, case.base.model, prior=True)
    named = [s.added for s in answer.stages if s.added is not None and s.added.effect != UNATTRIBUTED]
    rows = []
    for count in range(len(named) + 1):
        chosen: Sequence[Chosen] = [part for finding in named[:count] for part in finding.parts]
        fit = bench.fit(chosen)
        alpha, chosen = bench.stage(fit, None).alpha.value, fit.chosen
        if count == len(named):
            alpha, (chosen, _) = saved.alpha, carried(saved, parts, base)
        error, whole = _errors(parts, cleaned_trials(parts, chosen, base), alpha)
        name = f"{named[count - 1].effect}@{'+'.join(named[count - 1].where)}" if count else "papers' model"
        rows.append(
            {"model": name, "rms": error.tolist(), "relative_percent": (100 * error / whole).tolist()}
        )
    return rows


def _errors(parts: Any, trials: Any, alpha: Floats) -> tuple[Floats, Floats]:
    """Rms of the residual and of the logged torque, (n,), below 4.5 Hz."""
    residual, logged = [], []
    for view, trial in zip(parts, trials, strict=True):
        Y = view.model.regressor(trial.theta, trial.omega, trial.theta_dd)
        left = finish(DEFAULT, trial.tau - Y @ alpha, trial.rate_hz)
        residual.append(left[trial.valid])
        logged.append(finish(DEFAULT, view.tau, trial.rate_hz)[trial.valid])
    rms = [np.sqrt(np.mean(np.concatenate(rows) ** 2, axis=0)) for rows in (residual, logged)]
    return rms[0], rms[1]


def emps_as_published(study: Study, found: Diagnosis) -> list[dict[str, Any]]:
    """The named effects in its authors' own processing (100 Hz, decimated to 100 Hz rows): fit on two thirds.

    Amplitudes are fitted anew in that band; names, and periods and speeds, are those of the diagnosis.
    """
    model = robot_model(study.setup.robot)
    chain = CHAINS["emps"]
    (trial,) = study.trials
    own = align(trial, study.setup, model, chain)
    (view,), _ = views(study, model)
    wide = replace(
        view,
        t=own.elapsed,
        dt=1 / own.rate_hz,
        theta=own.theta,
        omega=own.omega,
        acc=own.theta_dd,
        tau=own.tau,
        x=own.x,
        v=own.v,
        a=own.a,
        J=model.jacobian(own.theta),
        torque_model=own.tau,
        valid=own.valid,
    )
    columns = [model.regressor(own.theta, own.omega, own.theta_dd)]
    rows = []
    fit = own.valid & (own.elapsed < 2 / 3 * own.elapsed[-1] - 1.0)
    held = own.valid & (own.elapsed >= 2 / 3 * own.elapsed[-1])
    target = finish(chain, own.tau, own.rate_hz)[:, 0]
    step = chain.decimate or 1
    for stage in found.stages:
        added = stage.added
        if added is not None and added.effect == UNATTRIBUTED:
            continue
        added_parts = () if added is None else added.parts
        columns += [part.candidate.columns(wide, part.shape)["torque"] for part in added_parts]
        X = finish(chain, np.concatenate(columns, axis=2), own.rate_hz)[:, 0]
        a, b = np.flatnonzero(fit)[::step], np.flatnonzero(held)[::step]
        beta = np.linalg.lstsq(X[a], target[a], rcond=None)[0]
        left = target[b] - X[b] @ beta
        name = "M and Fv" if added is None else f"{added.effect}@{'+'.join(added.where)}"
        rows.append(
            {
                "model": name,
                "relative_percent": float(100 * np.linalg.norm(left) / np.linalg.norm(target[b])),
                "rms_N": float(np.sqrt(np.mean(left**2))),
            }
        )
    return rows


def crossings(data: Path) -> list[tuple[str, Study, Study]]:
    """What is learned on one record and judged on another of the same machine."""
    first, second = halves(emps(data))
    excited = pendulum(data, ["A0_exciting_061157"])
    series = pendulum(data, PENDULUM_RECORDS)
    result = [
        ("EMPS, first half, judged on the second", first, second),
        ("EMPS, second half, judged on the first", second, first),
        ("Double pendulum, exciting_061157, judged on the five others", excited, series),
        ("Double pendulum, the five others, judged on exciting_061157", series, excited),
    ]
    for joint in UR10E_JOINTS:
        one, two = halves(ur10e(data, joint))
        result.append((f"UR10e joint {joint}, first half, judged on the second", one, two))
        result.append((f"UR10e joint {joint}, second half, judged on the first", two, one))
    return result


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    beside = CHECKOUT.parent / "shared" / "data"
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("IMPID_DATA", beside)))
    parser.add_argument("--out", type=Path, default=Path("docs/validation"))
    options = parser.parse_args()
    if not (options.data / "emps").is_dir():
        raise SystemExit(f"measured data not found at {options.data}; set IMPID_DATA (docs/data.md)")
    options.out.mkdir(parents=True, exist_ok=True)
    entries: dict[str, Any] = {}
    result: dict[str, Any] = {"records": entries}
    for record in records(options.data):
        answer = diagnose(record.study)
        entries[record.key] = entry_of(record, answer)
        if record.key == "emps":
            result["emps_as_published"] = emps_as_published(record.study, answer)
    scratch = options.out / "measured_model.json"
    result["carried_over"] = {}
    for title, learned, judged in crossings(options.data):
        result["carried_over"][title] = carried_over(learned, judged, scratch)
    (options.out / "measured.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    (options.out / "measured.md").write_text(page(result), encoding="utf-8")


if __name__ == "__main__":
    main()
