"""Declared lengths that are wrong: they enter every prediction, so their columns are sensitivities."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from impid_host.effects.effect import Effect, Parameter, Setting, Term, Value, each_and_all, joint_name
from impid_host.effects.sensitivity import sensitivity
from impid_host.effects.view import Columns, View, with_motion
from impid_host.signals.arrays import Floats

_STEP_M = 1e-4
_LARGEST_M = 0.2


def lengthened(view: View, link: int, by_m: float) -> View:
    """The trial of a robot whose link is longer than declared."""
    lengths = list(view.model.link_lengths_m)
    lengths[link] += by_m
    return with_motion(view, view.theta, view.omega, view.acc, view.model.with_links(tuple(lengths)))


def _link_length(setting: Setting) -> Iterator[Term]:
    for links in each_and_all(range(len(setting.links_m))):

        def columns(view: View, _shape: float, links: tuple[int, ...] = links) -> Columns:
            return sensitivity(view, _STEP_M, *(lengthened(view, link, _STEP_M) for link in links))

        def undo(view: View, beta: Floats, _shape: float, links: tuple[int, ...] = links) -> View:
            for link, by_m in zip(links, beta, strict=True):
                view = lengthened(view, link, float(by_m))
            return view

        yield Term(
            "geometry.link_length",
            tuple(joint_name(link) for link in links),
            columns,
            partial(_read, tuple(setting.links_m[link] for link in links)),
            size=len(links),
            gate=lambda beta, _shape: bool(np.max(np.abs(beta)) < _LARGEST_M),
            undo=undo,
            by_model=True,
            moves=True,
        )


def _read(declared: tuple[float, ...], beta: Floats, _shape: float) -> dict[str, Value]:
    lengths = [own + float(by_m) for own, by_m in zip(declared, beta, strict=True)]
    return {"length_m": lengths if len(lengths) > 1 else lengths[0]}


EFFECTS = (
    Effect(
        "geometry.link_length",
        "the true length is length_m: J, J', and with them every force and acceleration, are others than"
        " declared",
        "sensor",
        (Parameter("length_m", "m", 0.02, 5),),
        "Hollerbach and Wampler, The calibration index, Int. J. Robotics Research 15 (1996)",
        _link_length,
        tells={"": "the links measured with a rule, from axis to axis"},
    ),
)
