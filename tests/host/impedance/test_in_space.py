"""Impedance in space: full 3 x 3 matrices, and what of them a motion in a plane shows."""

from pathlib import Path

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import identify_load
from impid_host.impedance.loads import arm
from impid_host.impedance.partial import identify_partially
from impid_host.impedance.rows import Split
from impid_host.report.ellipses import ellipse_figure, shadow
from impid_host.signals.align import AlignedTrial
from impid_host.signals.chain import DEFAULT, erode

AXES = ("x", "y", "z")
RATE = 100.0
M = np.array([[1.4, 0.2, 0.1], [0.2, 1.1, -0.1], [0.1, -0.1, 1.7]])
B = np.array([[14.0, 2.0, 1.0], [1.0, 9.0, -2.0], [0.5, 1.5, 11.0]])
K = np.array([[220.0, 40.0, 15.0], [30.0, 130.0, -25.0], [10.0, -20.0, 180.0]])
X0 = np.array([0.4, 0.1, -0.2])


def trial(seed: int, *, flat: bool = False) -> AlignedTrial:
    """A hand that is moved along all three axes, or in the plane z = x / 2 alone."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 40.0, 1 / RATE)
    w, p = 2 * np.pi * rng.uniform(0.1, 3.0, (3, 12)), rng.uniform(0, 2 * np.pi, (3, 12))
    if flat:
        w[2], p[2] = w[0], p[0]
    angle = t[:, None, None] * w + p
    size = 0.005 * np.array([1.0, 1.0, 0.5 if flat else 1.0])
    x = X0 + 0.002 + size * np.sin(angle).sum(axis=2)
    v, a = size * (w * np.cos(angle)).sum(axis=2), -size * (w**2 * np.sin(angle)).sum(axis=2)
    load = a @ M.T + v @ B.T + (x - X0) @ K.T + rng.normal(0, 0.05, x.shape)
    none = np.zeros_like(x)
    return AlignedTrial(
        name=f"arm_{seed}", kind="arm", load="arm", t=t, rate_hz=RATE, theta=none, omega=none, theta_dd=none,
        tau=none, force=-load, perturbation=None, x=x, v=v, a=a,
        valid=erode(np.ones(len(t), dtype=bool), int(RATE)), source="angles", clock=None,
    )  # fmt: skip


def test_all_of_three_by_three() -> None:
    fit = identify_load([trial(1)], arm(AXES), DEFAULT, Split(), robot=None, handle_mass_kg=0.0)
    assert fit.B is not None
    inside = []
    for found, true in ((fit.M, M), (fit.B, B), (fit.K, K)):
        assert found.value == pytest.approx(true, abs=0.06 * np.abs(true).max())
        inside.append((found.ci95[..., 0] <= true) & (true <= found.ci95[..., 1]))
    # Of 27 intervals of 95 % some four may miss (probability 0.05 of fewer than 24).
    assert np.sum(inside) >= 23
    assert fit.x0.value == pytest.approx(X0, abs=5e-4)


def test_a_motion_in_a_plane_gives_what_it_determines() -> None:
    flat, load = trial(2, flat=True), arm(AXES)
    with pytest.raises(UndeterminedError) as error:
        identify_load([flat], load, DEFAULT, Split(), robot=None, handle_mass_kg=0.0)
    part = identify_partially([flat], load, DEFAULT, Split(), robot=None, error=error.value)
    found = dict(zip(part.estimate.names, part.estimate.value, strict=True))
    # x and z move as one there: of K, K x0 along x what lies across is open, kxx + kxz / 2 is not.
    assert found["kxy"] == pytest.approx(40.0, abs=3.0)
    assert found["kyy"] == pytest.approx(130.0, abs=3.0)
    (first,) = (value for name, value in found.items() if name.startswith("kxx"))
    (second,) = (value for name, value in found.items() if name.startswith("kxz"))
    assert first + 0.5 * second == pytest.approx(220.0 + 0.5 * 15.0, abs=4.0)


def test_shadows_of_an_ellipsoid() -> None:
    """The shadow of a ball's image reaches as far along an axis as that row of the matrix is long."""
    outline = shadow(np.diag([3.0, 2.0, 1.0]), (0, 2), 721)
    assert np.abs(outline).max(axis=0) == pytest.approx([3.0, 1.0], rel=1e-4)
    symmetric = 0.5 * (K + K.T)
    outline = shadow(K, (1, 2), 7201)
    assert np.abs(outline).max(axis=0) == pytest.approx(np.linalg.norm(symmetric[[1, 2]], axis=1), rel=1e-4)


def test_ellipsoids_are_drawn(tmp_path: Path) -> None:
    fit = identify_load([trial(3)], arm(AXES), DEFAULT, Split(), robot=None, handle_mass_kg=0.0)
    figure = ellipse_figure([fit])
    assert [panel.get_xlabel() for panel in figure.axes[::3]] == ["along x", "along x", "along y"]
    assert [panel.get_ylabel() for panel in figure.axes[::3]] == ["along y", "along z", "along z"]
    figure.savefig(tmp_path / "ellipsoids.png")
