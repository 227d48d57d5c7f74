"""What setup.toml says where nothing is wrong with it."""

from __future__ import annotations

from .effects.base import Declared
from .laboratory import Laboratory


def declared(lab: Laboratory) -> Declared:
    """The true setup, as setup.toml has it."""
    ins = lab.instruments
    arms = [p.load for p in lab.plans if p.load is not None and p.load.kind == "arm"]
    setup: Declared = {
        "robot": {"model": "planar-2r-absolute", "link_lengths_m": [round(v, 7) for v in lab.robot.lengths]},
        "encoder": {
            "counts_per_rev": list(ins.counts),
            "zero_rad": [float(v) for v in ins.zero],
            "direction": list(ins.direction),
        },
        "accelerometer": {
            "part": "ADXL203",
            "vref_V": ins.vref,
            "full_scale_code": ins.full_scale_code,
            "zero_g_V": [float(v) for v in ins.zero_g],
            "sensitivity_V_per_g": [float(v) for v in ins.sensitivity],
            "mount": ins.mount,
            "mount_angle_rad": ins.mount_angle,
        },
        "handle": {"mass_kg": arms[0].handle if arms else 0.0},
    }
    if ins.force:
        setup["force_sensor"] = {
            "timing": ins.force_timing,
            "frame": ins.force_frame,
            "mount_angle_rad": ins.force_angle,
        }
    if lab.declared["tolerance"]:
        setup["tolerance"] = {"link_lengths_m": 0.001, "torque_gain": 0.05, "payload_kg": 0.002}
    if lab.declared["prior"]:
        setup["prior"] = {"alpha": [round(a, 6) for a in lab.robot.alpha]}
    return setup
