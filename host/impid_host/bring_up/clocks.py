"""The board's clock: against its internal oscillator, and for as long as wanted against the PC's."""

import numpy as np

from impid_host.bring_up.board import BenchBoard
from impid_host.bring_up.result import Result, not_measured
from impid_host.clock.device import EXCHANGE_RATE_HZ, ClockExchange, fit_clock
from impid_host.errors import UndeterminedError
from impid_host.wire.messages import choices

# The internal oscillator, -10 to 85 degrees (F446 data sheet, HSI oscillator characteristics).
_INTERNAL_PERCENT = 4.0
# A crystal of 50 ppm, and a PC's as good.
_DRIFT_PPM = 100.0
_WANDER_PPM = 20.0
_PARTS = 6
_EXCHANGES_A_PART = 300  # half a minute: fewer determine no rate worth telling


def external_clock(board: BenchBoard) -> list[Result]:
    """Which clock runs, and how many megahertz it has by the internal oscillator's count."""
    info = board.client.info()
    hse = info.clock_source == choices("STATUS_HEALTH", "clock_source")["HSE"]
    rows = [Result("runs on the external clock", float(hse), "", 1.0, 1.0)]
    what = "external clock by the internal oscillator"
    silicon = "the board's crystal or the ST-LINK's clock; both oscillators of the emulator are exact"
    if not info.external_clock_hz:
        return [*rows, not_measured(what, "the board has not counted it", silicon)]
    megahertz = info.external_clock_hz / 1e6
    off = 100.0 * (megahertz / max(1, round(megahertz)) - 1)
    detail = f"{megahertz:.4f} MHz, nominal {round(megahertz)} MHz; one count is 0.012 %"
    bound = _INTERNAL_PERCENT
    return [*rows, Result(what, off, "% off its nominal value", -bound, bound, detail, silicon)]


def drift(board: BenchBoard, minutes: float) -> list[Result]:
    """Streams and pings for so long: the rate of the board's clock, how it wanders, and what got lost."""
    ear = board.fresh_ear()
    board.client.start()
    end = board.now() + 60.0 * minutes
    while board.now() < end:
        board.client.ping()
        board.wait(1.0 / EXCHANGE_RATE_HZ)
        ear.codes.clear()
    produced = board.client.stop().value
    silicon = "temperature, and two oscillators that are not the same"
    what = f"clock against the PC's, {minutes:g} minutes"
    lost = Result(
        f"samples lost in {minutes:g} minutes",
        float(produced - ear.samples),
        "",
        0.0,
        0.0,
        f"of {produced}",
        "a USB line that somebody else uses too",
    )
    try:
        whole = fit_clock(ear.exchanges)
    except UndeterminedError as error:
        return [not_measured(what, str(error), silicon), lost]
    detail = f"± {whole.drift_interval_ppm:.2f} ppm, {whole.exchanges} exchanges"
    rows = [Result(what, whole.drift_ppm, "ppm", -_DRIFT_PPM, _DRIFT_PPM, detail, silicon)]
    return [*rows, _wander(ear.exchanges, silicon), lost]


def _wander(exchanges: list[ClockExchange], silicon: str) -> Result:
    what = "wander of that rate"
    parts = np.array_split(np.arange(len(exchanges)), _PARTS)
    if len(parts[-1]) < _EXCHANGES_A_PART:
        return not_measured(
            what, f"takes {_PARTS * _EXCHANGES_A_PART / EXCHANGE_RATE_HZ / 60:g} minutes", silicon
        )
    rates = [fit_clock([exchanges[n] for n in part]).drift_ppm for part in parts]
    detail = "rates of the parts: " + ", ".join(f"{rate:.2f}" for rate in rates)
    return Result(what, max(rates) - min(rates), "ppm", 0.0, _WANDER_PPM, detail, silicon)
