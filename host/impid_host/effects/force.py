"""How the physical force sensor errs: what it reads against the force of the load that the model predicts.

The sensor reads the load's force on the robot; a column is what one unit adds to minus that reading. Bicchi,
Salisbury and Brock, Contact sensing from force measurements, Int. J. Robotics Research 12 (1993).
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from impid_host.effects.effect import Effect, Parameter, Setting, Term, Value, along, each_trial
from impid_host.effects.view import Columns, View, advanced, rate_of, rotated
from impid_host.signals.arrays import Floats

_AXES = ("x", "y")
_SETS: tuple[tuple[int, ...], ...] = ((0,), (1,), (0, 1))
_SOURCE = "Bicchi, Salisbury, Brock 1993"
_MAX_DELAY_S = 0.1


def _felt(view: View) -> Floats | None:
    """Minus the load's force as the present model predicts it, (N, 2); None where no sensor felt it."""
    if view.load is None or view.force is None or view.response is None:
        return None
    return view.response["force"]


def _reading(view: View, make: Callable[[Floats], list[Floats]]) -> Columns:
    felt = _felt(view)
    return {} if felt is None else {"force": np.stack(make(felt), axis=2)}


def _reread(view: View, change: Callable[[Floats], Floats]) -> View:
    return view if view.force is None else replace(view, force=change(view.force))


def _scale(setting: Setting) -> Iterator[Term]:
    for axes in _SETS if setting.force_sensor else ():

        def columns(view: View, _shape: float, axes: tuple[int, ...] = axes) -> Columns:
            return _reading(view, lambda felt: [along(felt[:, axis], axis) for axis in axes])

        def undo(view: View, beta: Floats, _shape: float, axes: tuple[int, ...] = axes) -> View:
            gain = np.ones(2)
            gain[list(axes)] += beta
            return _reread(view, lambda read: read / gain)

        yield Term(
            "force.scale",
            tuple(_AXES[axis] for axis in axes),
            columns,
            _per_axis("gain", 1.0),
            size=len(axes),
            undo=undo,
            stretch=lambda beta, axes=axes: {  # type: ignore[misc]
                ("force", axis): 1.0 / (1.0 + float(b)) for axis, b in zip(axes, beta, strict=True)
            },
            by_model=True,
        )


def _per_axis(name: str, first: float) -> Callable[[Floats, float], dict[str, Value]]:
    def read(beta: Floats, _shape: float) -> dict[str, Value]:
        values = [first + float(b) for b in beta]
        return {name: values if len(values) > 1 else values[0]}

    return read


def _misalignment(setting: Setting) -> Iterator[Term]:
    if not setting.force_sensor:
        return

    def columns(view: View, _shape: float) -> Columns:
        return _reading(view, lambda felt: [np.stack([felt[:, 1], -felt[:, 0]], axis=1)])

    yield Term(
        "force.misalignment",
        ("sensor",),
        columns,
        lambda beta, _shape: {"angle_rad": float(beta[0])},
        undo=lambda view, beta, _shape: _reread(
            view, lambda read: rotated(read, np.full(len(read), beta[0]))
        ),
        by_model=True,
    )


def _cross_axis(setting: Setting) -> Iterator[Term]:
    for axes in _SETS if setting.force_sensor else ():

        def columns(view: View, _shape: float, axes: tuple[int, ...] = axes) -> Columns:
            return _reading(view, lambda felt: [along(felt[:, 1 - axis], axis) for axis in axes])

        def undo(view: View, beta: Floats, _shape: float, axes: tuple[int, ...] = axes) -> View:
            mixing = np.eye(2)
            for axis, cross in zip(axes, beta, strict=True):
                mixing[axis, 1 - axis] = cross
            return _reread(view, lambda read: np.asarray(np.linalg.solve(mixing, read.T).T, np.float64))

        yield Term(
            "force.cross_axis",
            tuple(_AXES[axis] for axis in axes),
            columns,
            _per_axis("cross", 0.0),
            size=len(axes),
            undo=undo,
            by_model=True,
            # A turned sensor is one with opposite cross-talk on its axes.
            holds=("force.misalignment@sensor",) if len(axes) > 1 else (),
        )


