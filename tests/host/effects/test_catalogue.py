"""The catalogue is complete, and its columns are what mechanics says, worked out another way."""

import numpy as np
import pytest
from impid_host.effects.bounds import possible
from impid_host.effects.catalogue import CATALOGUE, telling_trial, terms
from impid_host.effects.effect import amplitude_phase
from impid_host.effects.friction import dahl, stop
from impid_host.effects.response import NODES_HZ, filtered
from impid_host.effects.structure import curve_basis
from impid_host.effects.view import advanced, rate_of, rotated
from impid_host.impedance.reflex_path import muscle
from impid_host.signals.direction import sign_mean

from .apparatus import apparatus

# The names of the diagnosis format, version 1.
NAMES = [
    "friction.coulomb",
    "friction.stribeck",
    "friction.asymmetric",
    "friction.quadratic",
    "friction.position",
    "friction.load",
    "friction.presliding",
    "elastic.cartesian",
    "elastic.joint",
    "elastic.transmission",
    "damping.cartesian",
    "gravity.tilt",
    "gravity.link",
    "inertia.extra",
    "actuator.gain",
    "actuator.offset",
    "actuator.cogging",
    "actuator.delay",
    "actuator.lag",
    "accel.misalignment",
    "accel.scale",
    "accel.bias",
    "accel.cross_axis",
    "accel.delay",
    "accel.lever_arm",
    "encoder.eccentricity",
    "encoder.zero",
    "encoder.scale",
    "clock.drift",
    "geometry.link_length",
    "load.damping",
    "load.stiffness_cubic",
    "load.hysteresis",
    "load.deadzone",
    "load.delay",
    "load.drift",
    "load.coupling",
    "load.time_varying",
    "force.scale",
    "force.misalignment",
    "force.cross_axis",
    "force.bias",
    "force.delay",
]


def test_every_name_of_the_format_is_a_row() -> None:
    assert set(NAMES) == set(CATALOGUE)


def tried(kind: str) -> set[str]:
    return {term.effect for term in terms(apparatus(kind).setting)}


def test_what_is_not_there_cannot_err() -> None:
    everything = tried("all instruments")
    families = {name.partition(".")[0] for name in everything}
    assert {"accel", "force", "clock", "geometry"} <= families
    assert not any(name.startswith("accel.") for name in tried("no accelerometer, one clock"))
    assert not any(name.startswith("force.") for name in tried("no force sensor, nothing known"))
    assert "clock.drift" not in tried("no accelerometer, one clock")
    assert not any(name.startswith("load.") for name in tried("free trials alone"))
    assert "actuator.gain" not in tried("torque at the load")


def test_a_single_axis_has_no_effects_of_the_plane() -> None:
    for kind in ("one joint", "one slide"):
        assert "friction.coulomb" in tried(kind)
        assert not tried(kind) & {
            "elastic.cartesian",
            "damping.cartesian",
            "gravity.tilt",
            "geometry.link_length",
        }
    # A linear encoder has no circle to be off centre on, and a slide no weight that its angle turns.
    assert not tried("one slide") & {"encoder.eccentricity", "encoder.zero", "gravity.link"}
    assert "gravity.link" in tried("one joint")


def test_units_are_those_of_the_axis() -> None:
    """On a slide torques are forces, on a rotary load forces are torques."""

    def unit(kind: str, effect: str, name: str) -> str:
        return next(t for t in terms(apparatus(kind).setting) if t.effect == effect).units[name]

    assert unit("all instruments", "friction.coulomb", "torque") == "N*m"
    assert unit("one slide", "friction.coulomb", "torque") == "N"
    assert unit("one slide", "friction.stribeck", "speed") == "m/s"
    assert unit("all instruments", "load.delay", "gain_k") == "N/m"
    assert unit("one joint", "load.delay", "gain_k") == "N*m/rad"
    assert unit("one joint", "load.delay", "gain_b") == "N*m*s/rad"


def test_what_drives_is_no_friction_and_what_pushes_apart_no_spring() -> None:
    everything = terms(apparatus("all instruments").setting)
    for effect, forward in (("friction.coulomb", 0.1), ("friction.quadratic", 0.1), ("friction.load", 0.1)):
        own = next(t for t in everything if t.effect == effect)
        assert possible(own, np.array([forward]), own.shapes[0])
        assert not possible(own, np.array([-forward]), own.shapes[0])
    spring = next(t for t in everything if t.effect == "elastic.joint")
    assert possible(spring, np.array([1.0, -0.5]), 0.0)
    assert not possible(spring, np.array([-1.0, -0.5]), 0.0)


