"""The number that is read off is the one that was put in, by physics written down here a second time.

Each effect is put into a trial by its own equation, not by its columns; a regression of what is left on the
columns then says, to first order in a small effect, how large it is.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from impid_host.diagnosis.base import targets
from impid_host.effects.catalogue import terms
from impid_host.effects.effect import Term
from impid_host.effects.view import ANGLE, SPECIFIC_FORCE, View
from scipy.interpolate import CubicSpline

from .apparatus import INSIDE, L1, L2, MOUNT_RAD, apparatus, by_name

Change = Callable[[View], View]


@dataclass(frozen=True)
class Put:
    """An effect put into a trial.

    Attributes:
        trial: which; parameters: what must be read.
    """

    effect: str
    where: tuple[str, ...]
    change: Change
    parameters: dict[str, float | list[float] | list[list[float]]]
    trial: str = "free_01"
    kind: str = "all instruments"
    variant: str | None = None
    rel: float = 0.02


def late(values: np.ndarray, t: np.ndarray, delay: float) -> np.ndarray:
    return CubicSpline(t, values)(t - delay)


def torque(make: Callable[[View], np.ndarray]) -> Change:
    """Added to the logged torque."""
    return lambda view: replace(view, tau=view.tau + make(view))


def first(column: np.ndarray) -> np.ndarray:
    return np.stack([column, 0 * column], axis=1)


def lifted(view: View, force: np.ndarray) -> np.ndarray:
    """Joint torques that a force at the tip asks for, by virtual work in complex numbers."""
    f = force[:, 0] + 1j * force[:, 1]
    e1, e2 = 1j * L1 * np.exp(1j * view.theta[:, 0]), L2 * np.exp(1j * view.theta[:, 1])
    return np.stack([(np.conj(e1) * f).real, (np.conj(e2) * f).real], axis=1)


def loaded(make: Callable[[View], np.ndarray]) -> Change:
    """Added to -F_ext of the load, which drives and sensor feel alike."""

    def change(view: View) -> View:
        more = make(view)
        assert view.force is not None
        return replace(view, tau=view.tau + lifted(view, more), force=view.force - more)

    return change


def felt(make: Callable[[View, np.ndarray], np.ndarray]) -> Change:
    """What an accelerometer reads of the specific force (N, 2) along its axes."""

    def change(view: View) -> View:
        assert view.measured is not None
        return replace(view, measured=make(view, view.measured))

    return change


def sensed(make: Callable[[View, np.ndarray], np.ndarray]) -> Change:
    """What a force sensor reads of the force (N, 2) on it."""

    def change(view: View) -> View:
        assert view.force is not None
        return replace(view, force=make(view, view.force))

    return change


def lever(view: View, felt: np.ndarray) -> np.ndarray:
    """A sensor (0.02, 0.01) m off the tip along its axes: z'' of l exp(i (theta2 + mount)), turned back."""
    arm = 0.02 + 0.01j
    z = arm * (1j * view.acc[:, 1] - view.omega[:, 1] ** 2)
    assert MOUNT_RAD
    return felt + np.stack([z.real, z.imag], axis=1)


def turned(angle: float) -> Callable[[View, np.ndarray], np.ndarray]:
    """Axes that stand `angle` further read the vector turned back."""

    def change(_view: View, vector: np.ndarray) -> np.ndarray:
        z = (vector[:, 0] + 1j * vector[:, 1]) * np.exp(-1j * angle)
        return np.stack([z.real, z.imag], axis=1)

    return change


def dry(view: View, torque_nm: float) -> np.ndarray:
    return torque_nm * np.sign(view.omega[:, 0])


def drifting(view: View) -> View:
    """The robot's rows are late by 1 ms P_2(time), less the line that a match of the angles takes out."""
    u = 2 * view.t / view.t[-1] - 1
    path = 0.5 * (3 * u**2 - 1)
    delay = 1e-3 * (path - np.polyval(np.polyfit(u, path, 1, w=np.linalg.norm(view.omega, axis=1)), u))
    assert view.theta_robot is not None

    def moved(values: np.ndarray) -> np.ndarray:
        return CubicSpline(view.t, values)(view.t - delay)

    return replace(view, tau=moved(view.tau), theta_robot=moved(view.theta_robot))


