"""A study: the laboratory at work with its hidden effects at the wanted strength, and the truth about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import residual as res
from .effects import EVERY, Effect
from .effects.base import Declared
from .instruments import Record, Signals, record
from .laboratory import Laboratory, draw
from .mechanics import Array
from .motion import Motion, controlled, low_pass, moving, reference

TOOL_BAND = 4.5  # Hz, the papers' low-pass, for the noise floors


@dataclass(frozen=True)
class Study:
    laboratory: Laboratory
    effects: tuple[Effect, ...]
    motions: tuple[Motion, ...]
    records: tuple[Record, ...]
    setup: Declared
    truth: dict[str, Any]


def delivered(m: Motion, effects: tuple[Effect, ...]) -> tuple[Array, Array]:
    """Torque of the motors and force of the load on the robot, with what the effects add to both."""
    force = np.zeros_like(m.theta)
    if m.load is not None:
        force = m.load.force(m.x, m.v, m.a)
        for effect in effects:
            if effect.acts(m):
                force = force + effect.load_force(m, force)
    tau = m.robot.inverse(m.theta, m.omega, m.accel) - m.robot.to_joints(m.theta, force)
    for effect in effects:
        if effect.acts(m):
            tau = tau + effect.reaction(m, tau)
    return tau, force


def signals(m: Motion, effects: tuple[Effect, ...]) -> Signals:
    """What reaches the instruments."""
    ins = m.laboratory.instruments
    tau, force = delivered(m, effects)
    theta, logged, clock = m.theta, tau, np.zeros_like(m.t)
    felt = m.turned(ins.mount, ins.mount_angle, m.a)
    sensed = m.turned(ins.force_frame, ins.force_angle, force)
    for effect in effects:
        if effect.acts(m):
            theta = effect.angle(m, theta, tau)
            logged = effect.drive(m, logged)
            felt = effect.felt(m, felt, tau)
            sensed = effect.sensed(m, sensed)
            clock = clock + effect.clock(m, m.t)
    return Signals(theta, logged, felt, sensed, clock)


def _wanted(lab: Laboratory) -> list[Motion]:
    out, since = [], 5.0
    for index, plan in enumerate(lab.plans):
        since = round(since + plan.lead, 1)
        out.append(moving(lab, plan, index, since, *reference(lab, plan, index)))
        since += plan.duration
    return out


def _run(wanted: list[Motion], effects: tuple[Effect, ...]) -> tuple[Motion, ...]:
    return tuple(controlled(m, lambda w: delivered(w, effects)[0]) for m in wanted)


def _scaled(lab: Laboratory, motions: tuple[Motion, ...]) -> Laboratory:
    """The torque's noise, drawn as a share, in N m."""
    free = [low_pass(delivered(m, ())[0], 10.0) for m in motions if not m.loaded]
    size = float(np.sqrt(np.mean(np.concatenate(free) ** 2)))
    ins = lab.instruments
    level = max(ins.torque.level * size, 3e-4)
    return replace(lab, instruments=replace(ins, torque=replace(ins.torque, level=level)))


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


@dataclass(frozen=True)
class Scale:
    """Footprints of one study: clean motions, noise of the four channels, columns of the papers' model."""

    motions: tuple[Motion, ...]
    clean: tuple[Array, ...]
    noise: Array  # (4,)
    used: Array  # (4,) bool


def _scale(motions: tuple[Motion, ...]) -> Scale:
    lab = motions[0].laboratory
    squares, counts = np.zeros(4), np.zeros(4)
    clean = []
    for m in motions:
        s = signals(m, ())
        clean.append(res.residual(m, res.analyst(m, s, lab.robot.lengths)))
        seen = res.channel_noise(m, res.noise_seen(m, record(m, s, lab.instruments)))
        both = np.column_stack([seen["tau"], seen["sensor"]])
        weight = np.array([1, 1, m.loaded, m.loaded], dtype=float)
        squares += weight * (both**2).sum(0)
        counts += weight * both.shape[0]
    noise = np.sqrt(squares / np.maximum(counts, 1))
    return Scale(motions, tuple(clean), noise, noise > 0)


