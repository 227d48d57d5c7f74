"""A load in the course of a trial: an equilibrium that moves, an arm that stiffens."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from impid_host.effects.effect import (
    Effect,
    Parameter,
    Setting,
    Term,
    along,
    by_load,
    each_trial,
    no_gate,
)
from impid_host.effects.load import scalar
from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats

Course = Callable[[View, float], Floats]
_PLACE = ("load",)
_SWITCHES = tuple(float(part) for part in np.linspace(0.15, 0.55, 6))  # of the trial; its end may be sealed
_SWITCH = 0.05


def _drift(setting: Setting) -> Iterator[Term]:
    """The equilibrium moves, in each trial in its own direction."""
    if not setting.loads:
        return

    def columns(view: View, _shape: float) -> Columns:
        if view.load is None:
            return {}
        # -F_ext = K (x - x0 - rate t)
        t = (view.t - 0.5 * view.t[-1])[:, None]
        return by_load(view, *(-t * column for column in view.K.T))

    moving = Term(
        "load.drift",
        _PLACE,
        columns,
        lambda beta, _shape: {"rate": scalar(beta)},
        size=setting.axes,
        by_model=True,
    )
    yield moving
    if len(setting.loaded) > 1:
        yield each_trial(moving, setting, loaded=True)


def _time_varying(setting: Setting) -> Iterator[Term]:
    """K that grows or falls steadily in the course of a trial, or changes at once; B likewise."""
    if not setting.loads:
        return

    def steadily(view: View, _shape: float) -> Floats:
        return np.asarray(view.t / view.t[-1] - 0.5)

    def at_once(view: View, when: float) -> Floats:
        return np.asarray(0.5 * np.tanh((view.t / view.t[-1] - when) / _SWITCH))

    for word, course, shapes in (("steadily", steadily, (0.0,)), ("at once", at_once, _SWITCHES)):

        def stiffer(view: View, shape: float, course: Course = course) -> Columns:
            if view.load is None:
                return {}
            return by_load(view, course(view, shape)[:, None] * ((view.x - view.x0) @ view.K.T))

        def by_axis(view: View, shape: float, course: Course = course) -> Columns:
            if view.load is None:
                return {}
            u, d = course(view, shape), view.x - view.x0
            return by_load(view, *(along(u * d[:, k], k, setting.axes) for k in range(setting.axes)))

        def damped(view: View, shape: float, course: Course = course) -> Columns:
            return {} if view.load is None else by_load(view, course(view, shape)[:, None] * view.v)

        share = Term(
            "load.time_varying",
            _PLACE,
            stiffer,
            lambda beta, _shape: {"K_change": float(beta[0])},
            shapes=shapes,
            gate=lambda beta, _shape: bool(np.max(np.abs(beta)) < 1.9),
            variant=f"K by a share, {word}",
            by_model=True,
        )
        axes = replace(
            share,
            columns=by_axis,
            read=lambda beta, _shape: {"K": scalar(beta)},
            size=setting.axes,
            gate=no_gate,
            variant=f"K by axis, {word}",
        )
        damping = replace(
            share,
            columns=damped,
            read=lambda beta, _shape: {"B": float(beta[0])},
            gate=no_gate,
            variant=f"B, {word}",
        )
        yield share
        yield damping
        if setting.axes > 1:
            yield axes
        if len(setting.loaded) > 1:
            yield each_trial(share, setting, loaded=True)


EFFECTS = (
    Effect(
        "load.drift",
        "x0 += rate (t - middle of the trial)",
        "load",
        (Parameter("rate", "m/s"),),
        "[P] Sec. II, stationarity",
        _drift,
        carries="record",
    ),
    Effect(
        "load.time_varying",
        "-F_ext += u(t) K_change K (x - x0), or u(t) K (x - x0), u(t) B x'; u from -1/2 to 1/2 in the trial",
        "load",
        (
            Parameter("K_change", "1", -1.9, 1.9),
            Parameter("K", "N/m"),
            Parameter("B", "N*s/m"),
        ),
        "[P] Sec. II, stationarity",
        _time_varying,
        carries="load",
        tells={"": "a repeat of the trial with the arm rested, and one in which it stiffens on purpose"},
    ),
)
