"""A load as plots: ellipses of stiffness, damping and inertia, and its force, estimated and measured."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.result import Diagnosis, Number
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.identify import LoadFit, Method
from impid_host.impedance.loads import Signal
from impid_host.impedance.rows import Series
from impid_host.report.ellipses import PANELS, draws, ellipse
from impid_host.report.page.plot import Line, Plot, Role, Span
from impid_host.report.page.residual_plots import broken, held_out
from impid_host.signals.arrays import Floats

_ROLES: dict[Method, Role] = {"virtual sensor": "first", "physical sensor": "floor"}
Marks = Callable[[str], list[Span]]
"""Name of a trial -> its stretches that need a word."""
_DRAWN = 24  # of the estimate's distribution, behind each ellipse


def ellipse_plots(fit: StudyFit, diagnosis: Diagnosis | None) -> list[Plot]:
    """For each load in the plane one plot for each of its matrices."""
    plots = []
    for load in dict.fromkeys(own.load for own in fit.loads):
        fits = [own for own in fit.loads if own.load == load]
        if len(fits[0].model.axes) != 2:
            continue
        for title, signal, unit in PANELS:
            if fits[0].model.has(signal):
                plots.append(_ellipses(fits, title, signal, unit, fit.handle_mass_kg, diagnosis))
    return plots


def _ellipses(
    fits: list[LoadFit], title: str, signal: Signal, unit: str, handle_kg: float, diagnosis: Diagnosis | None
) -> Plot:
    lines: list[Line] = []
    for fit in fits:
        own = handle_kg * np.eye(2) if signal == "a" and fit.model.carries_handle else np.zeros((2, 2))
        S = fit.model.matrix_map(signal)
        role = _ROLES[fit.method]
        lines += [
            _ellipse((S @ draw).reshape(2, 2) - own, "", role, faint=True) for draw in draws(fit)[:_DRAWN]
        ]
        lines.append(_ellipse((S @ fit.estimate.value).reshape(2, 2) - own, f"fit, {fit.method}", role))
    final = (
        None if diagnosis is None else diagnosis.stages[-1].loads.get(fits[0].load, {}).get(_LETTER[signal])
    )
    if diagnosis is not None and len(diagnosis.stages) > 1 and final is not None:
        lines += _final(final)
    return Plot(
        key=f"ellipse_{title.lower()}_{fits[0].load}",
        title=f"{fits[0].load}: {title.lower()}",
        x_label=f"along x ({unit})",
        y_label=f"along y ({unit})",
        lines=tuple(lines),
        square=True,
        caption=f"what a unit {_UNIT_OF[signal]} in each direction meets; faint lines are draws from the "
        "estimate's distribution",
    )


_LETTER: dict[Signal, str] = {"a": "M", "v": "B", "x": "K"}
_UNIT_OF: dict[Signal, str] = {"a": "acceleration", "v": "velocity", "x": "displacement"}


def _final(number: Number) -> list[Line]:
    if number.value.shape != (2, 2):
        return []
    return [_ellipse(number.value, "with what was found", "second")]


def _ellipse(matrix: Floats, name: str, role: Role, *, faint: bool = False) -> Line:
    around = ellipse(matrix, 61 if faint else 121)
    return Line(around[:, 0], around[:, 1], name, role, faint=faint)


def force_plots(fit: StudyFit, marks: Marks) -> list[Plot]:
    """Of every trial under load its force over the whole trial: by the virtual sensor and as measured, and
    their difference; without a physical sensor beside the load's model.

    Args:
        marks: events of a trial.
    """
    plots: list[Plot] = []
    for load in dict.fromkeys(own.load for own in fit.loads):
        fits = {own.method: own for own in fit.loads if own.load == load}
        first = next(iter(fits.values()))
        for part in first.series:
            for column, axis in enumerate(first.model.axes):
                plots += _force(fits, part.trial, column, axis, marks)
    return plots


def _force(fits: dict[Method, LoadFit], trial: str, column: int, axis: str, marks: Marks) -> Iterator[Plot]:
    """The regression's target is -F_ext; the plot shows F_ext."""
    series = {
        method: next((part for part in fit.series if part.trial == trial), None)
        for method, fit in fits.items()
    }
    known = {method: part for method, part in series.items() if part is not None}
    model = next(iter(fits.values())).model
    part = next(iter(known.values()))
    unit = model.force_unit.replace("*", " ")
    letter = "torque" if model.rotary else f"F{axis}"
    lines = [
        Line(
            *broken(own.t[own.shown], -own.target[own.shown, column]),
            "measured torque" if model.rotary else method,
            _ROLES[method],
        )
        for method, own in known.items()
    ]
    if len(known) == 1:
        lines.append(Line(*broken(part.t[part.shown], -part.fit[part.shown, column]), "load model", "second"))
    plot = Plot(
        key=f"force_{trial}_{axis}",
        title=f"{trial}: {letter} of the load on the robot",
        x_label="time since the trial began (s)",
        y_label=f"{letter} ({unit})",
        lines=tuple(lines),
        spans=(*held_out(part.t[part.shown], part.held_out[part.shown]), *marks(trial)),
    )
    yield plot
    if len(known) == 2:
        yield _difference(plot, known["virtual sensor"], known["physical sensor"], column, unit)


def _difference(plot: Plot, virtual: Series, physical: Series, column: int, unit: str) -> Plot:
    """Virtual less physical sensor at the instants that both have."""
    a, b = virtual.t[virtual.shown], physical.t[physical.shown]
    common, here, there = np.intersect1d(np.round(a, 6), np.round(b, 6), return_indices=True)
    measured = -physical.target[physical.shown, column][there]
    error = -virtual.target[virtual.shown, column][here] - measured
    rms, size = (float(np.sqrt(np.mean(values**2))) for values in (error, measured))
    return replace(
        plot,
        key=f"{plot.key}_difference",
        title=f"{plot.title}: virtual minus physical sensor",
        lines=(Line(*broken(common, error), "difference", "second"),),
        caption=f"rms {rms:.2g} {unit}, {100 * rms / max(size, 1e-300):.2g} % of the measured force's",
    )