def _footprint(
    scale: Scale, effects: tuple[Effect, ...], setup: Declared
) -> tuple[list[Array], list[res.Seen]]:
    lengths = tuple(setup["robot"]["link_lengths_m"])
    prints, seen = [], []
    for m, clean in zip(scale.motions, scale.clean, strict=True):
        used = res.analyst(m, signals(m, effects), lengths)
        prints.append(res.residual(m, used) - clean)
        seen.append(used)
    return prints, seen


def strength(scale: Scale, effect: Effect) -> float:
    """Root mean square of the effect's footprint over that of the noise, in the channel where it is largest,
    over the trials in which it acts."""
    setup = declared(scale.motions[0].laboratory)
    effect.declare(setup)
    acting = tuple(i for i, m in enumerate(scale.motions) if effect.acts(m))
    part = replace(
        scale,
        motions=tuple(scale.motions[i] for i in acting),
        clean=tuple(scale.clean[i] for i in acting),
    )
    prints, _ = _footprint(part, (effect,), setup)
    return _largest(scale, part.motions, prints)


def _largest(scale: Scale, motions: tuple[Motion, ...], prints: list[Array]) -> float:
    loaded = [p for m, p in zip(motions, prints, strict=True) if m.loaded]
    torque = np.sqrt(np.mean(np.concatenate(prints)[:, :2] ** 2, axis=0)) / scale.noise[:2]
    force = (
        np.sqrt(np.mean(np.concatenate(loaded)[:, 2:] ** 2, axis=0))
        if loaded and scale.used[2]
        else np.zeros(2)
    )
    return float(max(torque.max(), (force / np.where(scale.used[2:], scale.noise[2:], 1)).max()))


def visible(scale: Scale, effects: tuple[Effect, ...], setup: Declared) -> float:
    """As ``strength``, of what is left after the papers' parameters have taken what they can."""
    lab = scale.motions[0].laboratory
    prints, seen = _footprint(scale, effects, setup)
    weight = np.where(scale.used, 1 / np.where(scale.used, scale.noise, 1), 0.0)
    columns, targets = [], []
    for m, p, s in zip(scale.motions, prints, seen, strict=True):
        w = weight * (np.array([1, 1, 1, 1]) if m.loaded else np.array([1, 1, 0, 0]))
        block = res.nuisance(m, s, lab)[::4] * w[None, :, None]
        columns.append(block.reshape(-1, block.shape[2]))
        targets.append((p[::4] * w).reshape(-1))
    A, y = np.concatenate(columns), np.concatenate(targets)
    size = np.sqrt((A**2).sum(0)) + 1e-30
    A = A / size
    fit = np.linalg.lstsq(A.T @ A, A.T @ y, rcond=1e-12)[0]
    left = np.split(y - A @ fit, np.cumsum([t.size for t in targets])[:-1])
    plain = [np.reshape(v, (-1, 4)) for v in left]
    unit = replace(scale, noise=np.ones(4))
    return _largest(unit, scale.motions, plain)


def calibrate(scale: Scale, effect: Effect, target: float) -> float:
    """Set the effect's amount for the wanted strength; a few steps of the secant in logarithms. Returns what it got."""
    effect.amount = effect.start
    got = strength(scale, effect)
    slope = 1.0
    for _ in range(6):
        if abs(np.log(got / target)) < 0.03 or (effect.amount >= effect.most and got < target):
            break
        before, had = effect.amount, got
        wanted = before * float(np.clip((target / had) ** (1 / slope), 0.02, 50))
        effect.amount = min(wanted, effect.most)
        got = strength(scale, effect)
        moved = np.log(effect.amount / before)
        if abs(moved) > 1e-9:
            slope = float(np.clip(np.log(got / had) / moved, 0.3, 3))
    return got


def _floors(
    motions: tuple[Motion, ...], records: tuple[Record, ...], cutoff: float
) -> dict[str, float | None]:
    """Root mean square of noise alone in each channel of a diagnosis; None for a channel that is not there."""
    pools: dict[str, list[Array]] = {"tau": [], "f": [], "fs": [], "sensor": [], "accel": [], "torque": []}
    for m, r in zip(motions, records, strict=True):
        n = res.noise_seen(m, r, cutoff)
        seen = res.channel_noise(m, n)
        pools["accel"].append(n.accel)
        pools["torque"].append(n.tau)
        for channel in ("f", "fs", "sensor") if m.loaded else ("tau",):
            pools[channel].append(seen[channel])
    force = motions[0].laboratory.instruments.force
    names = {
        "tau": ("tau1", "tau2"), "f": ("fx", "fy"), "fs": ("fsx", "fsy"), "sensor": ("sensor_x", "sensor_y"),
        "accel": ("accel_x", "accel_y"), "torque": ("torque_log1", "torque_log2"),
    }  # fmt: skip
    out: dict[str, float | None] = {}
    for pool, arrays in pools.items():
        sizes = np.sqrt(np.mean(np.concatenate(arrays) ** 2, axis=0))
        gone = pool in {"fs", "sensor"} and not force
        out |= {name: None if gone else float(v) for name, v in zip(names[pool], sizes, strict=True)}
    return out


