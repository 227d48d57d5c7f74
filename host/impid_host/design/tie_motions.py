"""Trials that may tell a tie's members apart: motions within limits, payloads to hang on, masses to weigh."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from impid_host.design.reference import Plan, design_reference, low_crest_multisine
from impid_host.errors import UndeterminedError
from impid_host.robot.model import RobotModel
from impid_host.signals.arrays import Floats

_FADE_S = 2.0
_TRIED = 2
_WITHIN = 0.985  # a multisine is scaled by its samples, between which it goes a little further
_SLOWER = (1.0, 0.7, 0.5, 0.3)


@dataclass(frozen=True, slots=True)
class Limits:
    """What a trial may ask of the robot.

    Attributes:
        range_rad: largest range of each joint (m for a slide), (n,); speed: largest speed, (n,).
        duration_s: of a trial; rate_hz: rows a second of the controller.
        payloads_kg: masses that may be hung on.
    """

    range_rad: Floats
    speed: Floats
    duration_s: float
    rate_hz: float
    payloads_kg: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Usual:
    """How the study moved in trials of one kind: centre and range of each joint, (n,), and the band, Hz."""

    centre: Floats
    range_rad: Floats
    upper_hz: float


@dataclass(frozen=True, slots=True)
class Motion:
    """What the controller is to follow: t (N,), s; theta, omega, theta_dd (N, n), rad."""

    t: Floats
    theta: Floats
    omega: Floats
    theta_dd: Floats


@dataclass(frozen=True, slots=True)
class Candidate:
    """One trial that could be run, or a weighing.

    Attributes:
        words: what to do.
        motion: None where nothing moves.
        load: what is on the end-effector, by the name of the study's load that it resembles; None: nothing.
        payload_kg: weighed mass that hangs there in its place, beside the same springs; None: as it was.
        weighed: loads of the study whose payloads are to be weighed.
    """

    words: str
    motion: Motion | None = None
    load: str | None = None
    payload_kg: float | None = None
    weighed: tuple[str, ...] = ()


def free_candidates(model: RobotModel, usual: Usual, limits: Limits) -> Iterator[Candidate]:
    """Trials with nothing on the end-effector."""
    wide = np.maximum(limits.range_rad, usual.range_rad)
    room = 0.5 * (wide - usual.range_rad)
    options: list[tuple[str, Callable[[], Motion]]] = [
        ("a free trial like the last", lambda: sinusoids(model, usual, limits)),
        (
            f"a free trial over a larger range ({_ranges(model, wide)})",
            lambda: sinusoids(model, replace(usual, range_rad=wide), limits),
        ),
        (
            "a faster free trial",
            lambda: sinusoids(model, _faster(usual), limits),
        ),
        ("a free trial with slow reversals", lambda: reversals(usual, wide, limits)),
        ("a free trial with long rests at several places", lambda: rests(usual, wide, limits)),
    ]
    if np.any(room > 0):
        for sign, words in ((1.0, "both joints further out"), (-1.0, "both joints further in")):
            moved = replace(usual, centre=usual.centre + sign * room)
            options.append(
                (f"a free trial at another place ({words})", lambda m=moved: sinusoids(model, m, limits))  # type: ignore[misc]
            )
    for words, make in options:
        motion = _possible(make)
        if motion is not None:
            yield Candidate(words, motion)


def load_candidates(
    model: RobotModel, load: str, usual: Usual, limits: Limits, *, weighable: bool
) -> Iterator[Candidate]:
    """Trials with that load, or with another mass beside its springs.

    Args:
        weighable: its mass hangs on springs, so that another may be hung there.
    """
    twice = replace(usual, range_rad=np.minimum(2 * usual.range_rad, limits.range_rad))
    options: list[tuple[str, Usual, float | None]] = [
        (f"a faster trial with {load}", _faster(usual), None),
        (f"a trial with {load} over twice the range", twice, None),
    ]
    for mass in limits.payloads_kg if weighable else ():
        words = f"a load trial with a weighed payload of {mass:g} kg on the springs of {load}"
        options.append((words, usual, mass))
    for words, own, payload_kg in options:
        motion = _possible(lambda own=own: sinusoids(model, own, limits))  # type: ignore[misc]
        if motion is not None:
            yield Candidate(words, motion, load, payload_kg)


def weighing(loads: Sequence[str]) -> Iterator[Candidate]:
    """To weigh what has hung there all along."""
    if loads:
        yield Candidate(f"no new trial: weigh the payload of {' and of '.join(loads)}", weighed=tuple(loads))


def sinusoids(model: RobotModel, usual: Usual, limits: Limits) -> Motion:
    """The most informative of a few low-crest multisines within the speed limit, slower where it must be.

    Raises:
        UndeterminedError: not even slowly.
    """
    period_s = limits.duration_s - 2 * _FADE_S
    plan = Plan(
        usual.centre,
        _WITHIN * usual.range_rad,
        period_s,
        1,
        _FADE_S,
        limits.rate_hz,
        speed_limit=limits.speed,
    )
    for slower in _SLOWER:
        choose = low_crest_multisine(period_s, slower * usual.upper_hz)
        try:
            found = design_reference(model, plan, choose, candidates=_TRIED)
        except UndeterminedError:
            if slower == _SLOWER[-1]:
                raise
            continue
        return Motion(found.t, found.theta, found.omega, found.theta_dd)
    raise AssertionError  # the last of them returns or raises


def reversals(usual: Usual, wide: Floats, limits: Limits) -> Motion:
    """To and fro between the ends of the range, and of a tenth of it, in turn and without rests."""
    corners = np.array([[1, 1], [-1, 1], [1, -1], [-1, -1]], dtype=np.float64)
    sizes = np.array([1.0, 1.0, 0.1, 0.1])
    return _visits(usual.centre, wide, limits, corners, sizes, move_s=3.0, rest_s=0.0)


def rests(usual: Usual, wide: Floats, limits: Limits) -> Motion:
    """Two seconds at rest at each of several places."""
    places = np.array([[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1]], np.float64)
    return _visits(usual.centre, wide, limits, places, np.ones(len(places)), move_s=1.0, rest_s=2.0)


def _visits(
    centre: Floats,
    wide: Floats,
    limits: Limits,
    places: Floats,
    sizes: Floats,
    *,
    move_s: float,
    rest_s: float,
) -> Motion:
    """From place to place by quintics (at rest at both ends), as slowly as the speed limit asks."""
    joints = len(centre)
    stops = [np.zeros(joints)]
    # A quintic's highest speed is 15/8 of its mean.
    move_s = max(move_s, 1.875 * float(np.max(wide / limits.speed)))
    count = max(int(limits.duration_s / (move_s + rest_s)) - 1, 2)
    for k in range(count):
        row = k % len(places)
        unit = np.resize(places[row], joints) * sizes[row]
        stops.append(0.5 * wide * unit)
    stops.append(np.zeros(joints))
    steps = round(move_s * limits.rate_hz)
    s = (np.arange(steps) / steps)[:, None]
    rise = (
        s**3 * (10 - 15 * s + 6 * s**2),
        30 * s**2 * (1 - s) ** 2 / move_s,
        60 * s * (1 - s) * (1 - 2 * s) / move_s**2,
    )
    parts: list[list[Floats]] = [[], [], []]
    still = np.zeros((round(rest_s * limits.rate_hz), joints))
    for here, there in pairwise(stops):
        for own, up in zip(parts, rise, strict=True):
            own.append(up * (there - here))
            own.append(still)
        parts[0][-2] = parts[0][-2] + here
        parts[0][-1] = still + there
    x, v, a = (np.concatenate(own) for own in parts)
    return Motion(np.arange(len(x)) / limits.rate_hz, centre + x, v, a)


def _faster(usual: Usual) -> Usual:
    """Twice the band over a third of the range: the speed stays, the acceleration grows."""
    return replace(usual, range_rad=usual.range_rad / 3, upper_hz=2 * usual.upper_hz)


def _possible(make: Callable[[], Motion]) -> Motion | None:
    try:
        return make()
    except UndeterminedError:
        return None


def _ranges(model: RobotModel, wide: Floats) -> str:
    both = [
        f"{1e3 * own:.0f} mm" if slides else f"{np.rad2deg(own):.0f} deg"
        for own, slides in zip(wide, model.prismatic, strict=True)
    ]
    return " and ".join(dict.fromkeys(both))


def columns_of(motion: Motion) -> Mapping[str, Floats]:
    """As the controller's CSV has it: t, then angles, speeds and accelerations of the joints."""
    parts = (("theta", motion.theta), ("omega", motion.omega), ("theta_dd", motion.theta_dd))
    return {"t": motion.t} | {
        f"{name}{joint + 1}": block[:, joint] for name, block in parts for joint in range(block.shape[1])
    }
