"""What must not cost the board its settings or its life: a hung program, power lost in a save."""

from collections.abc import Callable

from impid_host.bring_up.board import BenchBoard
from impid_host.bring_up.result import Result, not_measured
from impid_host.bring_up.wire import Operator
from impid_host.errors import LinkError
from impid_host.link.link import Link
from impid_host.wire.messages import ITEM, choices

# 4000 counts of 32 periods of an oscillator of 47 to 17 kHz, and up to a second of boot.
WATCHDOG_S = (2.7, 8.5)
_BOOT_LIMIT_S = 15.0
# Words of a save that are written before the reset: none, the mark, ... of 24.
CUTS = (0, 1, 2, 7, 15, 22, 23)
_SCRATCH = "ENCODER_2_CPR"  # a number that only the host reads
_SAVES = 2000
_BACK_S = 120.0


def _boot_id(board: BenchBoard) -> int:
    return board.client.identity().boot_id


def watchdog(board: BenchBoard) -> list[Result]:
    """Hangs the main loop."""
    what = "watchdog: from the hang to the first status of the next boot"
    before = _boot_id(board)
    board.bench("HANG")
    seconds = board.await_boot(before, _BOOT_LIMIT_S)
    silicon = "the frequency of this chip's low-speed oscillator; the emulator's has 32 kHz"
    if seconds is None:
        return [Result(what, _BOOT_LIMIT_S, "s", *WATCHDOG_S, "the board has not come back", silicon)]
    told = board.client.identity().reset_cause == choices("STATUS_HEALTH", "reset_cause")["WATCHDOG"]
    return [
        Result(what, seconds, "s", *WATCHDOG_S, silicon=silicon),
        Result("the board tells that reset as WATCHDOG", float(told), "", 1.0, 1.0),
    ]


def cut_saves(board: BenchBoard) -> Result:
    """Resets the board before a chosen word of a save: the settings must be those before."""
    settings = board.client.settings()
    original = settings[_SCRATCH.lower()]
    kept, boots = 0, settings["boot_count"]
    wrong = []
    for words in CUTS:
        before = _boot_id(board)
        board.client.request("SET", ITEM[_SCRATCH], (original + 1 + words) % (1 << 32))
        board.bench("CUT", words)
        board.client.tell("SAVE")
        came_back = board.await_boot(before, _BOOT_LIMIT_S) is not None
        boots += 1
        now = board.client.settings() if came_back else {}
        whole = now == settings | {"boot_count": boots}
        kept += whole
        wrong += [] if whole else [f"after {words} words {now.get(_SCRATCH.lower(), 'no answer')}"]
        if not came_back:
            break
    detail = "; ".join(wrong) or "cut before words " + ", ".join(map(str, CUTS)) + " of a save"
    return Result(
        "saves cut off by a reset, settings whole",
        float(kept),
        "",
        len(CUTS),
        len(CUTS),
        detail,
        "flash that is being programmed; the emulator's forgets a word at once",
    )


def unplugged(board: BenchBoard, operator: Operator, reopen: Callable[[], Link]) -> Result:
    """Saves without end while the plug is pulled: what is found then was saved last, or was being saved.

    Raises:
        LinkError: the board does not come back.
    """
    what = "power lost in a save, settings whole"
    silicon = "a word that is half programmed when the power goes"
    if not operator.unplug():
        return not_measured(what, "the plug was not pulled", silicon)
    original = board.client.settings()
    first = original[_SCRATCH.lower()]
    saved = tried = first
    try:
        for number in range(1, _SAVES + 1):
            tried = (first + number) % (1 << 32)
            board.client.request("SET", ITEM[_SCRATCH], tried, tries=1)
            board.client.request("SAVE", tries=1)
            saved = tried
    except LinkError:
        pass
    else:
        board.client.store({_SCRATCH: first})
        return not_measured(what, f"{_SAVES} saves went by and nobody pulled the plug", silicon)
    _come_back(board, reopen)
    found = board.client.settings()
    expected = {original["boot_count"] + n for n in (1, 2)}  # contacts may bounce
    others = {k: v for k, v in found.items() if k not in (_SCRATCH.lower(), "boot_count")}
    same = all(original[name] == value for name, value in others.items())
    whole = found[_SCRATCH.lower()] in (saved, tried) and same and found["boot_count"] in expected
    board.client.store({_SCRATCH: first})
    detail = f"save {(saved - first) % (1 << 32)} or {(tried - first) % (1 << 32)} expected, found "
    detail += str((found[_SCRATCH.lower()] - first) % (1 << 32))
    return Result(what, float(whole), "", 1.0, 1.0, detail, silicon)


def _come_back(board: BenchBoard, reopen: Callable[[], Link]) -> None:
    end = board.now() + _BACK_S
    while True:
        try:
            board.client.reconnect(reopen)
            board.client.identity()
        except LinkError:
            if board.now() > end:
                raise
        else:
            return
