"""How a laboratory's study is changed into one with a mistake: channels, keys of the setup, labels, clocks."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from impid_host.study.model import RobotLog, Study, Trial

Change = Callable[[Study], Study]


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
        assert a is not None, "no accelerometer to clip"
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
    assert e is not None, "no encoders"
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


def without_sign(log: RobotLog) -> RobotLog:
    """An amplifier, or an unsigned column, that gives the size of a torque alone."""
    return replace(log, tau=np.abs(log.tau))


def sampled_late(rows: int) -> Callable[[RobotLog], RobotLog]:
    """Forces that come some rows after the torques."""
    return lambda log: log if log.force is None else replace(log, force=np.roll(log.force, rows, axis=0))


def constant_torque(log: RobotLog) -> RobotLog:
    """A column that was never filled."""
    return replace(log, tau=column(1, lambda t: np.full_like(t, 0.1))(log.tau))


def half_stuck(samples: Any, _study: Study) -> Any:
    """A plug that came off in the middle."""
    counts = samples.enc1.copy()
    counts[len(counts) // 2 :] = counts[len(counts) // 2]
    return replace(samples, enc1=counts)


def other_model(name: str) -> Change:
    """[robot] model of the other planar robot."""
    return lambda study: _in_setup(study, "robot", {"model": lambda _old: name})


def module_in_ms(samples: Any, _study: Study) -> Any:
    """Stamps in ms where microseconds are meant."""
    return replace(samples, t_us=samples.t_us // 1000)
