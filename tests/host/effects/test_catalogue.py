"""The catalogue is complete, and its columns are what mechanics says, worked out another way."""

import numpy as np
import pytest
from impid_host.effects.actuator import EFFECTS as ACTUATOR
from impid_host.effects.catalogue import CATALOGUE, candidates
from impid_host.effects.effect import Setting, amplitude_phase, sign_mean
from impid_host.effects.load import dahl
from impid_host.effects.view import advanced, rate_of, rotated

# The names of the diagnosis format, version 1.
NAMES = (
    "friction.coulomb",
    "friction.stribeck",
    "friction.asymmetric",
    "friction.quadratic",
    "friction.position",
    "elastic.cartesian",
    "elastic.joint",
    "elastic.transmission",
    "damping.cartesian",
    "gravity.tilt",
    "inertia.extra",
    "actuator.gain",
    "actuator.offset",
    "actuator.cogging",
    "actuator.delay",
    "accel.misalignment",
    "accel.scale",
    "accel.bias",
    "accel.cross_axis",
    "accel.delay",
    "accel.lever_arm",
    "encoder.eccentricity",
    "encoder.zero",
    "clock.drift",
    "load.damping",
    "load.stiffness_cubic",
    "load.hysteresis",
    "load.deadzone",
    "load.delay",
    "load.drift",
    "load.coupling",
)


def setting(**changes: object) -> Setting:
    usual: dict[str, object] = {
        "joints": 2,
        "slides": (False, False),
        "planar": True,
        "axes": 2,
        "rotary_load": False,
        "bare": False,
        "span": np.array([0.7, 0.7]),
        "speed": np.array([1.5, 1.5]),
        "reach": 0.04,
        "springs": ("spring_K1_M1",),
        "arms": (),
        "accelerometer": True,
        "second_clock": True,
        "force_sensor": True,
        "duration_s": 50.0,
    }
    return Setting(**(usual | changes))  # type: ignore[arg-type]


def test_every_name_of_the_format_is_a_row() -> None:
    assert set(NAMES) == set(CATALOGUE)


def test_every_row_can_be_tried_where_all_instruments_are_there() -> None:
    assert {candidate.effect for candidate in candidates(setting())} == set(NAMES)


def test_rows_say_what_they_add_and_where_that_is_written() -> None:
    for effect in CATALOGUE.values():
        assert effect.equation, effect.name
        assert effect.source, effect.name
        assert all(parameter.unit for parameter in effect.parameters), effect.name


def test_without_accelerometer_nothing_is_said_of_it() -> None:
    tried = {candidate.effect for candidate in candidates(setting(accelerometer=False))}
    assert not any(name.startswith("accel.") for name in tried)


def test_a_single_axis_has_no_effects_of_the_plane() -> None:
    one = setting(
        joints=1, slides=(True,), planar=False, axes=1, springs=(), span=np.ones(1), speed=np.ones(1)
    )
    tried = {candidate.effect for candidate in candidates(one)}
    assert "elastic.cartesian" not in tried
    assert "friction.coulomb" in tried


def test_dry_friction_does_not_drive() -> None:
    coulomb = next(c for c in candidates(setting()) if c.effect == "friction.coulomb")
    assert coulomb.gate(np.array([0.1]), 0.0)
    assert not coulomb.gate(np.array([-0.1]), 0.0)


def test_reversal_keeps_its_time_between_samples() -> None:
    # 0.3 dt after this instant the joint reverses: of the sample around it 0.8 go one way, 0.2 the other.
    dt, acc = 1e-3, 50.0
    assert sign_mean(np.array([-0.3 * dt * acc]), np.array([acc]), dt) == pytest.approx([-0.6])
    assert sign_mean(np.array([1.0]), np.array([acc]), dt) == pytest.approx([1.0])


def test_dahl_follows_its_closed_form() -> None:
    x = np.linspace(0, 0.01, 501)[:, None]
    z = dahl(x, 0.002)[:, 0]
    assert z == pytest.approx(1 - np.exp(-x[:, 0] / 0.002), abs=1e-12)


def test_dahl_is_rate_independent() -> None:
    path = np.concatenate([np.linspace(0, 1, 200), np.linspace(1, -0.5, 300)])[:, None]
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


def test_units_are_found_by_parameter() -> None:
    assert {effect.name: effect.unit("delay") for effect in ACTUATOR if effect.name == "actuator.delay"} == {
        "actuator.delay": "s"
    }


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
        "coefficient": "N*m*s^2/rad^2",
        "amplitude": "N*m",
        "period_rad": "rad",
        "phase_rad": "rad",
    },
    "elastic.cartesian": {"kx": "N/m", "ky": "N/m", "x0": "m", "y0": "m"},
    "elastic.joint": {"stiffness": "N*m/rad", "rest_rad": "rad"},
    "elastic.transmission": {"stiffness": "N*m/rad", "rest_rad": "rad", "motor_inertia": "kg*m^2"},
    "damping.cartesian": {"bx": "N*s/m", "by": "N*s/m"},
    "gravity.tilt": {"gx": "m/s^2", "gy": "m/s^2"},
    "inertia.extra": {"mass": "kg", "inertia": "kg*m^2"},
    "actuator": {
        "gain": "1",
        "torque": "N*m",
        "amplitude": "N*m",
        "cycles_per_rad": "1/rad",
        "phase_rad": "rad",
        "delay": "s",
    },
    "accel": {"angle_rad": "rad", "gain": "1", "bias": "m/s^2", "cross": "1", "delay": "s", "lever": "m"},
    "encoder": {"amplitude_rad": "rad", "phase_rad": "rad", "zero_rad": "rad"},
    "load": {
        "B": "N*s/m",
        "cubic": "N/m^3",
        "amplitude": "N",
        "width": "m",
        "delay": "s",
        "gain_k": "N/m",
        "gain_b": "N*s/m",
        "rate": "m/s",
        "K": "N/m",
        "M": "kg",
    },
}


@pytest.mark.parametrize("name", [name for name in NAMES if name != "clock.drift"])
def test_what_a_finding_reports_has_the_formats_names_and_units(name: str) -> None:
    allowed = FORMAT.get(name) or FORMAT[name.partition(".")[0]]
    for candidate in candidates(setting()):
        if candidate.effect == name:
            reported = candidate.read(np.linspace(0.1, 0.2, candidate.size), candidate.shapes[0])
            assert set(reported) <= set(allowed)
            assert {key: CATALOGUE[name].unit(key) for key in reported} == {k: allowed[k] for k in reported}
