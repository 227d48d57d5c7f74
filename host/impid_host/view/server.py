"""The serving process of the live view: lines of JSON in on stdin, a page and its WebSocket out.

Looking is free on the address that it serves. Whatever stops or writes something needs the token that the
recorder's console printed. Requests that name another host are refused, so that no web page elsewhere can
reach in by giving its own name the address of this machine.

However many look, the work is bounded: a push is worked out and encoded once for all tabs; their number and
the messages in a second are limited; a tab that is still busy with the last push misses this one, and one
that takes nothing for ten seconds is dropped.
"""

import asyncio
import contextlib
import hmac
import ipaddress
import json
import os
import socket
import sys
from dataclasses import dataclass
from importlib import resources
from typing import Any

from aiohttp import WSMsgType, web

from impid_host.view.force_shown import ForceShown
from impid_host.view.lamp import Lamp
from impid_host.view.observing import Observing
from impid_host.view.scale import Scale
from impid_host.view.stream import Stream

_PAGE = {
    "/": ("page.html", "text/html"),
    "/view.js": ("view.js", "text/javascript"),
    "/plot.js": ("plot.js", "text/javascript"),
    "/force.js": ("force.js", "text/javascript"),
    "/view.css": ("view.css", "text/css"),
}
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
_PUSH_S = 0.1
_SPECTRUM_S = 1.0
_MESSAGES_PER_S = 1000  # to all tabs together: 200 tabs get five a second, ten get ten
MOST_TABS = 300
_PATIENCE_S = 10.0
_OBSERVER_S = 15.0  # for an observer to load what it needs, before anything is recorded
_LARGEST_MARK = 200
_NICENESS = 5  # the recorder goes first


@dataclass(slots=True, eq=False)
class _Tab:
    """Who looks; `busy_since` on the loop's clock while the last push is not gone yet."""

    response: web.WebSocketResponse
    request: web.Request
    busy_since: float | None = None


