"""Residuals of whole trials before and after, with events; each effect's mark on them; what is left."""

import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from impid_host.checks.pushes import Pushes
from impid_host.diagnosis.result import UNATTRIBUTED, Diagnosis, Finding, Trace
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.impedance.rows import Series
from impid_host.report.diagnosis_figures import binned
from impid_host.report.diagnosis_units import channel_unit, structure_words, variable_unit
from impid_host.report.page.plot import Band, Line, Plot, Span, thinned
from impid_host.signals.arrays import Floats

_GAP = 1.5  # steps between rows that belong together


def event_spans(notes: Iterable[str], trial: str) -> list[Span]:
    """Stretches of a trial that `diagnose` calls unlike the rest, from what it says of them.

    Args:
        notes: of the diagnosis; each event is one of them, `diagnosis.events.Event.words` and what was done.
    """
    shape = re.compile(re.escape(trial) + r" from (\d+) to (\d+) s is unlike the rest(?:: (.*))?$")
    found = (shape.match(note) for note in notes)
    return [
        Span(float(m[1]), float(m[2]), f"event{': ' + m[3] if m[3] else ''}", "event") for m in found if m
    ]


def push_spans(pushes: Pushes, trial: str) -> list[Span]:
    """The same of what `fit` found."""
    return [
        Span(push.begin_s, push.end_s, f"event: {'in the fit' if push.fitted else 'held out'}", "event")
        for push in pushes.of(trial)
    ]


def residual_plots(diagnosis: Diagnosis) -> list[Plot]:
    """One for each trial and channel, over the whole trial."""
    first = "papers' model" if diagnosis.baseline == "papers" else "textbook's model"
    return [_residual(diagnosis, trace, first) for trace in diagnosis.traces if len(trace.t) > 1]


def _residual(diagnosis: Diagnosis, trace: Trace, first: str) -> Plot:
    unit = channel_unit(trace.channel, diagnosis.prismatic)
    changed = len(diagnosis.stages) > 1
    if changed:
        lines = [
            Line(*broken(trace.t, trace.before), f"before: {first}", "first"),
            Line(*broken(trace.t, trace.after), "after: with what was found", "second"),
        ]
    else:
        lines = [Line(*broken(trace.t, trace.before), f"left by the {first}", "second")]
    events = event_spans(diagnosis.notes, trace.trial)
    level = diagnosis.floor.get(trace.channel)
    words = [f"rms {_rms(trace.before):.2g}" + (f" before, {_rms(trace.after):.2g} after" if changed else "")]
    words.append(f"noise floor {level:.2g} {unit} rms" if level is not None else "noise floor unknown")
    if trace.held_out.all():
        words.append("the whole trial was held out")
    return Plot(
        key=f"residual_{trace.trial}_{trace.channel}",
        title=f"{trace.trial}: residual of {trace.channel}",
        x_label="time since the trial began (s)",
        y_label=f"{trace.channel} ({unit})",
        lines=tuple(lines),
        spans=(*held_out(trace.t, trace.held_out), *events),
        caption="; ".join(words),
    )


def fit_residual_plots(fit: StudyFit, pushes: Pushes) -> list[Plot]:
    """The same of a fit without a diagnosis: what the first model leaves."""
    plots = robot_residual_plots(fit, pushes)
    for own in fit.loads:
        plots += load_residual_plots(own, pushes)
    return plots


def robot_residual_plots(fit: StudyFit, pushes: Pushes) -> list[Plot]:
    """What the robot's model leaves of the torque of each free trial."""
    if not isinstance(fit.robot, RobotFit):
        return []
    labels = [(f"tau{joint + 1}", _slide(fit, joint)) for joint in fit.robot.joints]
    return [plot for part in fit.robot.series for plot in _left(part, labels, "robot model", pushes)]


def load_residual_plots(fit: LoadFit, pushes: Pushes) -> list[Plot]:
    """What a load's model leaves of the force of each of its trials."""
    labels = [(f"f{axis}", fit.model.force_unit.replace("*", " ")) for axis in fit.model.axes]
    return [plot for part in fit.series for plot in _left(part, labels, fit.method, pushes)]


def _slide(fit: StudyFit, joint: int) -> str:
    parameters = fit.robot.parameters if isinstance(fit.robot, RobotFit) else fit.robot
    return parameters.structure.torque_units[joint].replace("*", " ")


