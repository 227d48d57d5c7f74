"""Units of reported parameters, by counting the dimensions of what they are multiplied with."""

import re
from collections import Counter
from dataclasses import replace

import pytest
from impid_host.effects.catalogue import CATALOGUE, terms
from impid_host.effects.units import own_units

from .apparatus import apparatus

BASE = {
    "1": {},
    "rad": {"rad": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
}


def dimension(unit: str) -> dict[str, int]:
    """Exponents of kg, m, s and rad."""
    total: Counter[str] = Counter()
    for k, part in enumerate(unit.split("/")):
        for factor in part.strip("()").split("*"):
            name, power = re.fullmatch(r"([A-Za-z]+|1)(?:\^(\d))?", factor).groups()
            for base, exponent in BASE[name].items():
                total[base] += exponent * int(power or 1) * (1 if k == 0 else -1)
    return {base: exponent for base, exponent in total.items() if exponent}


def units_of(kind: str, effect: str) -> dict[str, str]:
    setting = apparatus(kind).setting
    own = next(t for t in terms(setting) if t.effect == effect)
    return own_units(CATALOGUE[effect], own, setting)


@pytest.mark.parametrize(
    ("effect", "expected"),
    [
        ("actuator.offset", {"torque": "N"}),
        ("actuator.cogging", {"amplitude": "N", "cycles_per_rad": "1/m", "phase_rad": "rad"}),
        ("elastic.joint", {"stiffness": "N/m", "rest_rad": "m"}),
        ("elastic.transmission", {"stiffness": "N/m", "motor_inertia": "kg"}),
        ("actuator.delay", {"delay": "s"}),
        ("actuator.gain", {"gain": "1"}),
    ],
)
def test_an_axis_that_slides_has_forces_and_lengths(effect: str, expected: dict[str, str]) -> None:
    assert units_of("one slide", effect) == expected


@pytest.mark.parametrize(
    ("effect", "parameter", "times", "makes"),
    [
        ("load.damping", "B", "rad/s", "N*m"),
        ("load.stiffness_cubic", "cubic", "rad^3", "N*m"),
        ("load.time_varying", "K", "rad", "N*m"),
        ("load.time_varying", "B", "rad/s", "N*m"),
        ("load.delay", "gain_k", "rad", "N*m"),
        ("load.delay", "gain_b", "rad/s", "N*m"),
        ("load.drift", "rate", "s", "rad"),
        ("load.deadzone", "width", "1", "rad"),
        ("load.hysteresis", "width", "1", "rad"),
        ("load.hysteresis", "amplitude", "1", "N*m"),
    ],
)
def test_a_load_on_a_turning_joint_is_a_torque_against_an_angle(
    effect: str, parameter: str, times: str, makes: str
) -> None:
    """A parameter times its motion is the torque (or the angle) that its equation says."""
    setting = apparatus("one joint").setting
    row = CATALOGUE[effect]
    own = next((t for t in row.terms(setting)), None)
    if own is None:  # springs alone have it, and no joint has springs here
        own = next(t for t in terms(apparatus("one slide").setting) if t.effect == effect)
    unit = own_units(row, own, setting)[parameter]
    product = Counter(dimension(unit))
    product.update(dimension(times))
    assert {k: v for k, v in product.items() if v} == dimension(makes)


def test_in_a_plane_the_catalogues_units_stand() -> None:
    setting = apparatus("all instruments").setting
    for own in terms(setting):
        row = CATALOGUE[own.effect]
        assert own_units(row, own, setting) == {p.name: p.unit for p in row.parameters}


@pytest.mark.parametrize(
    ("effect", "parameter", "times", "makes"),
    [
        ("friction.coulomb", "torque", "1", "N"),
        ("friction.asymmetric", "viscous_pos", "m/s", "N"),
        ("friction.stribeck", "speed", "1", "m/s"),
        ("friction.quadratic", "coefficient", "m^2/s^2", "N"),
        ("friction.position", "period_rad", "1", "m"),
        ("inertia.extra", "inertia", "m/s^2", "N"),
        ("elastic.transmission", "motor_inertia", "m/s^2", "N"),
        ("elastic.joint", "stiffness", "m", "N"),
    ],
)
def test_what_a_slide_multiplies_with_its_motion_is_a_force(
    effect: str, parameter: str, times: str, makes: str
) -> None:
    setting = replace(apparatus("one slide").setting, referenced=True)
    own = next(t for t in CATALOGUE[effect].terms(setting))
    product = Counter(dimension(own_units(CATALOGUE[effect], own, setting)[parameter]))
    product.update(dimension(times))
    assert {k: v for k, v in product.items() if v} == dimension(makes)


def test_nothing_turns_on_a_slide_but_the_phase_of_a_ripple() -> None:
    setting = replace(apparatus("one slide").setting, referenced=True)
    for own in terms(setting):
        if own.where[0].startswith("joint"):
            for name, unit in own_units(CATALOGUE[own.effect], own, setting).items():
                assert name == "phase_rad" or ("rad" not in unit and "N*m" not in unit), (own.effect, name)