def _bias(setting: Setting) -> Iterator[Term]:
    for axes in _SETS if setting.force_sensor else ():

        def columns(view: View, _shape: float, axes: tuple[int, ...] = axes) -> Columns:
            one = -np.ones_like(view.t)
            return _constant(view, [along(one, axis) for axis in axes])

        def drifting(view: View, _shape: float, axes: tuple[int, ...] = axes) -> Columns:
            slope = -(view.t - 0.5 * view.t[-1])
            own = columns(view, _shape, axes)
            more = _constant(view, [along(slope, axis) for axis in axes])
            return {family: np.concatenate([own[family], more[family]], axis=2) for family in own}

        steady = Term(
            "force.bias", tuple(_AXES[axis] for axis in axes), columns, _per_axis("bias", 0.0), size=len(axes)
        )
        yield steady
        # A zero that drifts does so from trial to trial as well, or comes back when it is zeroed before each.
        drifts = replace(steady, columns=drifting, read=_read_drift, size=2 * len(axes), variant="drift")
        yield drifts
        if len(setting.loaded) > 1:
            yield each_trial(drifts, setting, loaded=True)


def _constant(view: View, columns: list[Floats]) -> Columns:
    """Columns that follow no force; nothing where no sensor felt any."""
    return {} if view.load is None or view.force is None else {"force": np.stack(columns, axis=2)}


def _read_drift(beta: Floats, _shape: float) -> dict[str, Value]:
    half = len(beta) // 2
    bias, drift = ([float(b) for b in part] for part in (beta[:half], beta[half:]))
    return {"bias": bias, "drift": drift} if half > 1 else {"bias": bias[0], "drift": drift[0]}


def _delay(setting: Setting) -> Iterator[Term]:
    if not setting.force_sensor:
        return

    def columns(view: View, _shape: float) -> Columns:
        return _reading(view, lambda felt: [-rate_of(felt, view.dt)])

    yield Term(
        "force.delay",
        ("sensor",),
        columns,
        lambda beta, _shape: {"delay": float(beta[0])},
        undo=lambda view, beta, _shape: _reread(view, lambda read: advanced(read, view.t, float(beta[0]))),
        by_model=True,
    )


_WEIGHED = "a load trial with a weighed payload (payload_kg), or a known weight hung on the force sensor"
_TURNED = "a repeat with the handle and its sensor turned by 90 degrees"
EFFECTS = (
    Effect(
        "force.scale",
        "reading = gain * force, along the sensor's axes",
        "sensor",
        (Parameter("gain", "1", 0.3, 3.0, least=5e-4, none=1.0),),
        _SOURCE,
        _scale,
        tells={"": _WEIGHED},
    ),
    Effect(
        "force.misalignment",
        "the sensor's axes stand angle_rad further",
        "sensor",
        (Parameter("angle_rad", "rad", -0.6, 0.6, least=5e-4),),
        _SOURCE,
        _misalignment,
        tells={"": _TURNED},
    ),
    Effect(
        "force.cross_axis",
        "reading of an axis += cross * the force along the other",
        "sensor",
        (Parameter("cross", "1", -0.5, 0.5, least=5e-4),),
        _SOURCE,
        _cross_axis,
        tells={"": _TURNED},
    ),
    Effect(
        "force.bias",
        "reading += bias + drift (t - middle of the trial)",
        "sensor",
        (Parameter("bias", "N", -200, 200), Parameter("drift", "N/s", -20, 20)),
        _SOURCE,
        _bias,
        carries="record",
        tells={"": "the sensor's reading at rest with nothing on it, before and after each trial"},
    ),
    Effect(
        "force.delay",
        "reading(t) = force(t - delay)",
        "sensor",
        (Parameter("delay", "s", -_MAX_DELAY_S, _MAX_DELAY_S),),
        "study format, Conventions",
        _delay,
        tells={"": "a load trial with faster motion, up to 5 Hz"},
    ),
)
