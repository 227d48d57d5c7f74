"""Error of the host-to-board clock on a model link; run it to see the figures.

The link: 10 Hz, each way 150 us plus an exponential delay of mean 300 us, one exchange in twenty late by up
to 20 ms one way; the board drifts by 40 ppm. No PC, no board: the truth is known exactly.
"""

import sys

import numpy as np
from impid_host.clock.device import ClockExchange, OnlineClock, fit_clock

DRIFT = 40e-6
OFFSET_US = 1.7e6


def exchanges(rng: np.random.Generator, duration_s: float) -> list[ClockExchange]:
    """Exchanges over the model link."""
    out = []
    for t1_us in np.arange(0.0, duration_s * 1e6, 1e5) + 5e9:
        there, back = 150 + rng.exponential(300, 2)
        if rng.random() < 0.05:
            late = rng.uniform(2e3, 20e3)
            there, back = (there + late, back) if rng.random() < 0.5 else (there, back + late)
        t2 = board_us(t1_us + there)
        hold = rng.integers(20, 200)
        t4 = t1_us + there + hold + back
        out.append(ClockExchange(round(t1_us * 1e3), round(t2), round(t2 + hold), round(t4 * 1e3)))
    return out


def board_us(host_us: float) -> float:
    """The truth."""
    return host_us * (1 + DRIFT) + OFFSET_US


def main(runs: int = 300, duration_s: float = 50.0) -> None:
    """Print rms and worst errors, and how often the stated 95 % interval holds."""
    rng = np.random.default_rng(1)
    online, offline, drift, inside, inside_drift = [], [], [], [], []
    for _ in range(runs):
        trial = exchanges(rng, duration_s)
        clock = OnlineClock()
        for n, exchange in enumerate(trial):
            clock.add(exchange)
            estimate = clock.estimate()
            if n % 10 == 0 and exchange.t4_ns > 5e12 + 10e9 and estimate is not None:
                online.append(estimate.board_us(exchange.t4_ns) - board_us(exchange.t4_ns * 1e-3))
        fit = fit_clock(trial)
        host_ns = fit.reference_host_us * 1e3
        offline.append(fit.board_us(host_ns) - board_us(fit.reference_host_us))
        inside.append(abs(offline[-1]) <= fit.offset_interval_us)
        drift.append(fit.drift_ppm - DRIFT * 1e6)
        inside_drift.append(abs(drift[-1]) <= fit.drift_interval_ppm)
    for name, errors, unit in (("online", online, "us"), ("offline", offline, "us"), ("drift", drift, "ppm")):
        e = np.asarray(errors)
        print(
            f"{name:8s} rms {np.sqrt(np.mean(e**2)):6.2f}  mean {e.mean():+6.2f}  "
            f"95 % {np.quantile(abs(e), 0.95):6.2f}  worst {abs(e).max():6.2f} {unit}  ({len(e)} values)"
        )
    print(f"95 % interval holds: offset {np.mean(inside):.1%}, drift {np.mean(inside_drift):.1%}")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:2]))
