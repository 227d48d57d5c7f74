"""Known causes put into measured records, and what the diagnosis says of them (docs/validation/planted_plan.md).

    python scripts/validate/planted.py [--data ../shared/data] [--out docs/validation] [--records N] [--minutes M]

Runs go to planted.json one by one, so that a stopped campaign goes on where it was; the page planted.md is written
from all that are there. Stronger plants come first, then weaker ones, each over all records.
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.diagnosis.base import Base
from impid_host.diagnosis.case import prepare
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.holdout import FIT, SEALED
from impid_host.diagnosis.prepare import views
from impid_host.diagnosis.proof import chain_of
from impid_host.diagnosis.result import UNATTRIBUTED, Diagnosis, Number, Stage
from impid_host.effects.view import View
from impid_host.errors import UndeterminedError
from impid_host.impedance.rows import finish
from impid_host.robot.model import robot_model
from impid_host.signals.arrays import Floats
from impid_host.signals.direction import sign_mean
from impid_host.signals.filters import ZeroPhaseLowPass
from impid_host.study.model import RobotLog, Study
from measured_records import BY_KEY, data_folder
from planted_page import page

RECORDS = (
    "ur10e_joint4",
    "ur10e_joint6",
    "ur10e_joint1",
    "ur10e_joint3",
    "leg",
    "pendubot_position",
    "pendulum_pd",
    "pendubot_harmonic",
    "pendulum_exciting",
    "emps",
    "z_df2",
    "z_df",
    "pendulum_sysid",
    "lwr4_1",
)
STRENGTHS = (2.0, 1.0, 0.5)
IN_SPAN = 0.02
_SPEED_HZ = 20.0


@dataclass(frozen=True, slots=True)
class Motion:
    """A joint's measured motion: angle q, its median q0 and range; speed w below 20 Hz and its 95th percentile."""

    t: Floats
    q: Floats
    w: Floats
    sign: Floats
    q0: float
    span: float
    fast: float


@dataclass(frozen=True, slots=True)
class Plant:
    """A change of one joint's log: `torque` adds to it, per unit; `change` does something else.

    Attributes:
        several: only for robots of two joints or more; gravity: only where there is some.
        unit: the change by which its torque is found, in units of s; most: what nobody would overlook.
    """

    name: str
    expected: str
    torque: Callable[[Motion], Floats] | None = None
    change: Callable[[RobotLog, int, Motion, float], RobotLog] | None = None
    several: bool = False
    gravity: bool = False
    single: bool = False
    unit: float = 1.0
    most: float = np.inf

    def put(self, log: RobotLog, joint: int, s: float) -> RobotLog:
        """The log with the plant in it."""
        motion = _motion(log, joint)
        if self.change is not None:
            return self.change(log, joint, motion, s)
        assert self.torque is not None
        tau = log.tau.copy()
        tau[:, joint] += s * self.torque(motion)
        return replace(log, tau=tau)


def _late(log: RobotLog, joint: int, _motion: Motion, s: float) -> RobotLog:
    tau = log.tau.copy()
    tau[:, joint] = np.interp(log.t - s, log.t, log.tau[:, joint])
    return replace(log, tau=tau)


def _weaker(log: RobotLog, joint: int, _motion: Motion, s: float) -> RobotLog:
    tau = log.tau.copy()
    tau[:, joint] *= 1 - s
    return replace(log, tau=tau)


def _zero(log: RobotLog, joint: int, _motion: Motion, s: float) -> RobotLog:
    theta = log.theta.copy()
    theta[:, joint] += s
    return replace(log, theta=theta)


def _turn(log: RobotLog, joint: int, motion: Motion, s: float) -> RobotLog:
    theta = log.theta.copy()
    theta[:, joint] += s * np.sin(2 * np.pi * 3 * motion.q / motion.span)
    return replace(log, theta=theta)


PLANTS = (
    Plant("late", "actuator.delay", change=_late, unit=1e-3, most=0.02),
    Plant("gain", "actuator.gain", change=_weaker, several=True, unit=1e-2, most=0.3),
    Plant("spring", "elastic.joint", lambda m: m.q - m.q0),
    Plant("dry", "friction.coulomb", lambda m: m.sign),
    Plant("unequal", "friction.asymmetric", lambda m: np.maximum(m.sign, 0.0)),
    Plant("stribeck", "friction.stribeck", lambda m: m.sign * np.exp(-((m.w / (0.15 * m.fast)) ** 2))),
    Plant("drag", "friction.quadratic", lambda m: m.w * np.abs(m.w)),
    Plant("ripple", "actuator.cogging", lambda m: np.sin(2 * np.pi * 6 * m.q / m.span)),
    Plant("uneven", "friction.position", lambda m: np.sin(2 * np.pi * m.q / m.span) * m.sign),
    Plant("zero", "encoder.zero", change=_zero, several=True, gravity=True, unit=1e-3, most=0.1),
    Plant("turn", "encoder.eccentricity", change=_turn, unit=1e-3, most=0.05),
    Plant("payload", "gravity.link", lambda m: np.sin(m.q), single=True),
)


