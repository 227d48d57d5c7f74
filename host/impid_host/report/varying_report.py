"""Impedance as curves: a table, JSON, and one line of words."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.table import Table

from impid_host.impedance.varying.bands import Band
from impid_host.impedance.varying.fit import VaryingFit
from impid_host.report.fit_tables import plus_minus

_METHODS = {"virtual sensor": "method1", "physical sensor": "method2"}
_EFFECTS = {"K": "load.time_varying@load", "B": "load.time_varying@load", "x0": "load.drift@load"}


def effects(fit: VaryingFit) -> list[str]:
    """The catalogue's names of what changes, where it changes with time."""
    return list(dict.fromkeys(_EFFECTS[group] for group in fit.claimed)) if fit.by == "time" else []


def group_of(name: str) -> str:
    """K, B or x0 for a curve's name."""
    return "x0" if name.endswith("0") else name[0].upper()


def shown_in(unit: str) -> tuple[float, str]:
    """Factor and unit for people: places in millimetres."""
    return (1e3, "mm") if unit == "m" else (1.0, unit)


def varying_line(fit: VaryingFit) -> str:
    """What the data ask for, in a sentence."""
    where = ", ".join(fit.trials)
    vaf = " and ".join(
        f"{a:.1f} to {b:.1f} %" for a, b in zip(fit.vaf_constant, fit.vaf_varying, strict=True)
    )
    ways = "; ".join(
        f"{one.group} {'changes' if one.group in fit.claimed else 'may be constant'} (p {_p(one.p_value)})"
        for one in fit.asked
    )
    name = "".join(f"{effect}: " for effect in effects(fit))
    return f"{where}, {fit.method}, with {fit.by}: {ways}. {name}VAF on blocks left out {vaf}."


def varying_table(fit: VaryingFit) -> Table:
    """Each curve at five places with the half width of its band there."""
    places = np.linspace(0, len(fit.places) - 1, 5).round().astype(int)
    table = Table(title=varying_line(fit), title_justify="left")
    table.add_column("curve")
    for k in places:
        table.add_column(f"{fit.places[k]:.4g} {fit.unit}".strip(), justify="right")
    table.add_column("unit")
    for name, own in fit.curves.items():
        scale, unit = shown_in(own.unit)
        ends = scale * np.stack([own.low, own.high], axis=1)
        cells = [plus_minus(scale * float(own.value[k]), ends[k]) for k in places]
        table.add_row(name, *cells, unit)
    for name, own in fit.M.items():
        cell = plus_minus(float(own.value[0]), np.array([own.low[0], own.high[0]]))
        table.add_row(f"{name} (constant)", cell, *[""] * (len(places) - 1), own.unit)
    return table


def varying_json(fits: Sequence[VaryingFit]) -> list[dict[str, Any]]:
    """One entry for each load, method and, by time, trial; bands hold the whole curve with 95 %."""
    return [
        {
            "load": fit.load,
            "method": _METHODS[fit.method],
            "trials": list(fit.trials),
            "by": fit.by,
            "unit": fit.unit,
            "places": fit.places.tolist(),
            "constant": {name: _plain(own, 0) for name, own in fit.M.items()},
            "curves": {name: _band(own) for name, own in fit.curves.items()},
            "asked": {
                one.group: {"p_value": one.p_value, "gain": one.gain, "changes": one.group in fit.claimed}
                for one in fit.asked
            },
            "lengths": {
                name: {"value": own[0], "ci95": [own[1], own[2]], "unit": fit.unit}
                for name, own in fit.lengths.items()
            },
            "effects": effects(fit),
            "vaf_constant": fit.vaf_constant.tolist(),
            "vaf_varying": fit.vaf_varying.tolist(),
        }
        for fit in fits
    ]


def _band(own: Band) -> dict[str, Any]:
    return {
        "value": own.value.tolist(),
        "low": own.low.tolist(),
        "high": own.high.tolist(),
        "sd": own.sd.tolist(),
        "unit": own.unit,
    }


def _plain(own: Band, k: int) -> dict[str, Any]:
    return {"value": float(own.value[k]), "ci95": [float(own.low[k]), float(own.high[k])], "unit": own.unit}


def _p(value: float) -> str:
    return f"{value:.2g}" if value > 1e-4 else "below 0.0001"
