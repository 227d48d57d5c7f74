"""Headless Chromium by its DevTools protocol: load a page, ask it for values, take a picture."""

import asyncio
import base64
import json
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any, Self

import aiohttp

_SETTLE_S = 0.3  # a page is laid out anew and drawn


class Browser:
    """One page; leave the context to end the browser."""

    def __init__(self, url: str, profile: Path) -> None:
        program = next(
            (p for p in ("chromium", "chromium-browser", "google-chrome") if shutil.which(p)), None
        )
        assert program is not None, "headless Chromium is needed: scripts/system_packages.sh installs it"
        command = [
            program, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
            "--no-first-run", "--disable-background-networking", "--window-size=1200,900",
            f"--user-data-dir={profile}", "--remote-debugging-port=0", url,
        ]  # fmt: skip
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        port_file = profile / "DevToolsActivePort"
        deadline = time.monotonic() + 30
        while not (port_file.exists() and port_file.read_text().strip()) and time.monotonic() < deadline:
            time.sleep(0.05)
        self._port = int(port_file.read_text().splitlines()[0])
        self._url = url
        self._first: list[tuple[str, dict[str, Any]]] = []

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression (promises awaited)."""
        options = {"expression": expression, "returnByValue": True, "awaitPromise": True}
        answer = self._ask("Runtime.evaluate", options)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def screenshot(self, path: Path) -> None:
        """The page as PNG."""
        path.write_bytes(base64.b64decode(self._ask("Page.captureScreenshot", {})["data"]))

    def until(self, expression: str, seconds: float) -> Any:
        """The value of an expression as soon as it is true; after so many seconds whatever it is.

        What the page has not defined yet is not true.
        """
        deadline = time.monotonic() + seconds
        guarded = f"(() => {{ try {{ return {expression}; }} catch {{ return false; }} }})()"
        while not (value := self.evaluate(guarded)) and time.monotonic() < deadline:
            time.sleep(0.2)
        return value

    def resize(self, width: int, height: int, *, dark: bool = False) -> None:
        """Show the page in a window of another size, or to a reader who likes it dark."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        theme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        # The browser forgets both when a connection to it ends: each begins with them.
        self._first = [
            ("Emulation.setDeviceMetricsOverride", size),
            ("Emulation.setEmulatedMedia", {"features": [theme]}),
        ]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(20)

    def _ask(self, method: str, options: dict[str, Any]) -> dict[str, Any]:
        return asyncio.run(self._ask_page(method, options))

    async def _ask_page(self, method: str, options: dict[str, Any]) -> dict[str, Any]:
        async with aiohttp.ClientSession() as session:
            async with session.get(f"http://127.0.0.1:{self._port}/json") as listed:
                pages = [page for page in await listed.json() if page["url"] == self._url]
            async with session.ws_connect(pages[0]["webSocketDebuggerUrl"], max_msg_size=1 << 26) as socket:
                asked = [*self._first, (method, options)]
                for number, (name, given) in enumerate(asked, start=1):
                    await socket.send_str(json.dumps({"id": number, "method": name, "params": given}))
                    if number < len(asked):
                        await asyncio.sleep(_SETTLE_S)
                async for message in socket:
                    answer = json.loads(message.data)
                    if answer.get("id") == len(asked):
                        return answer["result"]
        raise AssertionError(f"no answer to {method}")
