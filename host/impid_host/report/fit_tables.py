"""The tables that `impid-host fit` and `impid-host sync` print."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich import box
from rich.table import Table

from impid_host.clock.robot import RobotClockFit
from impid_host.impedance.constrained import Constrained
from impid_host.impedance.force import ForceComparison
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.impedance.joint_space import JointImpedance
from impid_host.impedance.partial import PartialLoadFit
from impid_host.report.parameter_entries import parameter_entries
from impid_host.signals.arrays import Floats

if TYPE_CHECKING:
    from impid_host.impedance.stochastic import SpectralFit

METHODS = {"virtual sensor": "Method 1", "physical sensor": "Method 2"}
_INTERVALS = {
    "virtual sensor": "Method 1: noise of torque and motion as coloured as it was found, and the uncertainty "
    "of the robot's parameters",
    "physical sensor": "Method 2: noise of force and motion as coloured as it was found",
}


def robot_table(fit: RobotFit) -> Table:
    """Parameters of the robot with their 95 % intervals."""
    estimate = fit.estimate
    table = Table(
        title=f"Robot ({fit.parameters.structure.model.name}), {len(fit.series)} free trial(s)",
        title_justify="left",
        caption=_robot_caption(fit),
        caption_justify="left",
    )
    for heading, justify in (
        ("parameter", "left"),
        ("value", "right"),
        ("95 % interval", "right"),
        ("unit", "left"),
    ):
        table.add_column(heading, justify=justify, overflow="fold")  # type: ignore[arg-type]
    for name, unit, value, ci in zip(
        estimate.names, estimate.units, estimate.value, estimate.ci95, strict=True
    ):
        table.add_row(name, number(value, ci), interval(ci), unit)
    return table


def load_table(fits: Sequence[LoadFit], *, explained: bool = False) -> Table:
    """One load, the methods side by side.

    Args:
        explained: say below what the intervals hold.
    """
    first = fits[0]
    held = "; ".join(_INTERVALS[fit.method] for fit in fits)
    words = f"The intervals hold, by {held}. They hold no tolerance of lengths or gains."
    title = f"Load {first.load} ({first.model.name}), {len(first.series)} trial(s)"
    table = _table(title, words if explained else None)
    table.add_column("quantity", overflow="fold")
    for fit in fits:
        table.add_column(f"{METHODS[fit.method]}\n{sensor(fit)}\n(+- 95 %)", justify="right", overflow="fold")
    table.add_column("unit", overflow="fold")
    for entry in parameter_entries(first):
        table.add_row(entry.label, *(plus_minus(*entry.of(fit)) for fit in fits), entry.unit)
    for axis, label in enumerate(first.model.axes):
        table.add_row(f"VAF {label}, {judged_on(first)}", *(f"{fit.vaf[axis]:.2f}" for fit in fits), "%")
    for axis, label in enumerate(first.model.axes):
        unit = first.model.force_unit
        table.add_row(f"residual rms {label}", *(f"{fit.rms[axis]:.3g}" for fit in fits), unit)
    if first.beyond_force_percent is not None:
        shares = (fit.beyond_force_percent for fit in fits)
        cells = ["" if share is None else f"{share:.1f}" for share in shares]
        table.add_row("external torque that no force at the tip makes", *cells, "%")
    return table


def partial_table(fit: PartialLoadFit) -> Table:
    """The combinations that a load's trials determine."""
    what = f"Load {fit.load} ({fit.model.name}), {len(fit.trials)} trial(s), {METHODS[fit.method]}"
    table = _table(f"{what}: not all of it", fit.reason)
    for heading in ("combination", "value", "95 % interval", "unit"):
        table.add_column(
            heading, justify="left" if heading in ("combination", "unit") else "right", overflow="fold"
        )
    own = fit.estimate
    for name, unit, value, ci in zip(own.names, own.units, own.value, own.ci95, strict=True):
        table.add_row(name, number(value, ci), interval(ci), unit)
    return table