class View:
    """What the page shows, and who looks at it."""

    def __init__(self, token: str, own_hosts: frozenset[str] | None, stream: Stream) -> None:
        self._token = token
        self._own_hosts = own_hosts
        self._stream = stream
        self._lamp = Lamp()
        self._progress: dict[str, Any] = {}
        self._tabs: set[_Tab] = set()
        self._sending: set[asyncio.Task[None]] = set()
        self._force = ForceShown()
        self._observing: Observing | None = None
        self.observed = asyncio.Event()  # the observer has said its first word

    async def observe(self, observing: Observing) -> None:
        """Show what it says, until it ends."""
        self._observing = observing
        async for message in observing.messages():
            self._force.take(message, self._stream.first_us)
            self.observed.set()

    def application(self) -> web.Application:
        """The routes."""
        application = web.Application(middlewares=[self._guard], client_max_size=4096)
        for path in _PAGE:
            application.router.add_get(path, self._page)
        application.router.add_get("/ws", self._socket)
        application.router.add_post("/api/stop", self._stop)
        application.router.add_post("/api/mark", self._mark)
        return application

    def take(self, line: bytes, now: float) -> None:
        """A line of the recorder; `now` on the loop's clock."""
        message = json.loads(line)
        if message["kind"] == "progress":
            self._progress = message
            self._lamp.progress(now, message)
            return
        codes = message["ax"], message["ay"]
        first, constant = (codes[0][0], codes[1][0]), (_constant(codes[0]), _constant(codes[1]))
        self._lamp.see(now, message["flags"], first, constant=constant)
        self._stream.take(message)
        if self._observing is not None:
            self._observing.forward(line)

    async def push_on(self) -> None:
        """Send what is new to everybody who can take it, for ever."""
        clock = asyncio.get_running_loop().time
        spectrum_at = 0.0
        while True:
            await asyncio.sleep(max(_PUSH_S, len(self._tabs) / _MESSAGES_PER_S))
            now = clock()
            lines = None
            if now >= spectrum_at:
                spectrum_at, lines = now + _SPECTRUM_S, self._stream.spectrum()
            text = json.dumps(self._state(now) | {"spectrum": lines}, separators=(",", ":"))
            for tab in tuple(self._tabs):
                self._push(tab, text, now)

    def _state(self, now: float) -> dict[str, Any]:
        observing = self._observing
        return {
            "force": None if observing is None else self._force.state(observing.skipped),
            "run": self._stream.run,
            "points": self._stream.points(),
            "progress": self._progress,
            "lamp": self._lamp.light(now, self._progress).to_dict(),
            "tabs": len(self._tabs),
        }

    def _push(self, tab: _Tab, text: str, now: float) -> None:
        if tab.busy_since is None:
            tab.busy_since = now
            task = asyncio.create_task(self._send(tab, text))
            self._sending.add(task)
            task.add_done_callback(self._sending.discard)
        elif now - tab.busy_since > _PATIENCE_S and tab.request.transport is not None:
            tab.request.transport.abort()

    async def _send(self, tab: _Tab, text: str) -> None:
        try:
            with contextlib.suppress(ConnectionError, RuntimeError):
                await tab.response.send_str(text)
        finally:
            tab.busy_since = None

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        if self._own_hosts is not None:
            origin = request.headers.get("Origin", "")
            if request.host not in self._own_hosts or (
                origin and origin.partition("://")[2] not in self._own_hosts
            ):
                raise web.HTTPForbidden(text="this view answers only to its own address\n")
        if request.method != "GET":
            given = request.headers.get("X-Impid-Token", "")
            if not hmac.compare_digest(given.encode(), self._token.encode()):
                raise web.HTTPForbidden(
                    text="the token that the recorder's console shows is needed for this\n"
                )
        response: web.StreamResponse = await handler(request)
        return response

    async def _page(self, request: web.Request) -> web.Response:
        name, kind = _PAGE[request.path]
        text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
        return web.Response(text=text, content_type=kind, headers=_HEADERS)

    async def _socket(self, request: web.Request) -> web.WebSocketResponse:
        if len(self._tabs) >= MOST_TABS:
            raise web.HTTPServiceUnavailable(text=f"{MOST_TABS} pages look already; close some\n")
        response = web.WebSocketResponse(heartbeat=_PATIENCE_S, max_msg_size=1024)
        await response.prepare(request)
        scale = self._stream.scale
        await response.send_json({"angle_units": scale.angle_units, "source": scale.source})
        tab = _Tab(response, request)
        self._tabs.add(tab)
        try:
            async for message in response:  # nothing that comes this way has any effect
                if message.type is WSMsgType.ERROR:
                    break
        finally:
            self._tabs.discard(tab)
        return response

    async def _stop(self, _: web.Request) -> web.Response:
        _tell({"command": "stop"})
        return web.json_response({"done": "stop"})

    async def _mark(self, request: web.Request) -> web.Response:
        _tell({"command": "mark", "text": (await request.text())[:_LARGEST_MARK]})
        return web.json_response({"done": "mark"})


def _constant(codes: list[int]) -> bool:
    return min(codes) == max(codes)


def _tell(message: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


async def _serve(host: str, port: int) -> None:
    lines = asyncio.StreamReader(limit=1 << 22)
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
    order = json.loads(await lines.readline())
    listening = socket.create_server((host, port), family=_family(host))
    name = f"[{host}]" if ":" in host else host
    at = listening.getsockname()[1]
    own = frozenset({f"{name}:{at}", f"localhost:{at}"}) if ipaddress.ip_address(host).is_loopback else None
    view = View(order["token"], own, Stream(Scale.from_dict(order["scale"]), order["rate_hz"]))
    runner = web.AppRunner(view.application(), access_log=None)
    await runner.setup()
    await web.SockSite(runner, listening).start()
    tasks = [asyncio.create_task(view.push_on())]
    observing = None
    if order["observer"] is not None:
        observing = await Observing.start(order["observer"])
        tasks.append(asyncio.create_task(view.observe(observing)))
        with contextlib.suppress(TimeoutError):  # then it comes later, or says why not
            await asyncio.wait_for(view.observed.wait(), _OBSERVER_S)
    _tell({"url": f"http://{name}:{at}/"})
    while line := await lines.readline():
        view.take(line, loop.time())
    for task in tasks:
        task.cancel()
    if observing is not None:
        observing.close()
    await runner.cleanup()


def _family(host: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in host else socket.AF_INET


def main() -> None:
    """Serve until stdin ends: the recorder has gone."""
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    try:
        asyncio.run(_serve(sys.argv[1], int(sys.argv[2])))
    except (OSError, ValueError, OverflowError) as error:
        _tell({"error": str(error)})


if __name__ == "__main__":
    main()
