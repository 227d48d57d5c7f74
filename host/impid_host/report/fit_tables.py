"""The tables that `impid-host fit` and `impid-host sync` print."""

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from impid_host.clock.robot import RobotClockFit
from impid_host.impedance.identify import LoadFit, Quantity, RobotFit
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
    for heading, justify in (("parameter", "left"), ("value", "right"), ("95 % interval", "right"), ("unit", "left")):
        table.add_column(heading, justify=justify)  # type: ignore[arg-type]
    for name, unit, value, ci in zip(estimate.names, estimate.units, estimate.value, estimate.ci95, strict=True):
        table.add_row(name, number(value, ci), interval(ci), unit)
    return table


def load_table(fits: Sequence[LoadFit]) -> Table:
    """One load, the methods side by side."""
    first = fits[0]
    table = Table(title=f"Load {first.load} ({first.model.name}), {len(first.series)} trial(s)", title_justify="left")
    table.add_column("quantity")
    for number_of_method, fit in enumerate(fits):
        label = {"virtual sensor": "Method 1", "physical sensor": "Method 2"}.get(fit.method, str(number_of_method + 1))
        table.add_column(f"{label}\n{fit.method}", justify="right")
        table.add_column("95 % interval", justify="right")
    table.add_column("unit")
    for name, unit, cells in zip(*_load_rows(fits), strict=True):
        table.add_row(name, *cells, unit)
    for axis, label in enumerate(_AXES):
        vafs = [cell for fit in fits for cell in (f"{fit.vaf[axis]:.2f}", f"rms {fit.rms[axis]:.3g} N")]
        table.add_row(f"VAF {label}, held out", *vafs, "%")
    return table


def clock_table(fits: Sequence[tuple[str, RobotClockFit]]) -> Table:
    """Offset and drift of the module's clock against the robot's, trial by trial."""
    table = Table(title="Module clock against robot clock, at the centre of the overlap", title_justify="left")
    headings = ("offset", "+- (95 %)", "drift", "+- (95 %)", "overlap", "angle residual rms", "rows")
    table.add_column("trial")
    for heading in headings:
        table.add_column(heading, justify="right")
    for name, fit in fits:
        half = 0.5 * (fit.offset_ci95_s[1] - fit.offset_ci95_s[0])
        drift_half = 0.5 * (fit.drift_ci95_ppm[1] - fit.drift_ci95_ppm[0])
        residual = ", ".join(f"{rms * 1e6:.2f}" for rms in fit.residual_rms)
        table.add_row(
            name,
            f"{fit.offset_s:.7f} s",
            f"{half * 1e6:.3f} us",
            f"{fit.drift_ppm:+.4f} ppm",
            f"{drift_half:.4f} ppm",
            f"{fit.overlap_s:.2f} s",
            f"{residual} urad",
            f"{fit.rows_used} ({fit.rows_rejected} left out)",
        )
    return table


def number(value: float, ci: Floats) -> str:
    """The value to the digits that its interval supports: two of the half width's."""
    half = 0.5 * float(ci[1] - ci[0])
    if not np.isfinite(half) or half <= 0:
        return f"{value:.5g}"
    digits = int(np.clip(1 - np.floor(np.log10(half)), 0, 9))
    return f"{value:.{digits}f}"


def interval(ci: Floats) -> str:
    """The interval to the same digits as its value."""
    return f"[{number(float(ci[0]), ci)}, {number(float(ci[1]), ci)}]"


def _robot_caption(fit: RobotFit) -> str:
    vaf = ", ".join(f"tau{joint + 1} {value:.2f} %" for joint, value in enumerate(fit.vaf))
    rms = ", ".join(f"{value:.3g}" for value in fit.rms)
    unit = "N" if fit.parameters.structure.model.name == "slide-1d" else "N m"
    return (
        f"VAF on held-out data: {vaf}; residual rms {rms} {unit}; "
        f"relative error {fit.estimate.relative_error_percent:.2f} % of the fitted rows\n"
        f"accelerations from the {sources(fit.sources)}"
    )


def sources(names: Sequence[str]) -> str:
    """Where accelerations came from, in words."""
    words = {"accelerometer": "accelerometer", "angles": "robot's own angles (no accelerometer used)"}
    return " and the ".join(words.get(name, name) for name in sorted(set(names)))


def _load_rows(fits: Sequence[LoadFit]) -> tuple[list[str], list[str], list[list[str]]]:
    names, units, cells = [], [], []
    for name, place in _entries(fits[0]):
        quantities = [_pick(fit, place[0]) for fit in fits]
        names.append(name)
        units.append("mm" if place[0] == "x0" else quantities[0].unit)
        scale = 1e3 if place[0] == "x0" else 1.0
        row: list[str] = []
        for quantity in quantities:
            value, ci = float(quantity.value[place[1]]) * scale, quantity.ci95[place[1]] * scale
            row += [number(value, ci), interval(ci)]
        cells.append(row)
    return names, units, cells


def _entries(fit: LoadFit) -> list[tuple[str, tuple[str, tuple[int, ...]]]]:
    """The entries worth a row: (label, (quantity, index)); a symmetric or scalar matrix shows each number once."""
    places: list[tuple[str, tuple[str, tuple[int, ...]]]] = []
    if fit.model.name == "mass-spring":
        places.append(("m", ("M", (0, 0))))
        places += [(n, ("K", i)) for n, i in (("kxx", (0, 0)), ("kyy", (1, 1)), ("ks", (0, 1)))]
    else:
        for letter in "MBK":
            places += [
                (f"{letter.lower()}{_AXES[i]}{_AXES[j]}", (letter, (i, j))) for i in range(2) for j in range(2)
            ]
    return [*places, ("x0", ("x0", (0,))), ("y0", ("x0", (1,)))]


def _pick(fit: LoadFit, name: str) -> Quantity:
    quantity = {"M": fit.M, "B": fit.B, "K": fit.K, "x0": fit.x0}[name]
    if quantity is None:
        raise KeyError(name)
    return quantity