def constrained_table(pairs: Sequence[tuple[LoadFit, Constrained]]) -> Table:
    """M and K as they are and symmetric positive definite, method by method."""
    first = pairs[0][0]
    words = "\n".join(f"{METHODS[fit.method]}: {constrained.verdict}" for fit, constrained in pairs)
    table = _table(f"Load {first.load}: M and K symmetric and positive definite", words)
    table.add_column("quantity", overflow="fold")
    for fit, _ in pairs:
        for heading in ("unconstrained", "constrained"):
            table.add_column(f"{METHODS[fit.method]}\n{heading}", justify="right", overflow="fold")
    table.add_column("unit", overflow="fold")
    for entry in parameter_entries(first):
        cells = []
        for fit, constrained in pairs:
            cells += [plus_minus(*entry.of(fit)), plus_minus(*entry.of(constrained.matrices))]
        table.add_row(entry.label, *cells, entry.unit)
    return table


def joint_table(joints: Sequence[JointImpedance]) -> Table:
    """Shoulder and elbow impedance, the methods side by side; s is the shoulder, e the elbow."""
    first = joints[0]
    angles = ", ".join(
        f"{name} {np.rad2deg(angle):.1f} deg"
        for name, angle in zip(("shoulder", "elbow flexion"), first.posture, strict=True)
    )
    table = _table(f"Load {first.load} in the arm's joints, at {angles}")
    table.add_column("quantity", overflow="fold")
    for joint in joints:
        table.add_column(f"{METHODS[joint.method]}\n(+- 95 %)", justify="right", overflow="fold")
    table.add_column("unit", overflow="fold")
    for letter, name in (("I", "inertia"), ("B", "damping"), ("K", "stiffness")):
        quantities = [getattr(joint, name) for joint in joints]
        for i, row in enumerate("se"):
            for j, column in enumerate("se"):
                if quantities[0] is not None:
                    cells = (plus_minus(float(q.value[i, j]), q.ci95[i, j]) for q in quantities)
                    table.add_row(f"{letter}{row}{column}", *cells, quantities[0].unit)
    return table


def spectral_table(fits: "Sequence[SpectralFit]") -> Table:
    """One stochastic load: time domain and spectral side by side for each sensor, and where they disagree."""
    first = fits[0]
    words = [f"{METHODS[fit.method]}: {fit.against.verdict}" for fit in fits]
    words += [str(check) for check in first.estimate.checks]
    words += [
        f"{METHODS[fit.method]}, model against estimate, {agreement}"
        for fit in fits
        for agreement in fit.estimate.best.agreement
    ]
    for fit in fits:
        if fit.periodic is not None:
            words.append(f"{METHODS[fit.method]}, periodic perturbation: {fit.periodic.compliance}")
            words += [
                f"{METHODS[fit.method]}, along {axis}: {level}"
                for axis, level in zip("xy", fit.periodic.distortion, strict=True)
            ]
    table = _table(
        f"Load {first.load} ({first.on}), {len(first.trials)} stochastic trial(s), full matrices, +- 95 %",
        "\n".join(words),
    )
    table.add_column("quantity", overflow="fold")
    for fit in fits:
        for heading in ("time domain", "spectral", "apart\n(std. errors)"):
            table.add_column(f"{METHODS[fit.method]}\n{heading}", justify="right", overflow="fold")
    for k, name in enumerate(first.against.names):
        cells: list[str] = []
        for fit in fits:
            both = fit.against
            for value, sd in ((both.first[k], both.first_sd[k]), (both.second[k], both.second_sd[k])):
                cells.append(plus_minus(float(value), value + 1.96 * np.array([-sd, sd])))
            cells.append(f"{both.z[k]:+.1f}")
        table.add_row(name, *cells)
    return table


def force_table(compared: ForceComparison) -> Table:
    """Virtual against physical force, axis by axis."""
    judged = "held-out" if compared.held_out else "fitted"
    signal = ", ".join(
        f"F{axis} {rms:.3g} N" for axis, rms in zip(compared.axes, compared.signal_rms, strict=True)
    )
    table = _table(
        f"Load {compared.load}: virtual force against the sensor, {judged} data", f"measured, rms: {signal}"
    )
    table.add_column("virtual force by", overflow="fold")
    for axis in compared.axes:
        table.add_column(f"F{axis}\nrms error, N", justify="right")
        table.add_column("\nof measured", justify="right")
        table.add_column("\nmean, N", justify="right")
    for error in compared.errors:
        cells = []
        for rms, share, bias in zip(error.rms, error.relative_percent, error.bias, strict=True):
            cells += [f"{rms:.3g}", f"{share:.1f} %", f"{bias:+.3g}"]
        table.add_row(error.by, *cells)
    return table