def test_reversal_keeps_its_time_between_samples() -> None:
    # 0.3 dt after this instant the joint reverses: of the sample around it 0.8 go one way, 0.2 the other.
    dt, acc = 1e-3, 50.0
    assert sign_mean(np.array([-0.3 * dt * acc]), np.array([acc]), dt) == pytest.approx([-0.6])
    assert sign_mean(np.array([1.0]), np.array([acc]), dt) == pytest.approx([1.0])


def test_dahl_follows_its_closed_form() -> None:
    x = np.linspace(0, 0.01, 501)
    assert dahl(x, 0.002) == pytest.approx(1 - np.exp(-x / 0.002), abs=1e-12)


def test_dahl_is_rate_independent() -> None:
    path = np.concatenate([np.linspace(0, 1, 200), np.linspace(1, -0.5, 300)])
    twice = np.repeat(path, 2, axis=0)
    assert dahl(twice, 0.1)[-1] == pytest.approx(dahl(path, 0.1)[-1], abs=1e-12)


def test_amplitude_and_phase_are_those_of_a_sine() -> None:
    u = np.linspace(0, 6, 50)
    amplitude, phase = amplitude_phase(0.3, -0.7)
    assert amplitude * np.sin(u + phase) == pytest.approx(0.3 * np.cos(u) - 0.7 * np.sin(u))


def test_rate_is_fourth_order() -> None:
    t = np.arange(0, 1, 4e-3)
    w = 2 * np.pi * 5
    slope = rate_of(np.sin(w * t), 4e-3)[3:-3]
    error = np.max(np.abs(slope - w * np.cos(w * t[3:-3]))) / w
    assert error < 1.1 * (w * 4e-3) ** 4 / 30


def test_a_late_signal_is_put_back() -> None:
    t = np.arange(0, 2, 4e-3)
    late = np.sin(2 * np.pi * 2 * (t - 0.013))[:, None]
    back = advanced(late, t, 0.013)[:, 0]
    assert back[:-10] == pytest.approx(np.sin(2 * np.pi * 2 * t)[:-10], abs=1e-6)


def test_rotation_is_counter_clockwise() -> None:
    assert rotated(np.array([[1.0, 0.0]]), np.array([np.pi / 2])) == pytest.approx(np.array([[0.0, 1.0]]))


