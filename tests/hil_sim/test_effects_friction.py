"""Friction against closed forms: a single link that nothing drives, slowed down by one law at a time.

With alpha2 = 0 the links do not feel each other, so that I w' = -T(w) holds for each by itself.
"""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant.physics import DRY_RIPPLE, VISCOUS_RIPPLE, Friction, PlantEffects, Slip, Term
from hil_sim.plant.plant import Plant

INERTIA = 0.06
START = np.array([0.3, 0.1])


def spun(parameters, friction, seconds, speed, terms=()):
    """Speed of joint 1 at the end of each substep, and its angle, after a start at `speed`."""
    alpha = (INERTIA, 0.0, INERTIA, 0.0, 0.0)
    effects = PlantEffects(friction=(friction, Friction()), terms=terms)
    plant = Plant(replace(parameters, alpha=alpha, effects=effects), START)
    plant.set_speed(np.array([speed, 0.0]))
    motion = plant.run(np.zeros((round(1000 * seconds), 4)))
    return motion.w[:, 0], motion.q[:, 0]


def times(w):
    return np.arange(1, w.size + 1) * 125e-6


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_coulomb_friction_slows_evenly_and_then_holds(parameters, sign):
    """w = w0 - T t / I until rest at I w0 / T = 0.6 s, then nothing moves but the bend of the bristles."""
    w, q = spun(parameters, Friction(level=(0.1, 0.1)), 1.0, sign)
    moving = times(w) < 0.55
    assert w[moving] == pytest.approx(sign * (1.0 - times(w)[moving] * 0.1 / INERTIA), abs=2e-3)
    assert abs(w[times(w) > 0.9]).max() < 5e-3
    assert abs(q[times(w) > 0.7] - q[-1]).max() < 2e-4  # the presliding
    # Work done by friction on the way, T times the angle, is all the kinetic energy.
    assert 0.1 * abs(q[-1] - START[0]) == pytest.approx(0.5 * INERTIA, rel=2e-3)


def test_a_joint_sticks_below_its_dry_torque_and_slides_above(parameters):
    """Half the level only bends the bristles and shakes them; at twice the level w' = (T - level) / I."""
    effects = PlantEffects(friction=(Friction(level=(0.1, 0.1)), Friction()))
    alpha = (INERTIA, 0.0, INERTIA, 0.0, 0.0)
    turned = {}
    for torque in (0.05, 0.2):
        plant = Plant(replace(parameters, alpha=alpha, effects=effects), START)
        pull = np.zeros((4000, 6))
        pull[:, 0] = torque
        motion = plant.run(np.zeros((4000, 4)), pull)
        turned[torque] = motion.q[:, 0] - START[0]
    assert abs(turned[0.05]).max() < 2e-3
    assert np.ptp(turned[0.05][-8000:]) < 2e-4
    gained = motion.w[-1, 0] - motion.w[7999, 0]
    assert gained == pytest.approx(0.1 / INERTIA * 3.0, rel=1e-6)


def test_asymmetric_friction_has_a_level_for_each_direction(parameters):
    friction = Friction(level=(0.12, 0.04), viscous=(0.0, 0.0))
    forth, _ = spun(parameters, friction, 0.2, 1.0)
    back, _ = spun(parameters, friction, 0.2, -1.0)
    assert forth[-1] == pytest.approx(1.0 - 0.2 * 0.12 / INERTIA, abs=2e-3)
    assert back[-1] == pytest.approx(-1.0 + 0.2 * 0.04 / INERTIA, abs=2e-3)


def test_quadratic_drag_makes_one_over_speed_grow_evenly(parameters):
    w, _ = spun(parameters, Friction(quadratic=0.05), 1.0, -2.0)
    assert 1.0 / w == pytest.approx(-(0.5 + 0.05 / INERTIA * times(w)), rel=1e-9)


def test_stribeck_friction_fades_with_the_square_of_the_speed(parameters):
    """The torque that slows the joint, by differences of the speed, against its law."""
    w, _ = spun(parameters, Friction(level=(0.02, 0.02), stribeck=0.05, stribeck_speed=0.3), 2.6, 1.0)
    middle = 0.5 * (w[1:] + w[:-1])
    torque = -INERTIA * np.diff(w) / 125e-6
    law = 0.02 + 0.05 * np.exp(-((middle / 0.3) ** 2))
    sliding = (middle > 0.05) & (times(w)[1:] > 0.01)
    assert torque[sliding] == pytest.approx(law[sliding], abs=1e-4)
    assert torque[sliding].max() > 2.5 * torque[sliding].min()


def test_viscous_ripple_takes_speed_by_the_angle_alone(parameters):
    """I dw/dq = -b(q): the speed is a function of the angle, whatever the time."""
    term = Term(VISCOUS_RIPPLE, 0, size=0.02, a=2.0, b=0.4)
    w, q = spun(parameters, Friction(viscous=(0.05, 0.05)), 1.0, 1.5, (term,))
    turn = 2.0 * np.pi * 2.0
    ripple = 0.02 / turn * (np.cos(turn * START[0] + 0.4) - np.cos(turn * q + 0.4))
    assert w == pytest.approx(1.5 - (0.05 * (q - START[0]) + ripple) / INERTIA, abs=1e-8)


