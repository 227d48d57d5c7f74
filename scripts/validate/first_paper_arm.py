"""The first paper's arm: Table V, and what the paper did not do: constraints, ellipses, shoulder and elbow."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from campaign import Row, cells
from impid_host.impedance.campaign import Options, StudyFit, fit_study
from impid_host.impedance.constrained import constrain
from impid_host.impedance.identify import LoadFit
from impid_host.impedance.joint_space import Limb, joint_impedance
from impid_host.impedance.matrices import Quantity
from impid_host.report.ellipses import ellipse_figure
from impid_host.study.folder import read_study
from markdown import mean_sd, table

CORNERS = ("xx", "xy", "yx", "yy")
METHODS = {"virtual sensor": "method1", "physical sensor": "method2"}
# The paper puts the hand 0.5 m in front of the shoulder and gives no limb lengths; these are ours.
LIMB = Limb(upper_m=0.30, fore_m=0.33, shoulder_m=(0.382, -0.492))
_QUANTITIES = {"M": "kg", "K": "N/m"}


def arm_numbers(rows: Sequence[Row]) -> dict[str, Any]:
    """Mean and scatter over the five trials, per method."""
    keys = [f"{letter}{corner}" for letter in "mbk" for corner in CORNERS] + ["x0_mm", "y0_mm"]
    out: dict[str, Any] = {}
    for method in METHODS.values():
        out[method] = cells(rows, method, keys)
        out[method]["vaf"] = np.mean([r.vaf for r in rows if r.method == method], axis=0).tolist()
    return out


def pooled(study: Path, figure: Path) -> dict[str, Any]:
    """All five trials in one fit: unconstrained, constrained, in joints; draws the ellipses."""
    fit: StudyFit = fit_study(read_study(study), Options())
    handle = fit.handle_mass_kg
    loads = [load for load in fit.loads if load.load == "arm"]
    drawn = ellipse_figure(loads, handle)
    drawn.set_layout_engine("constrained")
    drawn.savefig(figure, dpi=180)
    return {METHODS[load.method]: _pooled(load, handle) for load in loads}


def _pooled(load: LoadFit, handle: float) -> dict[str, Any]:
    tight, joints = constrain(load, handle), joint_impedance(load, LIMB, handle)
    return {
        "unconstrained": {"M": _numbers(load.M), "K": _numbers(load.K)},
        "constrained": {"M": _numbers(tight.matrices.M), "K": _numbers(tight.matrices.K)},
        "symmetry_chi2": tight.chi2,
        "symmetry_p": tight.p_value,
        "verdict": tight.verdict,
        "joints": {
            "posture_deg": np.rad2deg(joints.posture).tolist(),
            "inertia_kg_m2": _numbers(joints.inertia),
            "stiffness_Nm_per_rad": _numbers(joints.stiffness),
        },
    }


def _numbers(quantity: Quantity) -> dict[str, Any]:
    return {"value": quantity.value.tolist(), "ci95": quantity.ci95.tolist()}


def arm_part(five: dict[str, Any], truth: dict[str, Any], published: dict[str, Any]) -> list[str]:
    """Table V, line by line."""
    rows, ratios = [], []
    for letter in "MBK":
        for k, corner in enumerate(CORNERS):
            i, j = divmod(k, 2)
            row = [f"{letter.lower()}{corner}", f"{truth[letter][i][j]:.3f}"]
            for method in METHODS.values():
                paper = published[method]
                ours = five["default"][method][f"{letter.lower()}{corner}"]
                ratios.append(paper[f"{letter}_sd"][i][j] / ours[1])
                row += [mean_sd(paper[letter][i][j], paper[f"{letter}_sd"][i][j]), mean_sd(*ours)]
            rows.append(row)
    for k, name in enumerate(("x0", "y0")):
        row = [f"{name} (mm)", f"{1e3 * truth['x0'][k]:.0f}"]
        for method in METHODS.values():
            row.append(mean_sd(published[method]["xv_mm"][k], published[method]["xv_sd_mm"][k]))
            row.append(mean_sd(*five["default"][method][f"{name}_mm"]))
        rows.append(row)
    vaf = ["VAF x, y (%)", ""]
    for method in METHODS.values():
        vaf.append(", ".join(str(v) for v in published[method]["vaf"]))
        vaf.append(", ".join(f"{v:.2f}" for v in five["default"][method]["vaf"]))
    head = ["", "simulated truth", "Method 1, paper", "Method 1, ours", "Method 2, paper", "Method 2, ours"]
    return [
        "## Table V: the arm",
        "",
        "Mean ± standard deviation of five trials fitted alone, the handle's 0.135 kg taken off; kg, N s/m, N/m. "
        "The simulated arm has the paper's Method 2 values, made symmetric. It does not tire, keeps its equilibrium and "
        f"has no reflexes; the paper's scatter of M, B and K is {min(ratios):.0f} to {max(ratios):.0f} times ours.",
        "",
        *table(head, [*rows, vaf]),
        "",
    ]


def beyond_part(numbers: dict[str, Any], truth: dict[str, Any]) -> list[str]:
    """Constrained beside unconstrained, ellipses, joint space."""
    rows = []
    for letter, unit in _QUANTITIES.items():
        for k, corner in enumerate(CORNERS):
            i, j = divmod(k, 2)
            row = [f"{letter.lower()}{corner} ({unit})", f"{truth[letter][i][j]:.3f}"]
            for method in METHODS.values():
                row += [
                    _cell(numbers[method][kind][letter], i, j) for kind in ("unconstrained", "constrained")
                ]
            rows.append(row)
    head = ["", "truth"]
    for label in ("Method 1", "Method 2"):
        head += [f"{label}, unconstrained", f"{label}, symmetric and positive definite"]
    limb = f"{LIMB.upper_m:g},{LIMB.fore_m:g}"
    shoulder = f"{LIMB.shoulder_m[0]:g},{LIMB.shoulder_m[1]:g}"
    J = LIMB.jacobian(LIMB.posture(np.array(truth["x0"])))
    joints = []
    for key, letter, name in (
        ("inertia_kg_m2", "M", "inertia (kg m²)"),
        ("stiffness_Nm_per_rad", "K", "stiffness (N m/rad)"),
    ):
        true = J.T @ np.array(truth[letter]) @ J
        for k, where in enumerate(("shoulder", "shoulder, elbow", "elbow, shoulder", "elbow")):
            i, j = divmod(k, 2)
            own = (_cell(numbers[method]["joints"][key], i, j) for method in METHODS.values())
            joints.append([f"{name}, {where}", f"{true[i, j]:.4f}", *own])
    return [
        "## The arm, further",
        "",
        "All five trials in one fit, value [95 % interval]. Constrained M and K stand beside the unconstrained ones, "
        f"not instead. Method 1: {numbers['method1']['verdict']}. Method 2: {numbers['method2']['verdict']}.",
        "",
        *table(head, rows),
        "",
        "![Stiffness, damping and inertia ellipses](first_paper_ellipses.png)",
        "",
        f"In the joints of an arm of {LIMB.upper_m:g} m and {LIMB.fore_m:g} m whose shoulder is 0.5 m from the hand "
        "(lengths ours; the paper gives none), by JᵀKJ and JᵀMJ at the equilibrium:",
        "",
        *table(["", "truth", "Method 1", "Method 2"], joints),
        "",
        "From the command line: `impid-host fit build/validate/dyck-2013-arm --constrain "
        f"--limb {limb} --shoulder {shoulder} --figures figures/ --json arm.json`.",
        "",
    ]


def _cell(entry: dict[str, Any], i: int, j: int) -> str:
    low, high = entry["ci95"][i][j]
    digits = int(np.clip(2 - np.floor(np.log10(max(high - low, 1e-6))), 0, 6))
    return f"{entry['value'][i][j]:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"
