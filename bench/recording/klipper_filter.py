"""The clock filter of Klipper, written anew from what its documentation and its users say that it does.

An exponentially decaying regression (time constant 30 exchanges) of the board's clock over the host's time of
sending, shifted by the smallest half round trip seen. What came far later than predicted is left out for at
most ten seconds; what came far earlier is believed. One exchange a second there; here as many as it is given.
"""

from collections.abc import Sequence

from impid_host.clock.device import ClockExchange

DECAY = 1 / 30
OUTLIER_S = 500e-6
PATIENCE_S = 10.0


def klipper(exchanges: Sequence[ClockExchange]) -> list[float]:
    """After each exchange, the board's clock (us) that the filter gives for the moment of its answer, t4."""
    first = exchanges[0]
    mean_t, mean_c = first.t1_ns * 1e-9, first.t2_us * 1e-6
    var_t = cov = 0.0
    rate, spread = 1.0, (1e-3) ** 2
    half_rtt, believed_s = float("inf"), mean_t
    estimates = []
    for exchange in exchanges:
        sent_s, clock_s = exchange.t1_ns * 1e-9, exchange.t2_us * 1e-6
        half_rtt = min(half_rtt, 0.5 * (exchange.t4_ns * 1e-9 - sent_s))
        late_s = clock_s - (mean_c + rate * (sent_s - mean_t))
        far = late_s**2 > max(25 * spread, OUTLIER_S**2)
        if not (far and late_s > 0 and sent_s < believed_s + PATIENCE_S):
            spread = (1e-3) ** 2 if far else (1 - DECAY) * (spread + DECAY * late_s**2)
            believed_s = believed_s if far else sent_s
            dt, dc = sent_s - mean_t, clock_s - mean_c
            mean_t, mean_c = mean_t + DECAY * dt, mean_c + DECAY * dc
            var_t = (1 - DECAY) * (var_t + DECAY * dt * dt)
            cov = (1 - DECAY) * (cov + DECAY * dt * dc)
            rate = cov / var_t if var_t else 1.0
        at_s = exchange.t4_ns * 1e-9
        estimates.append(1e6 * (mean_c + rate * (at_s - half_rtt - mean_t)))
    return estimates