def test_dry_ripple_takes_energy_by_the_angle_alone(parameters):
    """I d(w^2 / 2) / dq = -(T + A sin(...)) while it slides."""
    term = Term(DRY_RIPPLE, 0, size=0.03, a=1.5, b=-0.2)
    w, q = spun(parameters, Friction(level=(0.05, 0.05)), 0.5, 1.5, (term,))
    turn = 2.0 * np.pi * 1.5
    work = 0.05 * (q - START[0]) + 0.03 / turn * (np.cos(turn * START[0] - 0.2) - np.cos(turn * q - 0.2))
    assert 0.5 * INERTIA * (1.5**2 - w**2) == pytest.approx(work, abs=3e-5)


def test_warm_up_fades_with_its_time_constant(parameters):
    """Viscous friction b exp(-t / T): ln w = -(b T / I) (1 - exp(-t / T))."""
    w, _ = spun(parameters, Friction(warm_viscous=0.1, warm_time=0.3), 1.0, 1.0)
    assert np.log(w) == pytest.approx(-0.1 * 0.3 / INERTIA * -np.expm1(-times(w) / 0.3), abs=1e-9)


def test_friction_never_drives(parameters):
    """Energy falls at every step, at any speed, with everything on that is dry."""
    friction = Friction(level=(0.05, 0.08), stribeck=0.03, stribeck_speed=0.2)
    for speed in (8.0, 0.05):
        w, _ = spun(parameters, friction, 0.3, speed)
        sliding = abs(w) > 0.02
        assert np.all(np.diff(abs(w))[sliding[1:]] < 0.0)


def pushed(parameters, friction, way):
    """Torque that resists joint 1 as it is led along `way` (rad, one row per tick), by I w' = tau - T.

    A stiff drive leads it slowly, so that what the drive exerts beyond the inertia is what resists.
    """
    alpha = (INERTIA, 0.0, INERTIA, 0.0, 0.0)
    effects = PlantEffects(friction=(friction, Friction()))
    p = replace(parameters, alpha=alpha, effects=effects, kp=(400.0, 400.0), kd=(4.0, 4.0))
    plant = Plant(p, START)
    speed = np.gradient(way, 1e-3)
    still = np.full(way.size, START[1])
    motion = plant.run(np.stack([START[0] + way, still, speed, np.zeros(way.size)], axis=1))
    w = np.concatenate([[0.0], motion.w[7::8, 0]])
    q = np.concatenate([[START[0]], motion.q[7::8, 0]])
    resists = motion.torque[:, 0] - INERTIA * np.diff(w) / 1e-3
    return 0.5 * (q[1:] + q[:-1]) - START[0], resists


def there_and_back(size):
    t = np.arange(4000) * 1e-3
    return size * np.sin(0.5 * np.pi * t) ** 2


def test_dahls_spring_bends_by_its_exponential(parameters):
    """T = T0 (1 - exp(-q / width)) on the way there; back it begins at -slope T0 / width towards -T0."""
    width = 0.02
    q, torque = pushed(parameters, Friction(spring_level=0.3, spring_width=width), there_and_back(0.1))
    there = slice(100, 950)
    assert torque[there] == pytest.approx(0.3 * -np.expm1(-q[there] / width), abs=5e-3)
    top, back = q[:1500].max(), slice(1100, 1900)
    z = 1.0 - np.exp(-top / width)
    assert torque[back] == pytest.approx(0.3 * ((z + 1.0) * np.exp((q[back] - top) / width) - 1.0), abs=5e-3)


def test_maxwells_springs_follow_masings_rule(parameters):
    """The way back is the first loading curve, twice as large and turned round."""
    slip = Slip.evenly(0.4, 0.02)
    q, torque = pushed(parameters, Friction(slip=slip), there_and_back(0.06))

    def first(x):
        return sum(
            level * np.minimum(x / limit, 1.0) for level, limit in zip(slip.level, slip.limit, strict=True)
        )

    there = slice(100, 950)
    assert torque[there] == pytest.approx(first(q[there]), abs=5e-3)
    top, back = q[:1500].max(), slice(1100, 1900)
    assert torque[back] == pytest.approx(first(top) - 2.0 * first(0.5 * (top - q[back])), abs=5e-3)
    assert sum(slip.level) == pytest.approx(0.4)
    assert np.mean(slip.limit) == pytest.approx(0.02)


def test_load_dependent_friction_takes_its_share_of_the_torque(parameters):
    """Under a torque T the joint gains (1 - c) T / I; without it nothing rubs."""
    effects = PlantEffects(friction=(Friction(per_torque=0.2), Friction()))
    alpha = (INERTIA, 0.0, INERTIA, 0.0, 0.0)
    plant = Plant(replace(parameters, alpha=alpha, effects=effects), START)
    pull = np.zeros((1000, 6))
    pull[:, 0] = 0.5
    gained = plant.run(np.zeros((1000, 4)), pull)
    assert gained.w[-1, 0] == pytest.approx(0.8 * 0.5 / INERTIA, rel=2e-3)
    coasting = plant.run(np.zeros((1000, 4)))
    assert coasting.w[-1, 0] == pytest.approx(gained.w[-1, 0], rel=1e-9)
