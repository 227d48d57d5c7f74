"""A limb's impedance without and with its stretch reflex, as a table and as JSON."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.table import Table

from impid_host.impedance.reflex import Band, Number, ReflexFit
from impid_host.impedance.reflex_path import DELAY_S

Reflexes = Mapping[str, tuple[ReflexFit, Band]]


def reflex_table(found: Reflexes) -> Table:
    """One row for each quantity and trial, VAF on held-out data."""
    table = Table(
        title="Impedance of the joint, without and with a late stretch reflex (+- 95 %)", title_justify="left"
    )
    for heading in ("trial", "quantity", "without", "with the reflex", "unit"):
        table.add_column(heading, overflow="fold")
    for name, (fit, band) in found.items():
        table.add_row(name, "band", f"{band.low_Hz:.2f} to {band.high_Hz:.0f}", "", "Hz")
        for label, plain, rich, unit in zip(
            ("I", "B", "K"),
            fit.intrinsic,
            fit.with_reflex,
            ("kg*m^2", "N*m*s/rad", "N*m/rad"),
            strict=True,
        ):
            table.add_row("", label, _plus_minus(plain), _plus_minus(rich), unit)
        for label, number in zip(("gain to stretch +", "gain to stretch -"), fit.gain, strict=True):
            table.add_row("", label, "", _plus_minus(number), "N*m*s/rad")
        delay, muscle = _scaled(fit.delay_s, 1e3), _scaled(fit.corner_rad_s, 0.5 / np.pi)
        open_end = (
            "" if fit.delay_determined else f" (reaches {1e3 * DELAY_S[0]:.0f} or {1e3 * DELAY_S[1]:.0f})"
        )
        table.add_row(
            "", "delay", "", f"{delay.value:.1f} [{delay.low:.1f}, {delay.high:.1f}]{open_end}", "ms"
        )
        table.add_row("", "muscle", "", f"{muscle.value:.2f} [{muscle.low:.2f}, {muscle.high:.2f}]", "Hz")
        table.add_row("", "VAF", f"{fit.vaf_intrinsic:.1f}", f"{fit.vaf_reflex:.1f}", "%")
        table.add_row("", "VAF, spring and damper not straight", "", f"{fit.vaf_curved:.1f}", "%")
        word = "a reflex" if fit.claimed else "no reflex is asked for"
        table.add_row("", "is there one?", "", f"{word} (p {fit.p_value:.2g})", "")
    return table


def reflex_json(found: Reflexes) -> dict[str, Any]:
    """By trial; kg m^2, N m s/rad, N m/rad, s, rad/s, %; `ci95` beside each."""
    return {
        name: {
            "band_Hz": [band.low_Hz, band.high_Hz],
            "without": _values(zip("IBK", fit.intrinsic, strict=True)) | {"vaf": fit.vaf_intrinsic},
            "with": _values(
                [
                    *zip("IBK", fit.with_reflex, strict=True),
                    ("gain_positive", fit.gain[0]),
                    ("gain_negative", fit.gain[1]),
                    ("delay_s", fit.delay_s),
                    ("corner_rad_s", fit.corner_rad_s),
                ]
            )
            | {"vaf": fit.vaf_reflex, "vaf_curved": fit.vaf_curved},
            "p_value": fit.p_value,
            "claimed": fit.claimed,
            "delay_determined": fit.delay_determined,
        }
        for name, (fit, band) in found.items()
    }


def _values(numbers: Any) -> dict[str, Any]:
    rows = list(numbers)
    return {name: own.value for name, own in rows} | {
        "ci95": {name: [own.low, own.high] for name, own in rows}
    }


def _scaled(own: Number, factor: float) -> Number:
    return Number(factor * own.value, factor * own.low, factor * own.high)


def _plus_minus(own: Number) -> str:
    return f"{own.value:.4g} +- {0.5 * (own.high - own.low):.2g}"
