"""What a load does beyond mass, damping and springs: additions to -F_ext = M x'' + B x' + K (x - x0)."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from impid_host.effects.effect import (
    Effect,
    Parameter,
    Setting,
    Term,
    Value,
    along,
    by_load,
    each_load,
)
from impid_host.effects.friction import dahl
from impid_host.effects.reflex import reflex_terms
from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats

_PLACE = ("load",)


def scalar(values: Floats) -> Value:
    """One number for a load of one axis, else a number per axis."""
    return [float(v) for v in values] if len(values) > 1 else float(values[0])


def _is_spring(view: View) -> bool:
    return view.kind == "mass-spring"


def _damping(setting: Setting) -> Iterator[Term]:
    if not setting.springs:
        return

    def same(view: View, _shape: float) -> Columns:
        return by_load(view, view.v) if _is_spring(view) else {}

    def per_axis(view: View, _shape: float) -> Columns:
        if not _is_spring(view):
            return {}
        return by_load(view, along(view.v[:, 0], 0), along(view.v[:, 1], 1))

    equal = Term(
        "load.damping",
        _PLACE,
        same,
        lambda beta, _shape: {"B": float(beta[0])},
        gate=lambda beta, _shape: bool(beta[0] > 0),
        variant="equal in x and y",
    )
    yield from _for_loads(equal, setting.springs)
    if not setting.planar:
        return
    yield Term(
        "load.damping",
        _PLACE,
        per_axis,
        lambda beta, _shape: {"B": [float(beta[0]), float(beta[1])]},
        size=2,
        gate=lambda beta, _shape: bool(min(beta) > -0.1 * max(beta) and max(beta) > 0),
        variant="x and y",
    )


def _for_loads(term: Term, loads: tuple[str, ...]) -> Iterator[Term]:
    """One value for all loads, and where there are several, one for each."""
    yield term
    if len(loads) > 1:
        yield each_load(term, loads)


def _cubic(setting: Setting) -> Iterator[Term]:
    if not (setting.springs or setting.arms):
        return

    def radial(view: View, _shape: float) -> Columns:
        d = view.x - view.x0
        return by_load(view, np.sum(d**2, axis=1, keepdims=True) * d)

    def per_axis(view: View, _shape: float) -> Columns:
        d = view.x - view.x0
        return by_load(view, along(d[:, 0] ** 3, 0), along(d[:, 1] ** 3, 1))

    def one(view: View, _shape: float) -> Columns:
        return by_load(view, (view.x - view.x0) ** 3)

    equal = Term(
        "load.stiffness_cubic",
        _PLACE,
        one,
        lambda beta, _shape: {"cubic": float(beta[0])},
        variant="equal in x and y",
        by_model=True,
    )
    if setting.axes > 1:
        yield from _for_loads(replace(equal, columns=radial, variant="radial"), setting.loads)
    yield from _for_loads(equal, setting.loads)
    if not setting.planar:
        return
    yield Term(
        "load.stiffness_cubic",
        _PLACE,
        per_axis,
        lambda beta, _shape: {"cubic": [float(beta[0]), float(beta[1])]},
        size=2,
        variant="x and y",
        by_model=True,
    )


def _hysteresis(setting: Setting) -> Iterator[Term]:
    if not (setting.springs or setting.arms):
        return
    shapes = tuple(float(setting.reach * part) for part in (0.003, 0.01, 0.03, 0.08, 0.2))

    def per_axis(view: View, width: float) -> Columns:
        if view.load is None:
            return {}
        return by_load(view, np.stack([dahl(column, width) for column in view.x.T], axis=1))

    def along_motion(view: View, width: float) -> Columns:
        if view.load is None:
            return {}
        speed = np.linalg.norm(view.v, axis=1, keepdims=True)
        small = 3.0 * width  # m/s: where the direction turns softly
        return by_load(view, view.v / np.hypot(speed, small))

    for variant, columns in (("x and y", per_axis), ("along the motion", along_motion)):
        yield Term(
            "load.hysteresis",
            _PLACE,
            columns,
            lambda beta, width: {"amplitude": float(beta[0]), "width": width},
            shapes=shapes,
            gate=lambda beta, _shape: bool(beta[0] > 0),
            variant=variant,
        )


def _deadzone(setting: Setting) -> Iterator[Term]:
    if not (setting.springs or setting.arms):
        return
    shapes = tuple(float(setting.reach * part) for part in np.linspace(0.03, 0.45, 8))

    def radial(view: View, width: float) -> Columns:
        if view.load is None:
            return {}
        d = view.x - view.x0
        distance = np.linalg.norm(d, axis=1, keepdims=True)
        inside = d * np.minimum(1.0, 0.5 * width / np.maximum(distance, 1e-9))
        return by_load(view, -inside @ view.K.T)

    def per_axis(view: View, width: float) -> Columns:
        if view.load is None:
            return {}
        inside = np.clip(view.x - view.x0, -0.5 * width, 0.5 * width)
        return by_load(view, -inside @ view.K.T)

    variants = (("radial", radial), ("x and y", per_axis))
    for variant, columns in variants if setting.axes > 1 else variants[:1]:
        yield Term(
            "load.deadzone",
            _PLACE,
            columns,
            lambda _beta, width: {"width": width},
            shapes=shapes,
            gate=lambda beta, _shape: bool(0.3 < beta[0] < 3.0),
            variant=variant,
            by_model=True,
        )


def _delay(setting: Setting) -> Iterator[Term]:
    if not (setting.springs or setting.arms):
        return

    def late(view: View, values: Floats, delay: float) -> Floats:
        return np.stack([np.interp(view.t - delay, view.t, column) for column in values.T], axis=1)

    def columns(view: View, delay: float) -> Columns:
        if view.load is None:
            return {}
        return by_load(view, late(view, view.x - view.x0, delay), late(view, view.v, delay))

    shapes = tuple(float(d) for d in np.linspace(0.03, 0.25, 12))
    yield Term(
        "load.delay",
        _PLACE,
        columns,
        lambda beta, delay: {"delay": delay, "gain_k": float(beta[0]), "gain_b": float(beta[1])},
        size=2,
        shapes=shapes,
        # A reflex pulls back; the late damping is known less well.
        gate=lambda beta, _delay: bool(beta[0] > 0),
        by_model=True,
    )
    yield from reflex_terms(setting)


def _coupling(setting: Setting) -> Iterator[Term]:
    if not (setting.springs and setting.planar):
        return

    def stiffness(view: View, _shape: float) -> Columns:
        d = view.x - view.x0
        return by_load(view, np.stack([d[:, 1], -d[:, 0]], axis=1)) if _is_spring(view) else {}

    def anisotropic(view: View, _shape: float) -> Columns:
        a = view.a
        return by_load(view, np.stack([a[:, 0], -a[:, 1]], axis=1)) if _is_spring(view) else {}

    def crossed(view: View, _shape: float) -> Columns:
        return by_load(view, view.a[:, ::-1]) if _is_spring(view) else {}

    def mass(view: View, shape: float) -> Columns:
        parts = [anisotropic(view, shape), crossed(view, shape)]
        return {family: np.concatenate([p[family] for p in parts], axis=2) for family in parts[0]}

    def read_k(beta: Floats, _shape: float) -> dict[str, Value]:
        return {"K": [[0.0, float(beta[0])], [-float(beta[0]), 0.0]]}

    def read_m(beta: Floats, _shape: float) -> dict[str, Value]:
        d, c = float(beta[0]), float(beta[-1]) if len(beta) > 1 else 0.0
        return {"M": [[d, c], [c, -d]]}

    def read_c(beta: Floats, _shape: float) -> dict[str, Value]:
        return {"M": [[0.0, float(beta[0])], [float(beta[0]), 0.0]]}

    yield Term("load.coupling", _PLACE, stiffness, read_k, variant="K", by_model=True)
    yield Term("load.coupling", _PLACE, anisotropic, read_m, variant="M diagonal")
    yield Term("load.coupling", _PLACE, crossed, read_c, variant="M off-diagonal")
    yield Term("load.coupling", _PLACE, mass, read_m, size=2, variant="M")


EFFECTS = (
    Effect(
        "load.damping",
        "-F_ext += B x' (mass-spring)",
        "load",
        (Parameter("B", "N*s/m", -1000, amplitude=True),),
        "[D] eq. 3",
        _damping,
        carries="load",
        tells={"load.delay": "a load trial with faster motion, up to 5 Hz"},
        adds_to=("B",),
    ),
    Effect(
        "load.stiffness_cubic",
        "-F_ext += cubic |d|^2 d, or cubic d^3 along each axis; d = x - x0",
        "load",
        (Parameter("cubic", "N/m^3"),),
        "Duffing oscillator: Kovacic and Brennan, The Duffing Equation (2011)",
        _cubic,
        carries="load",
    ),
    Effect(
        "load.hysteresis",
        "-F_ext += amplitude z, dz = (1 - z sign(dx)) dx / width",
        "load",
        (Parameter("amplitude", "N", 0, amplitude=True), Parameter("width", "m", 0)),
        "Dahl, Solid friction damping of mechanical vibrations, AIAA J. 14 (1976)",
        _hysteresis,
        carries="load",
    ),
    Effect(
        "load.deadzone",
        "K acts on d less its part within width / 2 of the equilibrium",
        "load",
        (Parameter("width", "m", 0),),
        "Nordin and Gutman, Controlling mechanical systems with backlash, Automatica 38 (2002)",
        _deadzone,
        carries="load",
    ),
    Effect(
        "load.delay",
        "-F_ext += gain_k d(t - delay) + gain_b x'(t - delay)",
        "load",
        (
            Parameter("delay", "s", 0, 0.3),
            Parameter("gain_k", "N/m"),
            Parameter("gain_b", "N*s/m"),
            Parameter("corner_rad_s", "rad/s"),
        ),
        "Kearney, Stein, Parameswaran, IEEE Trans. Biomed. Eng. 44 (1997)",
        _delay,
        carries="load",
    ),
    Effect(
        "load.coupling",
        "-F_ext += what of M or K the load's own structure (M = m 1, K symmetric) leaves out",
        "load",
        (Parameter("K", "N/m"), Parameter("M", "kg")),
        "[D] eqs. 5 and 6",
        _coupling,
        carries="load",
        adds_to=("K", "M"),
    ),
)