def _loads(lab: Laboratory, effects: tuple[Effect, ...]) -> dict[str, Any]:
    out = {}
    for load in {p.load.name: p.load for p in lab.plans if p.load is not None}.values():
        K = load.K + sum((e.stiffness(load) for e in effects), np.zeros((2, 2)))
        out[load.name] = {
            "kind": load.kind,
            "M": load.M.tolist(),
            "B": load.B.tolist(),
            "K": K.tolist(),
            "x0": load.x0.tolist(),
            "handle": load.handle,
        }
    return out


def make(seed: int, wanted: list[tuple[str, float]], unusual: bool = False) -> Study:
    """The study of a seed with the given effects, each (key, strength); ``unusual`` noise is for clean studies."""
    kinds = [EVERY[key] for key, _ in wanted]
    lab = draw(seed, frozenset().union(*(k.needs for k in kinds)), unusual)
    plain = _run(_wanted(lab), ())
    lab = _scaled(lab, plain)
    plain = tuple(replace(m, laboratory=lab) for m in plain)
    effects = tuple(k(np.random.default_rng([seed, 5, i]), lab) for i, k in enumerate(kinds))
    setup = declared(lab)
    entries: list[dict[str, Any]] = []
    motions, together = plain, 0.0
    if effects:
        scale = _scale(plain)
        for effect, (_, target) in zip(effects, wanted, strict=True):
            calibrate(scale, effect, target)
            effect.declare(setup)
        motions = _run([replace(m, laboratory=lab) for m in _wanted(lab)], effects)
        final = replace(
            scale,
            motions=motions,
            clean=tuple(res.residual(m, res.analyst(m, signals(m, ()), lab.robot.lengths)) for m in motions),
        )
        together = visible(final, effects, setup)
        for effect, (_, target) in zip(effects, wanted, strict=True):
            own = declared(lab)
            effect.declare(own)
            seen = together if len(effects) == 1 else visible(final, (effect,), own)
            entries.append(_entry(effect, target, strength(final, effect), seen))
    records = tuple(record(m, signals(m, effects), lab.instruments) for m in motions)
    truth = {
        "format": "impid-independent-truth/1",
        "seed": seed,
        "clean": not effects,
        "unusual_noise": unusual,
        "effects": entries,
        "visible_strength": together,
        "alpha": list(lab.robot.alpha),
        "link_lengths_m": list(lab.robot.lengths),
        "loads": _loads(lab, effects),
        "K_defined": all(e.K_defined for e in effects),
        "noise_rms_4.5Hz": _floors(motions, records, TOOL_BAND),
        "noise_rms_10Hz": _floors(motions, records, 10.0),
        "noise_kinds": {
            "torque": lab.instruments.torque.kind,
            "accelerometer": lab.instruments.accel.kind,
            "force_sensor": lab.instruments.sensor.kind if lab.instruments.force else None,
        },
        "trials": {p.folder: {"kind": p.kind, "duration": p.duration, "style": p.style} for p in lab.plans},
    }
    return Study(lab, effects, motions, records, setup, truth)


def _entry(effect: Effect, target: float, got: float, seen: float) -> dict[str, Any]:
    return {
        "effect": effect.key(),
        "name": effect.name,
        "near": list(effect.near),
        "with": list(effect.with_),
        "instead": [list(names) for names in effect.instead],
        "any_joint": effect.any_joint,
        "where": effect.where,
        "when": effect.when,
        "parameters": effect.parameters(),
        "strength_wanted": target,
        "strength": got,
        "visible_strength": seen,
        "reached": bool(got > 0.8 * target),
        "in_words": (type(effect).__doc__ or effect.name or "").strip(),
    }