def _motion(log: RobotLog, joint: int) -> Motion:
    step = float(np.median(np.diff(log.t)))
    q = log.theta[:, joint]
    low = ZeroPhaseLowPass(order=4, cutoff_hz=min(_SPEED_HZ, 0.2 / step)).apply(q, 1 / step)
    w = np.gradient(low, log.t)
    sign = sign_mean(w, np.gradient(w, log.t), step)
    return Motion(
        log.t, q, w, sign, float(np.median(q)), float(np.ptp(q)), float(np.percentile(np.abs(w), 95))
    )


def suits(plant: Plant, study: Study) -> bool:
    """Whether the plant makes sense on this machine."""
    model = robot_model(study.setup.robot)
    if plant.gravity and not model.has_gravity:
        return False
    if plant.single:
        return model.joints == 1 and model.task_is_rotary and study.setup.robot.baseline == "textbook"
    return model.joints > 1 or not plant.several


def joint_of(study: Study) -> int:
    """The last joint that moves and has a drive."""
    log = study.trials[0].robot
    alive = [k for k in range(log.theta.shape[1]) if np.ptp(log.theta[:, k]) > 1e-3 and log.tau[:, k].any()]
    return alive[-1]


def planted(study: Study, plant: Plant, s: float) -> Study:
    """The study with the plant in every trial."""
    joint = joint_of(study)
    return replace(study, trials=tuple(replace(t, robot=plant.put(t.robot, joint, s)) for t in study.trials))


@dataclass(frozen=True, slots=True)
class Level:
    """The first model on a record: its columns and value, and what it leaves on held-out rows of one joint."""

    base: Base
    value: Floats
    rms: float


def _rows(view: View, base: Base, joint: int) -> tuple[Floats, Floats]:
    """Columns of the first model (N, b) and torque (N,) of a joint, in the band that is judged."""
    chain = chain_of(view)
    columns = finish(chain, base.columns(view)["torque"][:, joint], view.rate_hz)
    return columns, finish(chain, view.tau[:, joint], view.rate_hz)


def level_of(study: Study) -> Level:
    """The first model by plain least squares on the fit part, all joints alike."""
    case, joint = prepare(study), joint_of(study)
    parts, base, holdout = case.views, case.base, case.holdout
    rows = [[_rows(view, base, k) for k in range(view.joints)] for view in parts]
    masks = [holdout.mask(view, FIT) for view in parts]
    A = np.concatenate([own[0][m] for each, m in zip(rows, masks, strict=True) for own in each])
    y = np.concatenate([own[1][m] for each, m in zip(rows, masks, strict=True) for own in each])
    size = np.linalg.norm(A, axis=0) + 1e-300
    value = np.linalg.lstsq(A / size, y, rcond=1e-8)[0] / size
    left = [
        (each[joint][1] - each[joint][0] @ value)[holdout.mask(view, SEALED)]
        for view, each in zip(parts, rows, strict=True)
    ]
    return Level(base, value, float(np.sqrt(np.mean(np.concatenate(left) ** 2))))


def unit_of(study: Study, plant: Plant, level: Level) -> tuple[float, bool]:
    """Rms of what one unit of the plant adds to the residual, and whether the first model holds it."""
    model, joint = robot_model(study.setup.robot), joint_of(study)
    pairs = zip(views(study, model)[0], views(planted(study, plant, plant.unit), model)[0], strict=True)
    columns, added = [], []
    for plain, changed in pairs:
        A, y = _rows(plain, level.base, joint)
        A1, y1 = _rows(changed, level.base, joint)
        n = min(len(y), len(y1))
        rows = plain.valid[:n] & changed.valid[:n]
        columns.append(A[:n][rows])
        added.append((((y1 - A1 @ level.value)[:n] - (y - A @ level.value)[:n]) / plant.unit)[rows])
    A, p = np.concatenate(columns), np.concatenate(added)
    size = np.linalg.norm(A, axis=0) + 1e-300
    left = p - A / size @ np.linalg.lstsq(A / size, p, rcond=1e-8)[0]
    held = float(left @ left) < IN_SPAN * float(p @ p)
    return float(np.sqrt(np.mean((p if held else left) ** 2))), held


