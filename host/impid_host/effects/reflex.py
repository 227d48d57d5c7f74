"""A joint's late, one-sided stretch reflex, as variants of load.delay.

tau += G h * [omega(t - delay)]+, with [.]+ one direction of stretch and h the muscle, a critically damped
low-pass of second order (Kearney, Stein and Parameswaran, IEEE Trans. Biomed. Eng. 44, 1997).
"""

from collections.abc import Iterator

import numpy as np

from impid_host.effects.effect import Setting, Term, by_load
from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats
from impid_host.signals.recursive import recursive, second_order

# A spinal stretch reflex of a limb takes some 30 to 80 ms; its muscle acts below some 5 Hz.
DELAYS_S = tuple(float(d) for d in np.linspace(0.03, 0.08, 6))
CORNERS_RAD_S = (5.0, 8.0, 12.0, 18.0, 27.0)
_SIDES = {"positive": 1.0, "negative": -1.0}


def muscle(stretch: Floats, rate_hz: float, corner_rad_s: float) -> Floats:
    """The critically damped low-pass h, (N, k)."""
    return recursive(second_order(0.5 * corner_rad_s / rate_hz, 1.0)[None], stretch, settled=False)


def reflex_terms(setting: Setting) -> Iterator[Term]:
    """Each direction of stretch at a few speeds of the muscle, on a rotary joint that carries a limb."""
    if not (setting.rotary_load and setting.arms):
        return
    for side, sign in _SIDES.items():
        for corner in CORNERS_RAD_S:

            def columns(view: View, delay: float, sign: float = sign, corner: float = corner) -> Columns:
                if view.load is None:
                    return {}
                late = np.interp(view.t - delay, view.t, view.v[:, 0])
                stretch = sign * np.maximum(sign * late, 0.0)
                return by_load(view, muscle(stretch[:, None], view.rate_hz, corner))

            yield Term(
                "load.delay",
                ("load",),
                columns,
                lambda beta, delay, corner=corner: {  # type: ignore[misc]
                    "delay": delay,
                    "gain_b": float(beta[0]),
                    "corner_rad_s": corner,
                },
                shapes=DELAYS_S,
                gate=lambda beta, _delay: bool(beta[0] > 0),
                variant=f"reflex to {side} stretch, {corner:g} rad/s",
            )