SPRING, HAND = "spring_A_01", "hand_01"
CASES = [
    Put("actuator.gain", ("joint1",), lambda v: replace(v, tau=v.tau / [1.01, 1.0]), {"gain": 1.01}),
    Put("actuator.offset", ("joint1",), torque(lambda v: first(np.full(len(v.t), 0.03))), {"torque": 0.03}),
    Put(
        "actuator.delay",
        ("joint1", "joint2"),
        lambda v: replace(v, tau=late(v.tau, v.t, 2e-3)),
        {"delay": [2e-3, 2e-3]},
    ),
    Put(
        "actuator.lag",
        ("joint1", "joint2"),
        # The log is what the drive was asked for; its torque follows by (1 + T d/dt) torque = log.
        lambda v: replace(v, tau=v.tau + 2e-3 * CubicSpline(v.t, v.tau)(v.t, 1)),
        {"time_constant": [2e-3, 2e-3]},
    ),
    Put(
        "actuator.cogging",
        ("joint1",),
        torque(lambda v: first(0.02 * np.sin(2 * np.pi * 3.7 * v.theta[:, 0] + 0.4))),
        {"amplitude": 0.02, "cycles_per_rad": 3.7, "phase_rad": 0.4},
    ),
    Put("friction.coulomb", ("joint1",), torque(lambda v: first(dry(v, 0.05))), {"torque": 0.05}),
    Put(
        "friction.stribeck",
        ("joint1",),
        torque(lambda v: first(dry(v, 0.05) * np.exp(-((v.omega[:, 0] / 0.3) ** 2)))),
        {"torque": 0.05, "speed": 0.3},
        rel=0.05,
    ),
    Put(
        "friction.asymmetric",
        ("joint1",),
        torque(lambda v: first(np.where(v.omega[:, 0] > 0, 0.06, -0.04))),
        {"torque_pos": 0.06, "torque_neg": 0.04},
        variant="",
    ),
    Put(
        "friction.quadratic",
        ("joint1",),
        torque(lambda v: first(0.02 * v.omega[:, 0] * np.abs(v.omega[:, 0]))),
        {"coefficient": 0.02},
    ),
    Put(
        "friction.load",
        ("joint1",),
        torque(lambda v: first(0.05 * np.abs(v.tau[:, 0]) * np.sign(v.omega[:, 0]))),
        {"coefficient": 0.05},
        trial=SPRING,
    ),
    Put(
        "elastic.joint",
        ("joint1",),
        torque(lambda v: first(2.0 * (v.theta[:, 0] - 0.6))),
        {"stiffness": 2.0, "rest_rad": 0.6},
    ),
    Put(
        "elastic.cartesian",
        ("tip",),
        torque(lambda v: lifted(v, (v.x - [0.3, 0.1]) @ np.array([[40.0, 5.0], [5.0, 20.0]]))),
        {"kx": 40.0, "ky": 20.0, "x0": 0.3, "y0": 0.1, "kxy": 5.0},
        variant="xy",
    ),
    Put(
        "damping.cartesian",
        ("tip",),
        torque(lambda v: lifted(v, v.v * [3.0, 1.5])),
        {"bx": 3.0, "by": 1.5},
    ),
    Put(
        "inertia.extra",
        ("tip",),
        torque(lambda v: lifted(v, 0.2 * v.a)),
        {"mass": 0.2},
        trial=SPRING,
    ),
    Put("accel.scale", ("x",), felt(lambda _v, f: f * [1.02, 1.0]), {"gain": 1.02}),
    Put("accel.bias", ("x", "y"), felt(lambda _v, f: f + np.array([0.3, -0.2])), {"bias": [0.3, -0.2]}),
    Put("accel.cross_axis", ("y",), felt(lambda _v, f: f + first(f[:, 0])[:, ::-1] * 0.02), {"cross": 0.02}),
    Put("accel.misalignment", ("sensor",), felt(turned(0.01)), {"angle_rad": 0.01}),
    Put("accel.delay", ("sensor",), felt(lambda v, f: late(f, v.t, 1e-3)), {"delay": 1e-3}),
    Put("accel.lever_arm", ("sensor",), felt(lever), {"lever": [0.02, 0.01]}),
    Put(
        "force.scale", ("x", "y"), sensed(lambda _v, f: f * [1.01, 0.99]), {"gain": [1.01, 0.99]}, trial=HAND
    ),
    Put("force.misalignment", ("sensor",), sensed(turned(0.01)), {"angle_rad": 0.01}, trial=HAND),
    Put(
        "force.cross_axis",
        ("x",),
        sensed(lambda _v, f: f + first(f[:, 1]) * 0.02),
        {"cross": 0.02},
        trial=HAND,
    ),
    Put(
        "force.bias",
        ("x", "y"),
        sensed(lambda _v, f: f + np.array([0.5, -0.3])),
        {"bias": [0.5, -0.3]},
        trial=HAND,
        variant="",
    ),
    Put("force.delay", ("sensor",), sensed(lambda v, f: late(f, v.t, 2e-3)), {"delay": 2e-3}, trial=HAND),
    Put(
        "load.damping",
        ("load",),
        loaded(lambda v: 3.0 * v.v),
        {"B": 3.0},
        trial=SPRING,
        variant="equal in x and y",
    ),
    Put(
        "load.stiffness_cubic",
        ("load",),
        loaded(lambda v: 4e3 * (v.x - v.x0) ** 3),
        {"cubic": [4e3, 4e3]},
        trial=SPRING,
        variant="x and y",
    ),
    Put(
        "load.coupling",
        ("load",),
        loaded(lambda v: (v.x - v.x0) @ np.array([[0.0, 12.0], [-12.0, 0.0]]).T),
        {"K": [[0.0, 12.0], [-12.0, 0.0]]},
        trial=SPRING,
        variant="K",
    ),
    Put(
        "load.drift",
        ("load",),
        loaded(lambda v: -((v.t - 0.5 * v.t[-1])[:, None] * [1e-3, -5e-4]) @ v.K.T),
        {"rate": [1e-3, -5e-4]},
        trial=SPRING,
        variant="",
    ),
    Put("clock.drift", ("sensor",), drifting, {"seconds": 1e-3}, variant="degree 2 each"),
]