def _left(part: Series, labels: Sequence[tuple[str, str]], by: str, pushes: Pushes) -> Iterator[Plot]:
    shown = part.shown
    for column, (name, unit) in enumerate(labels):
        rest = (part.target - part.fit)[shown, column]
        yield Plot(
            key=f"residual_{part.trial}_{name}_{by.replace(' ', '_')}",
            title=f"{part.trial}: residual of {name}, {by}",
            x_label="time since the trial began (s)",
            y_label=f"{name} ({unit})",
            lines=(Line(*broken(part.t[shown], rest), "left by the model", "second"),),
            spans=(*held_out(part.t[shown], part.held_out[shown]), *push_spans(pushes, part.trial)),
            caption=f"rms {_rms(rest):.2g} {unit}",
        )


def signature_plots(diagnosis: Diagnosis) -> list[Plot]:
    """Of each named effect the residual of its channel, over what that depended on most before."""
    plots = []
    for number, stage in enumerate(diagnosis.stages[1:], start=1):
        own = stage.added
        if own is not None and own.effect != UNATTRIBUTED:
            plot = _signature(diagnosis, own, number)
            if plot is not None:
                plots.append(plot)
    return plots


def _signature(diagnosis: Diagnosis, own: Finding, number: int) -> Plot | None:
    """Residual against the variable by which bins explain most of it, in the channel that gains most."""
    best: tuple[float, str, str] = (0.0, "", "")
    for key in _channels(diagnosis, own):
        traces = [trace for trace in diagnosis.traces if trace.channel == key]
        before = np.concatenate([trace.before for trace in traces])
        for name in traces[0].motion:
            values = np.concatenate([trace.motion[name] for trace in traces])
            place, level = binned(values, before)
            explained = float(np.var(np.interp(values, place, level)) / max(float(np.var(before)), 1e-300))
            best = max(best, (explained, key, name))
    share, key, name = best
    if not key:
        return None
    traces = [trace for trace in diagnosis.traces if trace.channel == key]
    values = np.concatenate([trace.motion[name] for trace in traces])
    lines = []
    for part, role, words in (("before", "first", "before"), ("after", "second", "after")):
        place, level = binned(values, np.concatenate([getattr(trace, part) for trace in traces]))
        lines.append(Line(place, level, words, role))  # type: ignore[arg-type]
    unit = channel_unit(key, diagnosis.prismatic)
    return Plot(
        key=f"effect_{number}_{own.effect}",
        title=f"{own.label}: mean residual of {key} over {name}",
        x_label=f"{name} ({variable_unit(name, key, diagnosis.prismatic)})",
        y_label=f"{key} ({unit})",
        lines=tuple(lines),
        caption=f"of all that was logged, {key} hung most on {name} ({100 * share:.0f} % of its variance) "
        "before; bins of equally many rows, all effects of the last stage taken out after",
    )


def _channels(diagnosis: Diagnosis, own: Finding) -> list[str]:
    """Channels in which the effect can show: its joints' torques, else all."""
    known = list(dict.fromkeys(trace.channel for trace in diagnosis.traces))
    joints = [f"tau{place[5:]}" for place in own.where if place.startswith("joint")]
    return [key for key in known if key in joints] or known


def leftover_plots(diagnosis: Diagnosis) -> list[Plot]:
    """What is left and has no known cause, with its 95 % band."""
    return [
        Plot(
            key=f"left_{number + 1}",
            title=f"No known cause: {structure_words(row, diagnosis)}",
            x_label=f"{row.variable} ({variable_unit(row.variable, row.on, diagnosis.prismatic)})",
            y_label=f"left in {row.on} ({channel_unit(row.on, diagnosis.prismatic)})",
            lines=(Line(row.curve[:, 0], row.curve[:, 1], "what is left", "second"),),
            bands=(Band(row.curve[:, 0], row.band[:, 0], row.band[:, 1], "second"),),
            caption=f"{100 * row.share:.0f} % of the residual's variance; the band holds 95 %",
        )
        for number, row in enumerate(diagnosis.structure)
        if len(row.curve)
    ]


def held_out(t: Floats, mask: np.ndarray) -> list[Span]:
    """The stretch that took no part in fitting, if it is not everything."""
    if not mask.any() or mask.all():
        return []
    return [Span(float(t[mask][0]), float(t[mask][-1]), "held out: took no part in the fit", "held out")]


def broken(t: Floats, values: Floats) -> tuple[Floats, Floats]:
    """A line thinned for drawing, interrupted where rows are missing."""
    x, y = thinned(t, values)
    if len(x) < 3:
        return x, y
    step = float(np.median(np.diff(x)))
    holes = np.flatnonzero(np.diff(x) > _GAP * step) + 1
    return np.insert(x, holes, np.nan), np.insert(y, holes, np.nan)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
