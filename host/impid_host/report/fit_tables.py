"""The tables that `impid-host fit` and `impid-host sync` print."""

from collections.abc import Sequence

import numpy as np
from rich import box
from rich.table import Table

from impid_host.clock.robot import RobotClockFit
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.report.parameter_entries import parameter_entries
from impid_host.signals.arrays import Floats

_AXES = ("x", "y")


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
        table.add_column(heading, justify=justify)  # type: ignore[arg-type]
    for name, unit, value, ci in zip(
        estimate.names, estimate.units, estimate.value, estimate.ci95, strict=True
    ):
        table.add_row(name, number(value, ci), interval(ci), unit)
    return table


def load_table(fits: Sequence[LoadFit]) -> Table:
    """One load, the methods side by side."""
    first = fits[0]
    table = Table(
        title=f"Load {first.load} ({first.model.name}), {len(first.series)} trial(s)", title_justify="left"
    )
    table.add_column("quantity")
    for number_of_method, fit in enumerate(fits):
        label = {"virtual sensor": "Method 1", "physical sensor": "Method 2"}.get(
            fit.method, str(number_of_method + 1)
        )
        table.add_column(f"{label}\n{fit.method}\n(+- 95 %)", justify="right")
    table.add_column("unit")
    for entry in parameter_entries(first):
        table.add_row(entry.label, *(plus_minus(*entry.of(fit)) for fit in fits), entry.unit)
    for axis, label in enumerate(_AXES):
        table.add_row(f"VAF {label}, {judged_on(first)}", *(f"{fit.vaf[axis]:.2f}" for fit in fits), "%")
    for axis, label in enumerate(_AXES):
        table.add_row(f"residual rms {label}", *(f"{fit.rms[axis]:.3g}" for fit in fits), "N")
    return table


def clock_table(fits: Sequence[tuple[str, RobotClockFit]]) -> Table:
    """Offset and drift of the module's clock against the robot's, trial by trial."""
    title = "Module clock minus robot clock at the centre of the overlap; +- is the 95 % interval"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("trial")
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
    vaf = ", ".join(f"tau{joint + 1} {value:.2f} %" for joint, value in enumerate(fit.vaf))
    rms = ", ".join(f"{value:.3g}" for value in fit.rms)
    unit = "N" if fit.parameters.structure.model.name == "slide-1d" else "N m"
    return (
        f"VAF on {judged_on(fit)}: {vaf}; residual rms {rms} {unit}; "
        f"relative error {fit.estimate.relative_error_percent:.2f} % of the fitted rows\n"
        f"accelerations from the {sources(fit.sources)}"
    )


def sources(names: Sequence[str]) -> str:
    """Where accelerations came from, in words."""
    words = {"accelerometer": "accelerometer", "angles": "robot's own angles (no accelerometer used)"}
    return " and the ".join(words.get(name, name) for name in sorted(set(names)))
