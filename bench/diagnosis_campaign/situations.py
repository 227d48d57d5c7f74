"""Small cases by hand that a diagnosis has got wrong, or that a laboratory is likely to meet, with right answers.

The right answer of each is its own effects, as everywhere in the campaign: named with their places, or in a tie with
what was named; nothing where nothing is hidden; no name where no name is known.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Situation:
    """One such case.

    Attributes:
        name: what it is, in a few words.
        effects: labels; see hil_sim.scenarios.random_effects.
        strength: of those whose label does not state a size.
        noise: of the torque log; None: by chance.
        force_sensor, weighed: whether there is one, and whether payloads were; None: by chance.
        torque_step_Nm: the torque log's resolution; None: as usual.
    """

    name: str
    effects: tuple[str, ...]
    strength: float = 4.0
    noise: str | None = None
    force_sensor: bool | None = None
    weighed: bool | None = None
    torque_step_Nm: float | None = None


# New ones go to the end: a situation's place in the list decides about its seeds.
SITUATIONS = (
    Situation("dry friction, size of an earlier miss", ("friction.coulomb@joint1",), 6.0),
    Situation("a cable beside a constant torque", ("elastic.cartesian@tip", "actuator.offset@joint1")),
    Situation("a cable in load trials only", ("elastic.cartesian@tip:load",), force_sensor=True),
    Situation(
        "a cable of 30 N/m in load trials only, nothing measures the force",
        ("elastic.cartesian@tip:load,kx=30,ky=10,kxy=4",),
        force_sensor=False,
    ),
    Situation(
        "a clock that wanders in another phase each time", ("clock.drift@sensor,seconds=0,wander=0.003",)
    ),
    Situation("an equilibrium that ramps in another direction each time", ("load.drift@load",)),
    Situation("a rotor that couples both joints", ("inertia.extra@joint1+joint2",)),
    Situation("heavy-tailed torque noise", (), 0.0, noise="student"),
    Situation("torque logged in steps of 20 mN m", (), 0.0, torque_step_Nm=0.02),
    Situation(
        "a line at the top of the excitation",
        ("outside.resonance@joint1,frequency_Hz=2.2",),
    ),
    Situation(
        "a push near the end of the last trial",
        ("outside.push@load:spring_L1_02,start_s=24,duration_s=1.5",),
        10.0,
    ),
    Situation("the force sensor reads 5 % high", ("force.scale@sensor,gain=1.05",), force_sensor=True),
    Situation(
        "the force sensor reads 5 % high, payload weighed",
        ("force.scale@sensor,gain=1.05",),
        force_sensor=True,
        weighed=True,
    ),
    Situation("one axis of the force sensor reads 3 % high", ("force.scale@x,gain=1.03",), force_sensor=True),
    Situation(
        "drives give 5 % less than logged", ("actuator.gain@joint1+joint2,gain=0.95",), force_sensor=True
    ),
    Situation(
        "the force sensor is turned by 0.05 rad",
        ("force.misalignment@sensor,angle_rad=0.05",),
        force_sensor=True,
    ),
    Situation(
        "the force sensor is turned by a degree",
        ("force.misalignment@sensor,angle_rad=0.01745",),
        force_sensor=True,
    ),
    Situation(
        "the first link is 5 mm shorter than declared", ("geometry.link_length@joint1,length_m=0.249",)
    ),
    Situation("counts per turn of joint 2 off by 1 %", ("encoder.scale@joint2,factor=1.01",)),
    Situation(
        "the torque constant falls by 6 % while the motors warm",
        ("outside.torque_constant@joint1+joint2,fade=0.06",),
    ),
    Situation("load-dependent friction", ("friction.load@joint1+joint2,coefficient=0.1",)),
)
