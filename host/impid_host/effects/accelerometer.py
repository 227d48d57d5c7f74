"""How an accelerometer errs: what it reads against the specific force that the encoders predict.

Titterton and Weston, Strapdown Inertial Navigation Technology (2004), ch. 4 and 8.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from impid_host.effects.effect import Effect, Parameter, Setting, Term, Value, along
from impid_host.effects.view import Columns, View, advanced, rate_of, rotated
from impid_host.signals.arrays import Floats

_AXES = ("x", "y")
_SETS: tuple[tuple[int, ...], ...] = ((0,), (1,), (0, 1))
_SOURCE = "Titterton and Weston 2004"
_MAX_DELAY_S = 0.1


def _felt(view: View, *columns: Floats) -> Columns:
    """Additions (N, 2) to the reading; nothing in a trial without an accelerometer."""
    return {} if view.predicted is None else {"specific_force": np.stack(columns, axis=2)}


def _reread(view: View, change: Callable[[Floats], Floats]) -> View:
    return view if view.measured is None else replace(view, measured=change(view.measured))


def _per_axis(name: str, parameter: str, first: float) -> Iterator[Term]:
    """Scale, bias and cross-talk: one parameter on either axis, or on both."""
    for axes in _SETS:

        def columns(view: View, _shape: float, axes: tuple[int, ...] = axes) -> Columns:
            if view.predicted is None:
                return {}
            source = {
                "accel.scale": view.predicted,
                "accel.bias": np.ones_like(view.predicted),
                "accel.cross_axis": view.predicted[:, ::-1],
            }[name]
            return _felt(view, *(along(source[:, axis], axis) for axis in axes))

        def read(beta: Floats, _shape: float, axes: tuple[int, ...] = axes) -> dict[str, Value]:
            values = [first + float(b) for b in beta]
            return {parameter: values if len(axes) > 1 else values[0]}

        yield Term(
            name,
            tuple(_AXES[axis] for axis in axes),
            columns,
            read,
            size=len(axes),
            gate=lambda beta, _shape: bool(max(abs(beta)) < (5.0 if name == "accel.bias" else 0.5)),
            # A turned sensor is one with opposite cross-talk on its axes.
            holds=("accel.misalignment@sensor",) if name == "accel.cross_axis" and len(axes) > 1 else (),
        )


def _scale(setting: Setting) -> Iterator[Term]:
    if setting.accelerometer:
        yield from _per_axis("accel.scale", "gain", 1.0)


def _bias(setting: Setting) -> Iterator[Term]:
    if setting.accelerometer:
        yield from _per_axis("accel.bias", "bias", 0.0)


def _cross_axis(setting: Setting) -> Iterator[Term]:
    if setting.accelerometer:
        yield from _per_axis("accel.cross_axis", "cross", 0.0)


def _misalignment(setting: Setting) -> Iterator[Term]:
    if not setting.accelerometer:
        return

    def columns(view: View, _shape: float) -> Columns:
        if view.predicted is None:
            return {}
        return _felt(view, np.stack([view.predicted[:, 1], -view.predicted[:, 0]], axis=1))

    # The second-order part of a large angle is taken up when the signals are corrected.
    yield Term(
        "accel.misalignment",
        ("sensor",),
        columns,
        lambda beta, _shape: {"angle_rad": float(beta[0])},
        gate=lambda beta, _shape: bool(abs(beta[0]) < 0.5),
        undo=lambda view, beta, _shape: _reread(
            view, lambda felt: rotated(felt, np.full(len(felt), beta[0]))
        ),
    )


def _delay(setting: Setting) -> Iterator[Term]:
    if not setting.accelerometer:
        return

    def columns(view: View, _shape: float) -> Columns:
        return {} if view.predicted is None else _felt(view, -rate_of(view.predicted, view.dt))

    yield Term(
        "accel.delay",
        ("sensor",),
        columns,
        lambda beta, _shape: {"delay": float(beta[0])},
        gate=lambda beta, _shape: bool(abs(beta[0]) < _MAX_DELAY_S),
        undo=lambda view, beta, _shape: _reread(view, lambda felt: advanced(felt, view.t, float(beta[0]))),
    )


def _lever_arm(setting: Setting) -> Iterator[Term]:
    if not setting.accelerometer:
        return

    def columns(view: View, _shape: float) -> Columns:
        # (lx, ly) along the sensor's axes: a += turn' x l - turn^2 l.
        spin, swing = -(view.turn**2), view.turn_rate
        return _felt(view, np.stack([spin, swing], axis=1), np.stack([-swing, spin], axis=1))

    yield Term(
        "accel.lever_arm",
        ("sensor",),
        columns,
        lambda beta, _shape: {"lever": [float(beta[0]), float(beta[1])]},
        size=2,
        gate=lambda beta, _shape: bool(np.hypot(*beta) < 0.5),
    )


_ROWS = (
    (
        "accel.misalignment",
        "the axes stand angle_rad further",
        (Parameter("angle_rad", "rad", -0.5, 0.5, least=3e-4),),
    ),
    (
        "accel.scale",
        "reading = gain * specific force",
        (Parameter("gain", "1", 0.5, 1.5, least=3e-4, none=1.0),),
    ),
    (
        "accel.bias",
        "reading += bias, along the sensor's axes",
        (Parameter("bias", "m/s^2", -5, 5, least=2e-4),),
    ),
    (
        "accel.cross_axis",
        "reading of an axis += cross * that of the other",
        (Parameter("cross", "1", -0.5, 0.5, least=3e-4),),
    ),
    (
        "accel.delay",
        "reading(t) = specific force(t - delay)",
        (Parameter("delay", "s", -_MAX_DELAY_S, _MAX_DELAY_S, least=2e-5),),
    ),
    (
        "accel.lever_arm",
        "reading += turn' x lever - turn^2 lever, lever along the sensor's axes",
        (Parameter("lever", "m", -0.5, 0.5, least=1e-4),),
    ),
)
_TERMS = (_misalignment, _scale, _bias, _cross_axis, _delay, _lever_arm)
_TELLS = {
    "accel.scale": {"": "the accelerometer turned by hand through gravity (`impid-host device calibrate`)"},
    "accel.bias": {"gravity.tilt": "a free trial in which link 2 turns by 90 degrees or more"},
}
EFFECTS = tuple(
    Effect(
        name,
        equation,
        "sensor",
        parameters,
        _SOURCE,
        terms,
        carries="record" if name == "accel.bias" else "machine",
        tells=_TELLS.get(name, {}),
    )
    for (name, equation, parameters), terms in zip(_ROWS, _TERMS, strict=True)
)
