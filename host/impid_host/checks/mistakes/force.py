"""What goes wrong with the force sensor, read off its map against the force that the torques say."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from impid_host.checks.axes import AxisMap, axis_map, corrected
from impid_host.checks.check import Change
from impid_host.checks.equations import Motions, low, turned
from impid_host.checks.joint_fit import JointFit, fit_jointly
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Frame, Signals

FRAMES: tuple[Frame, ...] = ("base", "link2")
_LOG = "robot.csv, or the mapping it is imported by"


def has_force(study: Signals) -> bool:
    """Whether forces were measured under load."""
    return study.planar and any(trial.force is not None and trial.kind != "free" for trial in study.trials)


def by_torques(study: Signals, motions: Motions) -> JointFit | None:
    """The study without its force sensor and payloads, where free trials or a prior say what the robot is."""
    if not any(trial.kind == "free" for trial in study.trials) and study.prior is None:
        return None
    bare = tuple(replace(trial, force=None, payload_kg=None) for trial in study.trials)
    return fit_jointly(study.with_trials(bare), motions)


def force_map(study: Signals, motions: Motions, robot: JointFit, frame: Frame) -> AxisMap | None:
    """How the sensor's readings lie to the loads' forces by the torques, its axes in that frame."""
    reading, expected = [], []
    for trial in study.trials:
        if trial.force is None or trial.kind == "free" or trial.load not in robot.loads:
            continue
        motion = motions.of(trial, study)
        along = -(motion.task[trial.kind] @ robot.loads[trial.load])
        # The angle of the tip changes slowly against the filter.
        angle = study.force_angle + (low(motion.tip[:, None])[:, 0] if frame == "link2" else 0.0)
        reading.append(low(trial.force))
        expected.append(turned(along, -angle))
    return axis_map(np.concatenate(reading), np.concatenate(expected)) if reading else None


def hypotheses(study: Signals, motions: Motions) -> Iterator[Hypothesis]:
    """Another sign, unit or frame of the sensor."""
    robot = by_torques(study, motions) if has_force(study) else None
    if robot is None:
        return
    for frame in FRAMES:
        found = force_map(study, motions, robot, frame)
        if found is not None and found.is_map and (found.off or frame != study.force_frame):
            yield _mistake(study, frame, found)


def _mistake(study: Signals, frame: Frame, found: AxisMap) -> Hypothesis:
    angle = float(np.remainder(study.force_angle + found.turn + np.pi, 2 * np.pi) - np.pi)
    half, still = abs(abs(found.turn) - np.pi) < 1e-6, found.turn == 0
    words, scales = [], [1.0 if gain is None else gain.value for gain in found.gains]
    what, where, remedy = "force.unit", "sensor", []
    changes: list[Change] = []
    signs = [1.0, 1.0]
    if frame != study.force_frame:
        what = "force.frame"
        words.append(
            "its axes turn with the end-effector" if frame == "link2" else "its axes stay along x and y"
        )
        changes.append(Change("force_sensor", "frame", frame))
    if found.mirrored and (half or still):
        axis = 0 if half else 1
        signs[axis] = -1.0
        if what == "force.unit":
            what, where = "force.sign", "xy"[axis]
        words.append(f"f{'xy'[axis]} has the other sign")
    elif half and not found.mirrored:
        signs = [-1.0, -1.0]
        if what == "force.unit":
            what = "force.sign"
        words.append("it gives the force of the robot on the load")
    elif found.mirrored:
        what = "force.frame"
        words.append("fx and fy are swapped")
        sign = "" if found.turn > 0 else "-"
        remedy.append(f'{_LOG}: fx = {{ expression = "{sign}fy" }}, fy = {{ expression = "{sign}fx" }}')
    elif not still:
        what = "force.frame"
        words.append(f"its axes are turned by {np.rad2deg(found.turn):.0f} degrees")
        changes.append(Change("force_sensor", "mount_angle_rad", round(angle, 4)))
    for gain, name in zip(found.gains, "xy", strict=True):
        if gain is not None:
            words.append(f"f{name} is {gain.words} times too large")
    if scales != [1.0, 1.0] or signs != [1.0, 1.0]:
        pairs = zip("xy", signs, scales, strict=True)
        remedy.append(
            f"{_LOG}: " + "; ".join(f'f{n} = {{ column = "...", scale = {s / k:.6g} }}' for n, s, k in pairs)
        )
    if changes:
        keys = ", ".join(f"{c.key} = {_toml(c.value)}" for c in changes)
        remedy.append(f"setup.toml: [force_sensor] {keys}")

    def mend(signals: Signals) -> Signals:
        mended = signals.mapped(force=lambda values: corrected(values, found))
        return replace(mended, force_frame=frame)

    return Hypothesis(
        what,
        where,
        "the force sensor is not as declared: " + "; ".join(words),
        mend,
        "; ".join(remedy),
        tuple(changes),
        odds=0.0 if frame == study.force_frame else 0.5,
        one_trial=frame == study.force_frame,
    )


def _toml(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)