def labels(answer: Diagnosis) -> set[str]:
    """Names of all stages."""
    found = [stage.added for stage in answer.stages if stage.added is not None]
    return {f"{own.effect}@{place}" for own in found if own.effect != UNATTRIBUTED for place in own.where}


def ties(answer: Diagnosis) -> list[frozenset[str]]:
    """Candidates of all ties."""
    return [frozenset(tie.candidates) for tie in answer.ambiguous]


def verdict(before: Diagnosis, after: Diagnosis, expected: str | None) -> str:
    """The plan's word for the difference; `expected` is a label, or None where no name is right."""
    new = labels(after) - labels(before)
    opened = [tie for tie in ties(after) if tie not in ties(before)]
    if expected is None:
        return "wrong" if new else "silent"
    tied = set().union(*(tie for tie in opened if expected in tie)) if opened else set()
    if new - tied - {expected}:
        return "wrong"
    if expected in new:
        return "right"
    if expected in tied:
        return "tie"
    if expected in labels(before) and not new:
        return "there before"
    return "missed"


def _numbers(stage: Stage) -> dict[str, Number]:
    loads = {f"{name} {key}": number for name, load in stage.loads.items() for key, number in load.items()}
    return {"alpha": stage.alpha} | loads


def undone(before: Stage, after: Stage, last: Stage) -> tuple[int, int]:
    """How many entries of `after` agree with `before` within both intervals (those of `last`), and of how many."""
    agree = total = 0
    here, there, wide = _numbers(before), _numbers(after), _numbers(last)
    for name, number in here.items():
        if name not in there or there[name].value.shape != number.value.shape:
            continue
        allowed = np.hypot(number.half, wide[name].half if name in wide else number.half)
        same = np.abs(there[name].value - number.value) <= allowed + 1e-12
        agree, total = agree + int(same.sum()), total + same.size
    return agree, total


def one_run(study: Study, plant: Plant, strength: float, level: Level, before: Diagnosis) -> dict[str, Any]:
    """A plant of one strength in one record, with the verdict."""
    unit, held = unit_of(study, plant, level)
    s = min(strength * level.rms / unit, plant.most)
    head = {
        "record": study.name,
        "plant": plant.name,
        "strength": strength,
        "s": s,
        "capped": s == plant.most,
        "in_span": held,
    }
    expected = None if held else f"{plant.expected}@joint{joint_of(study) + 1}"
    try:
        after = diagnose(planted(study, plant, s))
    except UndeterminedError as error:
        return head | {"expected": expected, "verdict": "refused", "words": str(error)}
    agree, total = undone(before.stages[-1], after.stages[-1], after.stages[-1])
    plain, _ = undone(before.stages[0], after.stages[0], after.stages[0])
    return head | {
        "expected": expected,
        "verdict": verdict(before, after, expected),
        "new": sorted(labels(after) - labels(before)),
        "before": sorted(labels(before)),
        "ties": [sorted(tie) for tie in ties(after) if tie not in ties(before)],
        "undone": [agree, total],
        "without_diagnosis": [plain, total],
    }


def campaign(
    data: Path, keys: Sequence[str], done: list[dict[str, Any]], save: Callable[[], None], until: float
) -> None:
    """All runs that are not there yet, strongest first, as long as there is time."""
    had = {(run["record"], run["plant"], run["strength"]) for run in done}
    befores: dict[str, Diagnosis] = {}
    for strength in STRENGTHS:
        for key in keys:
            study = BY_KEY[key].study(data)
            for plant in PLANTS:
                if not suits(plant, study) or (key, plant.name, strength) in had:
                    continue
                if time.monotonic() > until:
                    return
                if key not in befores:
                    befores[key] = diagnose(study)
                done.append(one_run(study, plant, strength, level_of(study), befores[key]))
                save()


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path)
    parser.add_argument("--out", type=Path, default=Path("docs/validation"))
    parser.add_argument("--records", type=int, default=len(RECORDS), help="How many of the plan's records.")
    parser.add_argument("--minutes", type=float, default=np.inf, help="Begin no run after so long.")
    options = parser.parse_args()
    store = options.out / "planted.json"
    done: list[dict[str, Any]] = json.loads(store.read_text())["runs"] if store.is_file() else []

    def save() -> None:
        store.write_text(json.dumps({"runs": done}, indent=1) + "\n", encoding="utf-8")
        planned = [(key, plant.name) for key in RECORDS for plant in PLANTS]
        (options.out / "planted.md").write_text(page(done, planned, STRENGTHS), encoding="utf-8")

    data = data_folder(options.data)
    campaign(data, RECORDS[: options.records], done, save, time.monotonic() + 60 * options.minutes)
    save()


if __name__ == "__main__":
    main()