def test_a_stop_is_a_spring_that_slips() -> None:
    """Out by 3 widths, back by 5 and out again by 1, from rest in the middle: 1, -1, 0."""
    path = np.concatenate([np.linspace(0, 3, 301), np.linspace(3, -2, 501)[1:], np.linspace(-2, -1, 101)[1:]])
    z = stop(0.01 * path, 0.01)
    assert z[50] == pytest.approx(0.5)
    assert z[300] == pytest.approx(1.0)
    assert z[300 + 100] == pytest.approx(0.0, abs=1e-9)
    assert z[800] == pytest.approx(-1.0)
    assert z[-1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(z).max() <= 1.0


def test_a_muscle_is_critically_damped() -> None:
    """Its answer to a unit step: 1 - (1 + w t) exp(-w t)."""
    t = np.arange(0.0, 2.0, 1e-3)
    step = muscle(np.ones((len(t), 1)), 1000.0, 8.0)[:, 0]
    assert step == pytest.approx(1 - (1 + 8 * t) * np.exp(-8 * t), abs=0.01)


def test_bands_of_a_response_add_up_to_the_signal() -> None:
    """In phase they sum to what lies between the outer nodes; a quarter turn late, to its quadrature."""
    t = np.arange(0.0, 40.0, 4e-3)
    window = np.hanning(len(t))
    wave = window * np.sin(2 * np.pi * 1.1 * t)
    bands = filtered(wave, 4e-3)
    assert len(bands) == 2 * len(NODES_HZ)
    assert np.sum(bands[0::2], axis=0) == pytest.approx(wave, abs=1e-3)
    late = -window * np.cos(2 * np.pi * 1.1 * t)
    assert np.sum(bands[1::2], axis=0) == pytest.approx(late, abs=2e-2)


def test_a_curves_basis_is_a_partition_of_one() -> None:
    values = np.linspace(-0.5, 1.5, 101)
    basis = curve_basis(values, 0.0, 1.0, 7)
    assert basis.shape == (101, 7)
    assert basis.sum(axis=1) == pytest.approx(np.ones(101))
    # Held at its ends, and able to follow a line within.
    assert basis[0] == pytest.approx(basis[25])
    inside = (values >= 0) & (values <= 1)
    fit, *_ = np.linalg.lstsq(basis[inside], values[inside], rcond=None)
    assert basis[inside] @ fit == pytest.approx(values[inside], abs=1e-12)


def test_a_trial_that_tells_is_the_first_that_any_candidate_knows() -> None:
    assert "spirit level" in telling_trial(["actuator.offset@joint1", "gravity.tilt@tip"])
    assert "weighed payload" in telling_trial(["actuator.gain@joint1", "friction.coulomb@joint1"])
    assert telling_trial(["unattributed@joint1"])


# Parameters and units of the diagnosis format, version 1, second table ("1" where it names no unit); viscous
# slopes are its "unequal viscous slope" of friction.asymmetric.
FORMAT = {
    "friction": {
        "torque": "N*m",
        "torque_pos": "N*m",
        "torque_neg": "N*m",
        "viscous_pos": "N*m*s/rad",
        "viscous_neg": "N*m*s/rad",
        "speed": "rad/s",
        "amplitude": "N*m",
        "width_rad": "rad",
        "period_rad": "rad",
        "phase_rad": "rad",
    },
    "friction.quadratic": {"coefficient": "N*m*s^2/rad^2"},
    "friction.load": {"coefficient": "N*m per N*m"},
    "elastic.cartesian": {"kx": "N/m", "ky": "N/m", "kxy": "N/m", "x0": "m", "y0": "m"},
    "elastic.joint": {"stiffness": "N*m/rad", "rest_rad": "rad"},
    "elastic.transmission": {"stiffness": "N*m/rad", "rest_rad": "rad", "motor_inertia": "kg*m^2"},
    "damping.cartesian": {"bx": "N*s/m", "by": "N*s/m"},
    "gravity.tilt": {"gx": "m/s^2", "gy": "m/s^2"},
    "gravity.link": {"torque_sin": "N*m", "torque_cos": "N*m"},
    "geometry.link_length": {"length_m": "m"},
    "inertia.extra": {"mass": "kg", "inertia": "kg*m^2"},
    "actuator": {
        "gain": "1",
        "torque": "N*m",
        "amplitude": "N*m",
        "cycles_per_rad": "1/rad",
        "phase_rad": "rad",
        "delay": "s",
        "time_constant": "s",
    },
    "force": {"gain": "1", "angle_rad": "rad", "cross": "1", "bias": "N", "drift": "N/s", "delay": "s"},
    "clock": {"seconds": "s", "legendre": "s"},
    "accel": {"angle_rad": "rad", "gain": "1", "bias": "m/s^2", "cross": "1", "delay": "s", "lever": "m"},
    "encoder": {"amplitude_rad": "rad", "phase_rad": "rad", "zero_rad": "rad", "factor": "1"},
    "load": {
        "B": "N*s/m",
        "cubic": "N/m^3",
        "amplitude": "N",
        "width": "m",
        "delay": "s",
        "gain_k": "N/m",
        "gain_b": "N*s/m",
        "rate": "m/s",
        "K_change": "1",
        "corner_rad_s": "rad/s",
        "K": "N/m",
        "M": "kg",
    },
}


@pytest.mark.parametrize("name", NAMES)
def test_what_a_finding_reports_has_the_formats_names_and_units(name: str) -> None:
    allowed = FORMAT.get(name) or FORMAT[name.partition(".")[0]]
    for kind in ("all instruments", "one joint"):
        for term in terms(apparatus(kind).setting):
            if term.effect == name:
                reported = term.read(np.linspace(0.1, 0.2, term.size), term.shapes[0])
                assert set(reported) <= set(allowed)
                assert {key: CATALOGUE[name].unit(key) for key in reported} == {
                    k: allowed[k] for k in reported
                }