def term_of(put: Put) -> Term:
    found = [
        term
        for term in terms(apparatus(put.kind).setting)
        if (term.effect, term.where, term.when)
        == (
            put.effect,
            put.where,
            "all" if put.where != ("tip",) or put.effect != "inertia.extra" else "load",
        )
        and put.variant in (None, term.variant)
        and set(put.parameters) == set(term.read(np.full(term.size, 0.1), term.shapes[0]))
    ]
    assert found, put.effect
    return next((term for term in found if not term.own), found[0])


def estimate(view: View, term: Term, shape: float) -> tuple[np.ndarray, float]:
    """Least squares of what is left on the columns, each family by its size; and the share that remains."""
    assert view.respond is not None
    answer = view.respond(view)
    columns = term.columns(view, shape)
    rows, left = [], []
    for family, measured in targets(view).items():
        if family not in columns:
            continue
        model = 0.0 if family in (ANGLE, SPECIFIC_FORCE) else answer[family]
        rest = (measured - model)[INSIDE]
        scale = float(np.std(rest)) + 1e-12
        left.append(rest.reshape(-1) / scale)
        rows.append(columns[family][INSIDE].reshape(-1, term.size) / scale)
    X, y = np.concatenate(rows), np.concatenate(left)
    used = np.any(X != 0, axis=0)
    beta = np.zeros(term.size)
    size = np.linalg.norm(X[:, used], axis=0)
    beta[used] = np.linalg.lstsq(X[:, used] / size, y, rcond=1e-12)[0] / size
    return beta, float(np.sum((y - X @ beta) ** 2) / np.sum(y**2))


@pytest.mark.parametrize("put", CASES, ids=lambda put: f"{put.effect}@{'+'.join(put.where)}")
def test_what_was_put_in_is_read_off(put: Put) -> None:
    view = put.change(by_name(apparatus(put.kind).views, put.trial))
    term = term_of(put)
    shape = term.shapes[0]
    if term.shaped and not term.fine:
        shape = next(v for k, v in put.parameters.items() if k in ("cycles_per_rad", "speed"))  # type: ignore[assignment]
    beta, remains = estimate(view, term, shape)
    assert remains < 0.02
    found = term.read(beta, shape)
    for name, truth in put.parameters.items():
        own = found[name]
        value = own[put.trial] if isinstance(own, dict) else own
        first_order = 5e-4 if isinstance(truth, float) and abs(truth) > 0.5 else 1e-9
        assert np.asarray(value) == pytest.approx(np.asarray(truth), rel=put.rel, abs=first_order), name


EXACT = [put for put in CASES if put.effect not in ("clock.drift",) and term_of(put).undo is not None]


@pytest.mark.parametrize("put", EXACT, ids=lambda put: f"{put.effect}@{'+'.join(put.where)}")
def test_what_was_put_in_is_taken_out_exactly(put: Put) -> None:
    """By the undoing at the true value: better by far than the first order that finds it."""
    plain = by_name(apparatus(put.kind).views, put.trial)
    view, term = put.change(plain), term_of(put)
    beta, _ = estimate(view, term, term.shapes[0])
    for _ in range(4):
        assert term.undo is not None
        again = term.undo(view, beta, term.shapes[0])
        more, _ = estimate(again, term, term.shapes[0])
        beta = beta + more
    assert term.undo is not None
    whole = targets(term.undo(view, beta, term.shapes[0]))
    for family, truth in targets(plain).items():
        size = float(np.abs(targets(view)[family] - truth)[INSIDE].max())
        assert np.abs(whole[family] - truth)[INSIDE].max() < 0.01 * size + 1e-9, family
