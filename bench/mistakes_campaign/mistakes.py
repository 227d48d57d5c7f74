"""What laboratories get wrong: each row a map from a study in order to the study as it was recorded.

`names` are those that say it. `needs` says in which laboratories anything contradicts it at all.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from impid_host.study.model import RobotLog, Study, Trial

Change = Callable[[Study], Study]
Needs = Callable[[Study], bool]


@dataclass(frozen=True)
class Mistake:
    """One row."""

    name: str
    change: Change
    names: tuple[str, ...]
    needs: Needs = lambda _study: True


def has_force(study: Study) -> bool:
    """A force sensor under load."""
    return any(trial.robot.force is not None for trial in study.trials)


def has_payload(study: Study) -> bool:
    """A weighed payload."""
    return any(trial.payload_kg for trial in study.trials)


def scaled(study: Study) -> bool:
    """Something that knows how large a newton is."""
    return has_force(study) or has_payload(study)


def has_two_loads(study: Study) -> bool:
    """Two loads."""
    return len({trial.load for trial in study.trials if trial.kind != "free"}) > 1


# How channels are changed.


def robot(
    change: Callable[[RobotLog], RobotLog], only: Callable[[Trial, Study], bool] | None = None
) -> Change:
    """The robot's log of every trial, or of some."""

    def apply(study: Study) -> Study:
        return replace(
            study,
            trials=tuple(
                replace(trial, robot=change(trial.robot)) if only is None or only(trial, study) else trial
                for trial in study.trials
            ),
        )

    return apply


def torque(matrix: Any, only: Any = None) -> Change:
    """Torques times a matrix."""
    M = np.asarray(matrix, dtype=float)
    return robot(lambda log: replace(log, tau=log.tau @ M.T), only)


def force(matrix: Any, bias: float = 0.0, only: Any = None) -> Change:
    """Forces times a matrix."""
    M = np.asarray(matrix, dtype=float)
    return robot(lambda log: log if log.force is None else replace(log, force=log.force @ M.T + bias), only)


def angles(change: Callable[[np.ndarray], np.ndarray], only: Any = None) -> Change:
    """The controller's angles."""
    return robot(lambda log: replace(log, theta=change(log.theta)), only)


def device(change: Callable[[Any, Study], Any], only: Any = None) -> Change:
    """The module's samples."""

    def apply(study: Study) -> Study:
        return replace(
            study,
            trials=tuple(
                replace(trial, device=change(trial.device, study))
                if trial.device is not None and (only is None or only(trial, study))
                else trial
                for trial in study.trials
            ),
        )

    return apply


def encoder(**keys: Callable[[tuple[Any, ...]], tuple[Any, ...]]) -> Change:
    """Keys of [encoder]."""
    return lambda study: _in_setup(study, "encoder", keys)


def sensor(**keys: Callable[[Any], Any]) -> Change:
    """Keys of [accelerometer]."""
    return lambda study: _in_setup(study, "accelerometer", keys)


def links(change: Callable[[tuple[float, ...]], tuple[float, ...]]) -> Change:
    """[robot] link_lengths_m."""
    return lambda study: _in_setup(study, "robot", {"link_lengths_m": change})


def _in_setup(study: Study, table: str, keys: dict[str, Any]) -> Study:
    old = getattr(study.setup, table)
    new = replace(old, **{key: change(getattr(old, key)) for key, change in keys.items()})
    return replace(study, setup=replace(study.setup, **{table: new}))


def both(*changes: Change) -> Change:
    """One after the other."""

    def apply(study: Study) -> Study:
        for change in changes:
            study = change(study)
        return study

    return apply


def last_of(kind: str) -> Callable[[Trial, Study], bool]:
    """The last trial that is, or is not, free."""

    def chosen(trial: Trial, study: Study) -> bool:
        same = [one.name for one in study.trials if (one.kind == "free") == (kind == "free")]
        return trial.name == same[-1]

    return chosen


def at(values: tuple[Any, ...], k: int, change: Callable[[Any], Any]) -> tuple[Any, ...]:
    """One entry changed."""
    return tuple(change(value) if i == k else value for i, value in enumerate(values))


