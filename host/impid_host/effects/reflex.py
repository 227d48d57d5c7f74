"""A joint's late, one-sided stretch reflex, as variants of load.delay.

tau += G h * [omega(t - delay)]+, with [.]+ one direction of stretch and h the muscle, a critically damped
low-pass of second order (Kearney, Stein and Parameswaran, IEEE Trans. Biomed. Eng. 44, 1997).
"""

from collections.abc import Iterator

from impid_host.effects.effect import Setting, Term, by_load
from impid_host.effects.view import Columns, View
from impid_host.impedance.reflex_path import CORNERS_RAD_S, DELAYS_S, ReflexPath

_SIDES = {"positive": 1.0, "negative": -1.0}


def reflex_terms(setting: Setting) -> Iterator[Term]:
    """Each direction of stretch at a few speeds of the muscle, on a rotary joint that carries a limb."""
    if not (setting.rotary_load and setting.arms):
        return
    for side, sign in _SIDES.items():
        for corner in CORNERS_RAD_S:

            def columns(view: View, delay: float, sign: float = sign, corner: float = corner) -> Columns:
                if view.load is None:
                    return {}
                both = ReflexPath(view.v[:, 0], view.rate_hz)(delay, corner)
                return by_load(view, both[:, :1] if sign > 0 else both[:, 1:])

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
