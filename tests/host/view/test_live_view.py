"""The live view in a browser, beside a recording that must not feel it."""

import json
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from boards import PtyBoard
from browser import Browser
from impid_host.errors import LinkError
from impid_host.recording.reader import read_recording
from impid_host.samples import DeviceSamples
from impid_host.view.live_view import LiveView
from impid_host.view.spectrum import SEGMENT, amplitude_spectrum
from impid_host.wire.records import Decoded, Segment

PROGRAM = [sys.executable, "-c", "from impid_host.cli import main; main()", "record"]


@pytest.fixture
def recorder(tmp_path: Path):
    """A recording with a view: the board, the process, the page's address, the token, the file."""
    board = PtyBoard()
    out = tmp_path / "free_01.mcap"
    command = [*PROGRAM, "--port", board.port, "--view", "--duration", "60", "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    line = process.stderr.readline()
    found = re.search(r"live view: (http://\S+)  \(token for stopping and marking: (\S+)\)", line)
    assert found is not None, line
    yield board, process, found[1], found[2], out
    process.kill()
    process.communicate()
    board.close()


def request(url: str, *, post: bytes | None = None, headers: dict[str, str] | None = None) -> int:
    asked = urllib.request.Request(url, data=post, headers=headers or {})
    try:
        with urllib.request.urlopen(asked, timeout=5) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def test_a_browser_keeps_up_and_the_recording_does_not_feel_it(recorder, tmp_path: Path) -> None:
    board, process, url, token, out = recorder
    with Browser(url, tmp_path / "profile") as browser:
        deadline = time.monotonic() + 40
        while time.monotonic() < deadline and browser.evaluate("window.impid?.received ?? 0") < 5000:
            time.sleep(0.2)
        seen = browser.evaluate("impid")
        ticks, shown = board.ticks, browser.evaluate("kept.enc1.at(-1)")
        assert seen["received"] >= 5000
        # The page misses what the line lost, and nothing else.
        assert seen["missed"] <= seen["progress"]["lost"] + 10
        assert seen["frames"] > 10
        # Samples of a second ago at most: on two busy cores a browser of its own takes its share.
        assert -1000 < ticks - shown < 1000
        assert seen["progress"]["skipped"] == 0
        assert len(seen["spectrum"]["ax"]) == SEGMENT // 2 + 1
        assert browser.evaluate("document.getElementById('state').textContent") == "recording"
        drawn = (
            "(() => {const c = document.getElementById('encoders'); const pen = c.getContext('2d'); "
            "return pen.getImageData(0, 0, c.width, c.height).data.some((v) => v > 0)})()"
        )
        assert browser.evaluate(drawn) is True
        # The button without the token has no effect; with it the recording ends in good order.
        browser.evaluate("document.getElementById('stop').click()")
        time.sleep(0.5)
        assert process.poll() is None
        assert "token" in browser.evaluate("document.getElementById('answer').textContent")
        browser.evaluate(f"document.getElementById('token').value = {json.dumps(token)}")
        browser.evaluate("document.getElementById('text').value = 'patient moved'")
        browser.evaluate("document.getElementById('mark').click()")
        time.sleep(0.5)
        browser.evaluate("document.getElementById('stop').click()")
        process.wait(20)
    recording = read_recording(out)
    (ledger,) = recording.ledgers
    assert ledger.balanced
    # The board's own count of frames that its line had no room for: the host has lost no other.
    assert recording.counts.lost_frames == recording.statuses[-1].frames_dropped
    assert recording.warnings == ()
    assert [e.detail for e in recording.events if e.name == "mark"] == [{"text": "patient moved"}]


def test_nothing_can_be_started_or_written_without_the_token(recorder) -> None:
    _, process, url, token, _ = recorder
    for path in ("api/stop", "api/mark"):
        assert request(url + path, post=b"") == 403
        assert request(url + path, post=b"", headers={"X-Impid-Token": "wrong"}) == 403
        assert request(url + path) == 405
    assert request(url + "../../etc/passwd") == 404
    time.sleep(0.3)
    assert process.poll() is None
    assert request(url + "api/mark", post=b"x", headers={"X-Impid-Token": token}) == 200


def test_it_answers_only_to_its_own_address(recorder) -> None:
    """A page elsewhere that calls itself by this machine's address gets nothing, not even a look."""
    *_, url, _, _ = recorder
    assert url.startswith("http://127.0.0.1:")
    assert request(url) == 200
    assert request(url, headers={"Host": "evil.example:80"}) == 403
    assert request(url, headers={"Origin": "http://evil.example"}) == 403
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Origin": "http://evil.example"}
    assert request(url + "ws", headers=upgrade) == 403


def test_the_page_needs_nothing_from_elsewhere() -> None:
    for name in ("page.html", "view.css", "view.js"):
        text = resources.files("impid_host.view").joinpath(name).read_text()
        assert not re.search(r"https?://|src=\"//|@import|url\(", text.replace("ws://${location.host}", ""))


def test_a_view_that_hangs_does_not_hold_up_the_recorder() -> None:
    """Its process is stopped: pieces are left out and counted, and each call returns at once."""
    with LiveView.start() as view:
        view._process.send_signal(signal.SIGSTOP)
        decoded = _decoded()
        slowest = 0.0
        for _ in range(400):
            began = time.perf_counter()
            view.see(decoded)
            slowest = max(slowest, time.perf_counter() - began)
        assert view.skipped > 0
        assert slowest < 0.1
        view._process.send_signal(signal.SIGCONT)


def test_a_view_that_dies_does_not_end_the_recording(recorder) -> None:
    *_, out = recorder
    process = recorder[1]
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    for child in children:
        subprocess.run(["kill", "-9", child], check=True)
    before = out.stat().st_size
    time.sleep(1.0)
    assert process.poll() is None
    assert out.stat().st_size > before


def test_an_address_that_cannot_be_served() -> None:
    with LiveView.start() as first:
        port = int(first.url.rsplit(":", 1)[1].strip("/"))
        with pytest.raises(LinkError, match="choose another --view-address"):
            LiveView.start("127.0.0.1", port)


def test_the_spectrum_of_a_sinusoid_is_its_amplitude() -> None:
    """On line 40, amplitude 300, on a pedestal: the pedestal is gone and the line reads 300."""
    t = np.arange(3 * SEGMENT)
    values = np.round(32768 + 300 * np.sin(2 * np.pi * 40 * t / SEGMENT)).astype(int)
    lines = amplitude_spectrum(values.tolist())
    assert lines.argmax() == 40
    assert lines[40] == pytest.approx(300, rel=2e-3)
    assert lines[0] < 0.1
    assert np.delete(lines, [39, 40, 41]).max() < 0.2


def _decoded() -> Decoded:
    n = np.arange(500)
    samples = DeviceSamples(
        t_us=n.astype(np.uint64), seq=n.astype(np.uint32), ax=n.astype(np.uint16), ay=n.astype(np.uint16),
        enc1=n.astype(np.int32), enc2=n.astype(np.int32), flags=n.astype(np.uint8),
    )  # fmt: skip
    return Decoded(segments=(Segment(1, 0, n.astype(np.uint64), samples),))
