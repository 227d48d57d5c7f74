"""A limb's impedance without and with its stretch reflex, as a table and as JSON."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.table import Table

from impid_host.impedance.reflex import Band, ReflexFit

Reflexes = Mapping[str, tuple[ReflexFit, Band]]


def reflex_table(found: Reflexes) -> Table:
    """One row for each trial, VAF on held-out data."""
    table = Table(
        title="Impedance of the joint, without and with a late stretch reflex", title_justify="left"
    )
    for heading in (
        "trial",
        "band\nHz",
        "I, B, K",
        "VAF\n%",
        "I, B, K\nbeside the reflex",
        "gain +, -\nN m s/rad",
    ):
        table.add_column(heading, overflow="fold")
    for heading in ("delay\nms", "muscle\nHz", "VAF\n%"):
        table.add_column(heading, justify="right")
    for name, (fit, band) in found.items():
        table.add_row(
            name,
            f"{band.low_Hz:.2f} to {band.high_Hz:.0f}",
            "{:.4f}, {:.3f}, {:.1f}".format(*fit.intrinsic),
            f"{fit.vaf_intrinsic:.1f}",
            "{:.4f}, {:.3f}, {:.1f}".format(*fit.with_reflex),
            "{:.2f}, {:.2f}".format(*fit.gain),
            f"{1e3 * fit.delay_s:.0f}",
            f"{fit.corner_rad_s / (2 * np.pi):.1f}",
            f"{fit.vaf_reflex:.1f}",
        )
    return table


def reflex_json(found: Reflexes) -> dict[str, Any]:
    """By trial; kg m^2, N m s/rad, N m/rad, s, rad/s, %."""
    return {
        name: {
            "band_Hz": [band.low_Hz, band.high_Hz],
            "without": {
                "I": fit.intrinsic[0],
                "B": fit.intrinsic[1],
                "K": fit.intrinsic[2],
                "vaf": fit.vaf_intrinsic,
            },
            "with": {
                "I": fit.with_reflex[0],
                "B": fit.with_reflex[1],
                "K": fit.with_reflex[2],
                "gain_positive": fit.gain[0],
                "gain_negative": fit.gain[1],
                "delay_s": fit.delay_s,
                "corner_rad_s": fit.corner_rad_s,
                "vaf": fit.vaf_reflex,
            },
        }
        for name, (fit, band) in found.items()
    }
