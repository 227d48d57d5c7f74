"""A study: the laboratory at work with its hidden effects at the wanted strength, and the truth about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import residual as res
from .chain import delivered, signals
from .declared import declared
from .effects import EVERY, Effect
from .effects.base import Declared
from .harmless import HARMLESS
from .instruments import Record, record
from .laboratory import Laboratory, draw
from .mechanics import Array
from .motion import Motion, controlled, low_pass, moving, reference
from .strength import Ruler, Sizes, calibrate

TOOL_BAND = 4.5  # Hz, the papers' low-pass, for the noise floors


@dataclass(frozen=True)
class Study:
    laboratory: Laboratory
    effects: tuple[Effect, ...]
    motions: tuple[Motion, ...]
    records: tuple[Record, ...]
    setup: Declared
    truth: dict[str, Any]


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


def make(
    seed: int,
    wanted: list[tuple[str, float]],
    unusual: bool = False,
    measure: str = "seen",
    harmless: str | None = None,
) -> Study:
    """The study of a seed with the given effects, each (key, strength); ``measure`` is the strength that is set
    to what is wanted, "seen" or "raw" (see ``strength``); ``harmless`` is a kind of noise or logging."""
    kinds = [EVERY[key] for key, _ in wanted]
    lab = draw(seed, frozenset().union(*(k.needs for k in kinds)), unusual)
    quirk = HARMLESS[harmless] if harmless else None
    if quirk:
        drawn = quirk.instruments(lab.instruments, np.random.default_rng([seed, 6]))
        lab = replace(lab, instruments=drawn)
    paths = _wanted(lab)
    plain = _run(paths, ())
    lab = _scaled(lab, plain)
    paths = [replace(m, laboratory=lab) for m in paths]
    plain = tuple(replace(m, laboratory=lab) for m in plain)
    effects = tuple(k(np.random.default_rng([seed, 5, i]), lab) for i, k in enumerate(kinds))
    setup, motions, entries, together = declared(lab), plain, [], 0.0
    if effects:
        ruler = Ruler(plain)
        for effect, (_, target) in zip(effects, wanted, strict=True):
            calibrate(ruler, effect, target, measure)
        for _ in range(3):  # effects change the motion, and with it their size
            motions = _run(paths, effects)
            final = Ruler(motions, ruler.noise)
            sizes = [final.sizes((effect,)) for effect in effects]
            got = [getattr(size, measure) for size in sizes]
            factors = [target / g for g, (_, target) in zip(got, wanted, strict=True)]
            if not _rescaled(effects, factors):
                break
        for effect in effects:
            effect.declare(setup)
        together = final.sizes(effects).seen
        entries = [
            _entry(e, target, size) for e, (_, target), size in zip(effects, wanted, sizes, strict=True)
        ]
    records = tuple(record(m, signals(m, effects), lab.instruments) for m in motions)
    if quirk:
        records = tuple(quirk.rows(r, m.rng(4)) for m, r in zip(motions, records, strict=True))
    return Study(
        lab,
        effects,
        motions,
        records,
        setup,
        _truth(lab, effects, entries, together, motions, records, unusual) | {"harmless": harmless},
    )


def _rescaled(effects: tuple[Effect, ...], factors: list[float]) -> bool:
    """Whether an effect was off by more than a tenth and could be put right."""
    changed = False
    for effect, factor in zip(effects, factors, strict=True):
        amount = min(effect.amount * float(np.clip(factor, 0.3, 3)), effect.most)
        if abs(np.log(factor)) > 0.1 and amount != effect.amount:
            effect.amount, changed = amount, True
    return changed


def _truth(
    lab: Laboratory,
    effects: tuple[Effect, ...],
    entries: list[dict[str, Any]],
    together: float,
    motions: tuple[Motion, ...],
    records: tuple[Record, ...],
    unusual: bool,
) -> dict[str, Any]:
    return {
        "format": "impid-independent-truth/1",
        "seed": lab.seed,
        "clean": not effects,
        "unusual_noise": unusual,
        "effects": entries,
        "seen_strength": together,
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


def _entry(effect: Effect, target: float, sizes: Sizes) -> dict[str, Any]:
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
        "raw_strength": sizes.raw,
        "seen_strength": sizes.seen,
        "in_words": (type(effect).__doc__ or effect.name or "").strip(),
    }
