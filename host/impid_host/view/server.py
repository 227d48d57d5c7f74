"""The serving process of the live view: lines of JSON in on stdin, a page and its WebSocket out.

Looking is free on the address that it serves. Whatever stops or writes something needs the token that the
recorder's console printed. Requests that name another host are refused, so that no web page elsewhere can
reach in by giving its own name the address of this machine.
"""

import asyncio
import contextlib
import hmac
import ipaddress
import json
import socket
import sys
from collections import deque
from importlib import resources
from typing import Any

from aiohttp import WSMsgType, web

from impid_host.view.spectrum import SEGMENT, amplitude_spectrum

_PAGE = {
    "/": ("page.html", "text/html"),
    "/view.js": ("view.js", "text/javascript"),
    "/view.css": ("view.css", "text/css"),
}
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
_PUSH_S = 0.05
_SPECTRUM_EVERY = 10  # pushes
_SERIES = ("index", "t_us", "ax", "ay", "enc1", "enc2")
_KEPT = 4 * SEGMENT
_LARGEST_MARK = 200


class View:
    """What the page shows, and who looks at it."""

    def __init__(self, token: str, own_hosts: frozenset[str] | None) -> None:
        self._token = token
        self._own_hosts = own_hosts
        self._fresh: dict[web.WebSocketResponse, dict[str, list[int]]] = {}  # what each has not been sent
        self._busy: set[web.WebSocketResponse] = set()
        self._sending: set[asyncio.Task[None]] = set()
        self._recent = {axis: deque[int](maxlen=_KEPT) for axis in ("ax", "ay")}
        self._progress: dict[str, Any] = {}
        self._run: tuple[int, int] | None = None

    def application(self) -> web.Application:
        """The routes."""
        application = web.Application(middlewares=[self._guard], client_max_size=4096)
        for path in _PAGE:
            application.router.add_get(path, self._page)
        application.router.add_get("/ws", self._socket)
        application.router.add_post("/api/stop", self._stop)
        application.router.add_post("/api/mark", self._mark)
        return application

    def take(self, message: dict[str, Any]) -> None:
        """A line of the recorder."""
        if message["kind"] == "progress":
            self._progress = message
            return
        run = (message["boot_id"], message["run"])
        if run != self._run:
            self._run = run
            for kept in self._recent.values():
                kept.clear()
            for fresh in self._fresh.values():
                fresh.update(_nothing())
        for fresh in self._fresh.values():
            for name in _SERIES:
                # A browser that hangs misses pieces instead of filling the memory.
                fresh[name] = (fresh[name] + message[name])[-_KEPT:]
        for axis, kept in self._recent.items():
            kept.extend(message[axis])

    async def push_on(self) -> None:
        """Send what is new to everybody who can take it, for ever."""
        turn = 0
        while True:
            await asyncio.sleep(_PUSH_S)
            turn += 1
            lines = self._spectrum() if turn % _SPECTRUM_EVERY == 0 else None
            for each in self._fresh.keys() - self._busy:
                self._busy.add(each)
                fresh, self._fresh[each] = self._fresh[each], _nothing()
                message = {"run": self._run, "samples": fresh, "progress": self._progress, "spectrum": lines}
                task = asyncio.create_task(self._send(each, json.dumps(message, separators=(",", ":"))))
                self._sending.add(task)
                task.add_done_callback(self._sending.discard)

    def _spectrum(self) -> dict[str, list[float]] | None:
        if len(self._recent["ax"]) < SEGMENT:
            return None
        return {
            axis: [round(v, 3) for v in amplitude_spectrum(list(kept)).tolist()]
            for axis, kept in self._recent.items()
        }

    async def _send(self, to: web.WebSocketResponse, text: str) -> None:
        try:
            with contextlib.suppress(ConnectionError, RuntimeError):
                await to.send_str(text)
        finally:
            self._busy.discard(to)

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
        response = web.WebSocketResponse(heartbeat=10.0, max_msg_size=1024)
        await response.prepare(request)
        self._fresh[response] = _nothing()
        try:
            async for message in response:  # nothing that comes this way has any effect
                if message.type is WSMsgType.ERROR:
                    break
        finally:
            self._fresh.pop(response, None)
        return response

    async def _stop(self, _: web.Request) -> web.Response:
        _tell({"command": "stop"})
        return web.json_response({"done": "stop"})

    async def _mark(self, request: web.Request) -> web.Response:
        _tell({"command": "mark", "text": (await request.text())[:_LARGEST_MARK]})
        return web.json_response({"done": "mark"})


def _nothing() -> dict[str, list[int]]:
    return {name: [] for name in _SERIES}


def _tell(message: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


async def _serve(host: str, port: int) -> None:
    lines = asyncio.StreamReader(limit=1 << 22)
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
    token = (await lines.readline()).decode().strip()
    listening = socket.create_server((host, port), family=_family(host))
    name = f"[{host}]" if ":" in host else host
    at = listening.getsockname()[1]
    own = frozenset({f"{name}:{at}", f"localhost:{at}"}) if ipaddress.ip_address(host).is_loopback else None
    view = View(token, own)
    runner = web.AppRunner(view.application(), access_log=None)
    await runner.setup()
    await web.SockSite(runner, listening).start()
    _tell({"url": f"http://{name}:{at}/"})
    pushing = asyncio.create_task(view.push_on())
    while line := await lines.readline():
        view.take(json.loads(line))
    pushing.cancel()
    await runner.cleanup()


def _family(host: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in host else socket.AF_INET


def main() -> None:
    """Serve until stdin ends: the recorder has gone."""
    try:
        asyncio.run(_serve(sys.argv[1], int(sys.argv[2])))
    except (OSError, ValueError, OverflowError) as error:
        _tell({"error": str(error)})


if __name__ == "__main__":
    main()