def column(k: int, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    """One column changed."""

    def apply(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[:, k] = change(values[:, k])
        return values

    return apply


# The harder ones.


def clipped_torque(share: float) -> Change:
    """A drive or log that saturates at a share of the largest torque of joint 1 in the study."""

    def apply(study: Study) -> Study:
        limit = share * max(float(np.abs(trial.robot.tau[:, 0]).max()) for trial in study.trials)
        return robot(lambda log: replace(log, tau=column(0, lambda t: np.clip(t, -limit, limit))(log.tau)))(
            study
        )

    return apply


def clipped_accelerometer(limit_g: float, axes: tuple[str, ...], one_sided: bool = False) -> Change:
    """Flat tops in codes, away from the converter's ends."""

    def change(samples: Any, study: Study) -> Any:
        a = study.setup.accelerometer
        new = {}
        for k, name in (("ax", "ax"), ("ay", "ay")):
            axis = 0 if k == "ax" else 1
            zero = a.zero_g_V[axis] / a.vref_V * a.full_scale_code
            reach = a.sensitivity_V_per_g[axis] * limit_g / a.vref_V * a.full_scale_code
            low = 0 if one_sided else zero - reach
            if name in axes:
                codes = np.clip(getattr(samples, name).astype(float), low, zero + reach)
                new[name] = np.round(codes).astype(np.uint16)
        return replace(samples, **new)

    return device(change)


def wraps16(samples: Any, _study: Study) -> Any:
    """A counter of 16 bits."""
    counts = (samples.enc1.astype(np.int64) + 2**15) % 2**16 - 2**15
    return replace(samples, enc1=counts.astype(np.int32))


def stuck_encoder(samples: Any, _study: Study) -> Any:
    """A plug that came off."""
    return replace(samples, enc2=np.full_like(samples.enc2, samples.enc2[0]))


def constant(*names: str) -> Callable[[Any, Study], Any]:
    """Channels of the module that stand still but for the last digit."""

    def change(samples: Any, _study: Study) -> Any:
        rng = np.random.default_rng(1)
        flat = {name: (32000 + rng.integers(-1, 2, len(samples))).astype(np.uint16) for name in names}
        return replace(samples, **flat)

    return change


def relative_counts(samples: Any, study: Study) -> Any:
    """The second encoder sits between the links."""
    e = study.setup.encoder
    per = [d * 2 * np.pi / n for d, n in zip(e.direction, e.counts_per_rev, strict=True)]
    theta1 = e.zero_rad[0] + per[0] * samples.enc1.astype(float)
    theta2 = e.zero_rad[1] + per[1] * samples.enc2.astype(float)
    return replace(samples, enc2=np.round((theta2 - theta1 - e.zero_rad[1]) / per[1]).astype(np.int32))


def turned_force(angle: float) -> Change:
    """Axes of the sensor turned against x and y."""
    c, s = np.cos(angle), np.sin(angle)
    return force([[c, s], [-s, c]])


def force_on_link(log: RobotLog) -> RobotLog:
    """Axes that turn with the end-effector."""
    if log.force is None:
        return log
    c, s = np.cos(log.theta[:, 1]), np.sin(log.theta[:, 1])
    fx, fy = log.force.T
    return replace(log, force=np.stack([c * fx + s * fy, -s * fx + c * fy], axis=1))


def relabelled(from_free: bool) -> Change:
    """The last free trial among the loads, or the last loaded one among the free."""

    def apply(study: Study) -> Study:
        source = next(t for t in reversed(study.trials) if (t.kind == "free") == from_free)
        other = next(t for t in study.trials if (t.kind == "free") != from_free)
        new = replace(source, kind=other.kind, load=other.load, payload_kg=other.payload_kg)
        return replace(study, trials=tuple(new if t is source else t for t in study.trials))

    return apply


def another_load(study: Study) -> Study:
    """The last trial says it has the first load."""
    first = next(t for t in study.trials if t.kind != "free")
    last = study.trials[-1]
    new = replace(last, load=first.load, payload_kg=first.payload_kg)
    return replace(study, trials=(*study.trials[:-1], new))


def repeated(study: Study) -> Study:
    """The same recording under two names."""
    first = next(t for t in study.trials if t.kind != "free")
    again = replace(first, name=f"{first.load}_09")
    return replace(study, trials=(*study.trials, again))


def reweighed(factor: float) -> Change:
    """payload_kg in another unit, or wrong."""

    def apply(study: Study) -> Study:
        return replace(
            study,
            trials=tuple(
                replace(t, payload_kg=t.payload_kg * factor) if t.payload_kg else t for t in study.trials
            ),
        )

    return apply


def jumps(log: RobotLog) -> RobotLog:
    """The controller's clock was set while it logged."""
    t = log.t.copy()
    t[len(t) // 2 :] += 3600.0
    return replace(log, t=t)


def exchanged_modules(study: Study) -> Study:
    """device.csv of the first two trials went to the wrong folders."""
    a, b, *rest = study.trials
    return replace(study, trials=(replace(a, device=b.device), replace(b, device=a.device), *rest))


def without_module(study: Study) -> Study:
    """A study by the robot alone."""
    return replace(study, trials=tuple(replace(t, device=None) for t in study.trials))


_SIGN1, _SIGN2 = [[-1, 0], [0, 1]], [[1, 0], [0, -1]]
_SWAP = [[0, 1], [1, 0]]
_I = np.eye(2)
_LAST_LOAD, _LAST_FREE = last_of("load"), last_of("free")
_ACCEL = ("accel.axes", "accel.mount")
_DEG = 180 / np.pi

MISTAKES: tuple[Mistake, ...] = (
    Mistake("both torques' signs", torque(-_I), ("torque.sign",)),
    Mistake("tau1's sign", torque(_SIGN1), ("torque.sign",)),
    Mistake("tau2's sign", torque(_SIGN2), ("torque.sign",)),
    Mistake("torques in mN m", torque(1000 * _I), ("torque.unit",)),
    Mistake("torques in kN m", torque(0.001 * _I), ("torque.unit",)),
    Mistake("torques in kgf m", torque(_I / 9.80665), ("torque.unit",), scaled),
    Mistake("torques in N cm", torque(100 * _I), ("torque.unit",), scaled),
    Mistake("torques in A, 0.35 N m/A", torque(_I / 0.35), ("torque.unit",), scaled),
    Mistake("torques before a gear of 50", torque(_I / 50), ("torque.unit",), scaled),
    Mistake("tau1 twice too large", torque(np.diag([2.0, 1.0])), ("torque.unit",)),
    Mistake("tau2 in mN m", torque(np.diag([1.0, 1000.0])), ("torque.unit",)),
    Mistake("tau2 half, and of the other sign", torque(np.diag([1.0, -0.5])), ("torque.unit", "torque.sign")),
    Mistake("torques swapped", torque(_SWAP), ("torque.swapped",)),
    Mistake("torques swapped and turned", torque([[0, -1], [-1, 0]]), ("torque.swapped", "torque.sign")),
    Mistake("torques of relative joints", torque([[1, 1], [0, 1]]), ("torque.frame",)),
    Mistake("tau1 clipped at 60 %", clipped_torque(0.6), ("torque.clipped",)),
    Mistake("signs in one loaded trial", torque(-_I, _LAST_LOAD), ("torque.sign",)),
    Mistake("tau1's sign in one free trial", torque(_SIGN1, _LAST_FREE), ("torque.sign",)),
    Mistake("torques swapped in one trial", torque(_SWAP, _LAST_LOAD), ("torque.swapped",)),
    Mistake("torques in mN m in one trial", torque(1000 * _I, _LAST_LOAD), ("torque.unit",)),
    Mistake("counts without x4", encoder(counts_per_rev=lambda c: tuple(x / 4 for x in c)), ("angle.scale",)),
    Mistake(
        "counts of joint 2 doubled",
        encoder(counts_per_rev=lambda c: at(c, 1, lambda x: 2 * x)),
        ("angle.scale",),
    ),
    Mistake(
        "counts of joint 1 10 % off",
        encoder(counts_per_rev=lambda c: at(c, 0, lambda x: 1.1 * x)),
        ("angle.scale",),
    ),
    Mistake("encoder 1 backwards", encoder(direction=lambda d: at(d, 0, lambda x: -x)), ("angle.sign",)),
    Mistake("encoder 2 backwards", encoder(direction=lambda d: at(d, 1, lambda x: -x)), ("angle.sign",)),
    Mistake("both encoders backwards", encoder(direction=lambda d: tuple(-x for x in d)), ("angle.sign",)),
    Mistake(
        "encoders swapped",
        device(lambda s, _study: replace(s, enc1=s.enc2, enc2=s.enc1)),
        ("angle.swapped",),
    ),
    Mistake(
        "zero of joint 1 off by 0.2", encoder(zero_rad=lambda z: at(z, 0, lambda x: x + 0.2)), ("angle.zero",)
    ),
    Mistake(
        "zero of joint 2 off by 0.3", encoder(zero_rad=lambda z: at(z, 1, lambda x: x - 0.3)), ("angle.zero",)
    ),
    Mistake("both zeros off", encoder(zero_rad=lambda z: (z[0] + 0.15, z[1] + 0.25)), ("angle.zero",)),
    Mistake("controller in degrees", angles(lambda a: a * _DEG), ("angle.unit",)),
    Mistake("controller's theta1 in degrees", angles(column(0, lambda a: a * _DEG)), ("angle.unit",)),
    Mistake("controller's theta1 turned", angles(column(0, lambda a: -a)), ("angle.sign",)),
    Mistake("controller's angles swapped", angles(lambda a: a[:, ::-1].copy()), ("angle.swapped",)),
    Mistake(
        "controller logs relative angles",
        angles(lambda a: np.stack([a[:, 0], a[:, 1] - a[:, 0]], axis=1)),
        ("angle.frame",),
    ),
    Mistake("module counts relative angles", device(relative_counts), ("angle.frame",)),
    Mistake(
        "relative angles everywhere",
        both(device(relative_counts), angles(lambda a: np.stack([a[:, 0], a[:, 1] - a[:, 0]], axis=1))),
        ("angle.frame",),
    ),
    Mistake(
        "degrees, no module", both(without_module, angles(lambda a: a * _DEG)), ("angle.unit", "torque.unit")
    ),
    Mistake("encoder 1 wraps at 16 bits", device(wraps16), ("angle.wrap",)),
    Mistake("encoder 2 came off", device(stuck_encoder, _LAST_LOAD), ("angle.resting",)),
    Mistake(
        "accelerometer's axes swapped",
        device(lambda s, _study: replace(s, ax=s.ay, ay=s.ax)),
        _ACCEL,
    ),
    Mistake("first axis mirrored", sensor(sensitivity_V_per_g=lambda s: at(s, 0, lambda x: -x)), _ACCEL),
    Mistake("second axis mirrored", sensor(sensitivity_V_per_g=lambda s: at(s, 1, lambda x: -x)), _ACCEL),
    Mistake("mount off by 90 degrees", sensor(mount_angle_rad=lambda a: a + np.pi / 2), _ACCEL),
    Mistake("mount off by 180 degrees", sensor(mount_angle_rad=lambda a: a + np.pi), _ACCEL),
    Mistake("mount off by -90 degrees", sensor(mount_angle_rad=lambda a: a - np.pi / 2), _ACCEL),
    Mistake("mount off by 0.4 rad", sensor(mount_angle_rad=lambda a: a + 0.4), _ACCEL),
    Mistake("mount in degrees", sensor(mount_angle_rad=lambda a: a * _DEG), _ACCEL),
    Mistake("mounted on link 2, said to be fixed", sensor(mount=lambda _m: "fixed"), _ACCEL),
    Mistake("vref 5 for 3.3", sensor(vref_V=lambda _v: 5.0), ("accel.unit",)),
    Mistake("vref in mV", sensor(vref_V=lambda v: 1000 * v), ("accel.unit",)),
    Mistake("sensitivity 1000 for 620", sensor(sensitivity_V_per_g=lambda _s: (1.0, 1.0)), ("accel.unit",)),
    Mistake(
        "sensitivity in mV", sensor(sensitivity_V_per_g=lambda s: tuple(1000 * x for x in s)), ("accel.unit",)
    ),
    Mistake("12 bits for 16", sensor(full_scale_code=lambda _c: 4096), ("accel.unit",)),
    Mistake(
        "zero_g of another supply", sensor(zero_g_V=lambda z: tuple(x - 0.4 for x in z)), ("accel.unit",)
    ),
    Mistake(
        "sensitivity per m/s^2",
        sensor(sensitivity_V_per_g=lambda s: tuple(x / 9.80665 for x in s)),
        ("accel.unit",),
    ),
    Mistake("accelerometer clipped", clipped_accelerometer(0.1, ("ax", "ay")), ("accel.clipped",)),
    Mistake("first axis clipped on one side", clipped_accelerometer(0.08, ("ax",), True), ("accel.clipped",)),
    Mistake("first axis dead", device(constant("ax")), ("accel.dead",)),
    Mistake("accelerometer dead", device(constant("ax", "ay")), ("accel.dead",)),
    Mistake("links swapped", links(lambda own: own[::-1]), ("links.swapped",)),
    Mistake(
        "links 10 % long", links(lambda own: tuple(1.1 * x for x in own)), ("links.length", "accel.unit")
    ),
    Mistake("links in mm", links(lambda own: tuple(1000 * x for x in own)), ("links.unit",)),
    Mistake("links in cm", links(lambda own: tuple(100 * x for x in own)), ("links.unit", "accel.unit")),
    Mistake(
        "links in inches", links(lambda own: tuple(x / 0.0254 for x in own)), ("links.unit", "accel.unit")
    ),
    Mistake("link 1 20 % long", links(lambda own: (1.2 * own[0], own[1])), ("links.length",)),
    Mistake("link 2 12 % short", links(lambda own: (own[0], 0.88 * own[1])), ("links.length",)),
    Mistake("force of the robot on the load", force(-_I), ("force.sign",), has_force),
    Mistake("fx's sign", force(_SIGN1), ("force.sign",), has_force),
    Mistake("fy's sign", force(_SIGN2), ("force.sign",), has_force),
    Mistake("force in kgf", force(_I / 9.80665), ("force.unit",), has_force),
    Mistake("force in pounds", force(_I / 4.4482216), ("force.unit",), has_force),
    Mistake("force in mN", force(1000 * _I), ("force.unit",), has_force),
    Mistake("fx twice too large", force(np.diag([2.0, 1.0])), ("force.unit",), has_force),
    Mistake("force sensor on the end-effector", robot(force_on_link), ("force.frame",), has_force),
    Mistake("fx and fy swapped", force(_SWAP), ("force.frame",), has_force),
    Mistake("force sensor turned by 90 degrees", turned_force(np.pi / 2), ("force.frame",), has_force),
    Mistake("force sensor turned by 0.5 rad", turned_force(0.5), ("force.frame",), has_force),
    Mistake("force sensor not zeroed", force(_I, 8.0), ("force.bias",), has_force),
    Mistake("force's sign in one trial", force(-_I, only=_LAST_LOAD), ("force.sign",), has_force),
    Mistake("a free trial among the loads", relabelled(True), ("trial.kind",)),
    Mistake("a load among the free trials", relabelled(False), ("trial.kind",)),
    Mistake("another load's name", another_load, ("trial.load",), has_two_loads),
    Mistake("a trial twice", repeated, ("trial.repeated",)),
    Mistake("payload in g", reweighed(1000.0), ("trial.load",), has_payload),
    Mistake("payload without its carrier", reweighed(0.7), ("trial.load",), has_payload),
    Mistake("robot's clock in ms", robot(lambda log: replace(log, t=1000 * log.t)), ("time.unit",)),
    Mistake("robot's rate said to be twice", robot(lambda log: replace(log, t=log.t / 2)), ("time.rate",)),
    Mistake("robot's clock jumps an hour", robot(jumps), ("time.jump",)),
    Mistake("device.csv of another trial", exchanged_modules, ("clocks.disagree",)),
    Mistake(
        "two mistakes: tau1's sign, mount by 90 degrees",
        both(torque(_SIGN1), sensor(mount_angle_rad=lambda a: a + np.pi / 2)),
        ("torque.sign",),
    ),
)