def sensor(fit: LoadFit) -> str:
    """What measured the force, in words."""
    return "measured torque" if fit.model.rotary else fit.method


def _table(title: str, caption: str | None = None) -> Table:
    return Table(title=title, title_justify="left", caption=caption, caption_justify="left")


def clock_table(fits: Sequence[tuple[str, RobotClockFit]]) -> Table:
    """Offset and drift of the module's clock against the robot's, trial by trial."""
    title = "Module clock minus robot clock at the centre of the overlap; +- is the 95 % interval"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("trial", overflow="fold")
    for heading in (
        "offset\ns",
        "+-\nus",
        "drift\nppm",
        "+-\nppm",
        "overlap\ns",
        "residual\nurad",
        "rows\nleft out",
    ):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, fit in fits:
        half = 0.5 * (fit.offset_ci95_s[1] - fit.offset_ci95_s[0])
        drift_half = 0.5 * (fit.drift_ci95_ppm[1] - fit.drift_ci95_ppm[0])
        table.add_row(
            name,
            f"{fit.offset_s:.7f}",
            f"{half * 1e6:.3f}",
            f"{fit.drift_ppm:+.4f}",
            f"{drift_half:.4f}",
            f"{fit.overlap_s:.2f}",
            " ".join(f"{rms * 1e6:.3g}" for rms in fit.residual_rms),
            str(fit.rows_rejected),
        )
    return table


def judged_on(fit: RobotFit | LoadFit) -> str:
    """On which rows VAF and residual were taken."""
    return "held-out data" if fit.held_out else "fitted data"


def number(value: float, ci: Floats) -> str:
    """The value to the digits that its interval supports: two of the half width's."""
    half = 0.5 * float(ci[1] - ci[0])
    if not np.isfinite(half) or half <= 0:
        return f"{value:.5g}"
    digits = int(np.clip(1 - np.floor(np.log10(half)), 0, 9))
    return f"{value:.{digits}f}"


def plus_minus(value: float, ci: Floats) -> str:
    """Value and half width, to the same digits."""
    return f"{number(value, ci)} +- {number(0.5 * float(ci[1] - ci[0]), ci)}"


def interval(ci: Floats) -> str:
    """The interval to the same digits as its value."""
    return f"[{number(float(ci[0]), ci)}, {number(float(ci[1]), ci)}]"


def _robot_caption(fit: RobotFit) -> str:
    vaf = ", ".join(f"tau{joint + 1} {value:.2f} %" for joint, value in zip(fit.joints, fit.vaf, strict=True))
    structure = fit.parameters.structure
    units = [structure.torque_units[joint].replace("*", " ") for joint in fit.joints]
    alike = len(set(units)) == 1
    rms = ", ".join(
        f"{value:.3g}" if alike else f"{value:.3g} {unit}" for value, unit in zip(fit.rms, units, strict=True)
    ) + (f" {units[0]}" if alike else "")
    resting = ", ".join(str(joint + 1) for joint in fit.resting)
    left = "own friction, own inertia" + (" and torque" if len(fit.joints) < structure.model.joints else "")
    rest = f"joint {resting} rested: {left} stay open\n" if resting else ""
    if structure.model.parameter_meanings:
        rest += "R: regrouped with what moves alike (the JSON says with what)\n"
    return (
        f"{rest}VAF on {judged_on(fit)}: {vaf}; residual rms {rms}; "
        f"relative error {fit.estimate.relative_error_percent:.2f} % of the fitted rows\n"
        f"accelerations from the {sources(fit.sources)}"
    )


def sources(names: Sequence[str]) -> str:
    """Where accelerations came from, in words."""
    words = {"accelerometer": "accelerometer", "angles": "robot's own angles (no accelerometer used)"}
    return " and the ".join(words.get(name, name) for name in sorted(set(names)))
