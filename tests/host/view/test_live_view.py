"""The live view in a browser, beside a recording that must not feel it."""

import json
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from impid_host.errors import LinkError
from impid_host.recording.reader import read_recording
from impid_host.samples import DeviceSamples
from impid_host.view.live_view import LiveView
from impid_host.view.scale import scale_of
from impid_host.wire.records import Decoded, Segment

from tests.host.recording.boards import PtyBoard
from tests.host.view.browser import Browser
from tests.host.view.many_tabs import ManyTabs

SCALE = scale_of(None, {}, 65536)
PROGRAM = [sys.executable, "-c", "from impid_host.cli import main; main()", "record"]


@pytest.fixture
def recorder(tmp_path: Path):
    """A recording with a view: the board, the process, the page's address, the token, the file."""
    board = PtyBoard()
    out = tmp_path / "free_01.mcap"
    command = [*PROGRAM, "--port", board.port, "--view", "--duration", "60", "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    yield board, process, *_announced(process), out
    process.kill()
    process.communicate()
    board.close()


def _announced(process: "subprocess.Popen[str]") -> tuple[str, str]:
    """Address and token, as the console has them."""
    assert process.stderr is not None
    for line in process.stderr:
        found = re.search(r"live view: (http://\S+)  \(token for stopping and marking: (\S+)\)", line)
        if found is not None:
            return found[1], found[2]
    raise AssertionError("no live view was announced")


def _deaf_socket(port: int) -> socket.socket:
    """A tab that opens and never reads."""
    deaf = socket.socket()
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    deaf.connect(("127.0.0.1", port))
    deaf.sendall(
        f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
    )
    return deaf


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
        browser.until("impid.received >= 800", 40)
        ticks, shown = board.ticks, browser.evaluate("kept.angle_1.at(-1)")
        seen = browser.evaluate("impid")
        assert seen["received"] >= 800
        assert seen["drawn"] > 10
        # Samples of a second ago at most: on two busy cores a browser of its own takes its share. A point is
        # the mean of ten ticks, and nothing says what a count of this board is.
        assert -1000 < ticks - shown < 1500
        assert seen["units"] == ["counts", "counts"]
        assert seen["progress"]["skipped"] == 0
        # This board's axes stand on one code, and the lamp says so; else nothing is wrong but what was lost.
        assert seen["lamp"]["level"] == "bad"
        assert any("x and y stands on one code" in words for words in seen["lamp"]["words"])
        assert browser.evaluate("document.getElementById('level').textContent") == "wrong"
        drawn = (
            "(() => {const c = document.getElementById('angles'); const pen = c.getContext('2d'); "
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


def test_two_hundred_tabs_and_some_that_hang_do_the_recording_no_harm(recorder, tmp_path: Path) -> None:
    """A browser and 200 sockets read, 20 more never do: all readers are served, the recording is whole."""
    _, process, url, token, out = recorder
    port = int(url.rsplit(":", 1)[1].strip("/"))
    hanging = [_deaf_socket(port) for _ in range(20)]
    with Browser(url, tmp_path / "profile") as browser, ManyTabs(url, 200) as tabs:
        assert browser.until("impid.tabs > 200", 30)
        before, drawn = list(tabs.counts), browser.evaluate("impid.drawn")
        began = time.monotonic()
        time.sleep(8.0)
        spent = time.monotonic() - began
        each = [(b - a) / spent for a, b in zip(before, tabs.counts, strict=True)]
        assert min(each) > 0.5, "every tab is served"
        assert max(each) < 6.0, "and no more often than so many tabs allow"
        assert browser.evaluate("impid.drawn") > drawn + 4
        assert browser.evaluate("impid.progress.skipped") == 0
        assert request(url + "api/stop", post=b"", headers={"X-Impid-Token": token}) == 200
        process.wait(20)
    for deaf in hanging:
        deaf.close()
    recording = read_recording(out)
    (ledger,) = recording.ledgers
    assert ledger.balanced
    assert recording.counts.lost_frames == recording.statuses[-1].frames_dropped
    assert recording.duration_s > 8.0


def test_the_page_by_a_simulated_laboratory_shows_units_time_and_a_spectrum(tmp_path: Path) -> None:
    """The scenario's arm of the robot turns by a known angle; its lamp is good, at 1200 and at 400 pixels."""
    out = tmp_path / "free_01.mcap"
    command = [*PROGRAM, "--sim", "first-light:free_01", "--view", "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        url, token = _announced(process)
        with Browser(url, tmp_path / "profile") as browser:
            browser.until("impid.received > 1050 && impid.spectrum && impid.lamp.level === 'good'", 40)
            seen = browser.evaluate("impid")
            browser.screenshot(tmp_path / "live.png")
            assert seen["lamp"] == {"level": "good", "words": ["recording, nothing is wrong"]}
            assert seen["units"] == ["rad", "rad"]
            angles = np.array(browser.evaluate("[kept.angle_1, kept.angle_2]"))
            assert (np.abs(angles) < np.pi).all()
            assert np.ptp(angles[0]) > 0.02  # the robot moves
            t = np.array(browser.evaluate("kept.t"))
            assert 9.0 < t[-1] - t[0] <= 10.0
            assert np.median(np.diff(t)) == pytest.approx(0.01, rel=0.01)
            spectrum = seen["spectrum"]
            lines = np.arange(len(spectrum["acc_x"])) * spectrum["step_hz"]
            assert lines[-1] <= 20.0 < lines[-1] + spectrum["step_hz"]
            # The robot's motion is below 4 Hz, and nothing but noise stands above.
            both = np.array(spectrum["acc_x"]) + np.array(spectrum["acc_y"])
            assert lines[1:][both[1:].argmax()] < 4.0
            assert both[lines > 8.0].max() < 0.2 * both[1:].max()
            browser.resize(400, 900)
            assert browser.evaluate("document.documentElement.scrollWidth") <= 400
            assert browser.evaluate("impid.problems") == []
        assert request(url + "api/stop", post=b"", headers={"X-Impid-Token": token}) == 200
        process.wait(20)
    finally:
        process.kill()
        process.communicate()


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
    for name in ("page.html", "view.css", "view.js", "plot.js"):
        text = resources.files("impid_host.view").joinpath(name).read_text()
        assert not re.search(r"https?://|src=\"//|@import|url\(", text.replace("ws://${location.host}", ""))


def test_a_view_that_hangs_does_not_hold_up_the_recorder() -> None:
    """Its process is stopped: pieces are left out and counted, and each call returns at once."""
    with LiveView.start(SCALE, 1000.0) as view:
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
    with LiveView.start(SCALE, 1000.0) as first:
        port = int(first.url.rsplit(":", 1)[1].strip("/"))
        with pytest.raises(LinkError, match="choose another --view-address"):
            LiveView.start(SCALE, 1000.0, "127.0.0.1", port)


def _decoded() -> Decoded:
    n = np.arange(500)
    samples = DeviceSamples(
        t_us=n.astype(np.uint64), seq=n.astype(np.uint32), ax=n.astype(np.uint16), ay=n.astype(np.uint16),
        enc1=n.astype(np.int32), enc2=n.astype(np.int32), flags=n.astype(np.uint8),
    )  # fmt: skip
    return Decoded(segments=(Segment(1, 0, n.astype(np.uint64), samples),))
