"""Residuals of the first and the last stage along the motion, to be drawn and looked at."""

from collections.abc import Sequence

import numpy as np

from impid_host.diagnosis.holdout import SEALED, Holdout
from impid_host.diagnosis.proof import StageFit, channel, fitted
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Trace
from impid_host.diagnosis.stages import Bench
from impid_host.effects.view import View
from impid_host.impedance.rows import SERIES_RATE_HZ, Equation, series
from impid_host.signals.arrays import Floats


def traces(bench: Bench, first: Refit, last: Refit) -> tuple[Trace, ...]:
    """Of every trial and channel: tau1, tau2 in free motion, fx, fy under load."""
    before, after = (
        fitted(fit.views, fit.chosen, bench.case.base, bench.case.holdout, bench.prior)
        for fit in (first, last)
    )
    result: list[Trace] = []
    for (view, one), (_, other) in zip(before.free, after.free, strict=True):
        pair = [(one, before.robot.value), (other, after.robot.value)]
        result += [
            _trace(f"tau{joint + 1}", view, pair, joint, bench.case.holdout, _joint(view, joint))
            for joint in range(view.joints)
        ]
    for name, _ in bench.case.base.loads:
        result += _of_load(name, before, after, bench)
    return tuple(result)


def _of_load(name: str, before: StageFit, after: StageFit, bench: Bench) -> list[Trace]:
    result: list[Trace] = []
    for (view, one), (_, other) in zip(before.virtual[name], after.virtual[name], strict=True):
        pair = [(one, before.loads[name].value), (other, after.loads[name].value)]
        motion = _tip(view) if view.joints > 1 else _joint(view, 0)
        keys = [channel("f", axis, has_torque=bool(before.free)) for axis in bench.case.base.model.task_axes]
        result += [_trace(key, view, pair, axis, bench.case.holdout, motion) for axis, key in enumerate(keys)]
    return result


def _trace(
    key: str,
    view: View,
    pair: Sequence[tuple[Equation, Floats]],
    column: int,
    holdout: Holdout,
    motion: dict[str, Floats],
) -> Trace:
    parts = [series(equation, value, holdout.mask(view, SEALED)) for equation, value in pair]
    shown = parts[0].shown & parts[1].shown
    step = max(1, round(view.rate_hz / SERIES_RATE_HZ))
    before, after = ((part.target - part.fit)[shown, column] for part in parts)
    along = {name: values[::step][shown] for name, values in motion.items()}
    return Trace(key, view.name, parts[0].t[shown], parts[0].held_out[shown], before, after, along)


def _joint(view: View, joint: int) -> dict[str, Floats]:
    angle, speed, acc = (values[:, joint] for values in (view.theta, view.omega, view.acc))
    place = {} if view.joints == 1 else {"x": view.x[:, 0], "y": view.x[:, 1]}
    return {
        f"theta{joint + 1}": angle,
        f"omega{joint + 1}": speed,
        "acceleration": acc,
        "torque": view.tau[:, joint],
        **place,
        "direction": np.sign(speed),
    }


def _tip(view: View) -> dict[str, Floats]:
    speed = np.linalg.norm(view.v, axis=1)
    return {
        "x": view.x[:, 0],
        "y": view.x[:, 1],
        "speed": speed,
        "acceleration": np.linalg.norm(view.a, axis=1),
        "torque": view.tau[:, 0],
        "theta1": view.theta[:, 0],
        "direction": np.arctan2(view.v[:, 1], view.v[:, 0]),
    }
