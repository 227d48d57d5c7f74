"""The serving process' bounds: who takes nothing is dropped, and there is a last seat."""

import asyncio
import socket

import pytest
from aiohttp import web
from aiohttp.test_utils import BaseTestServer, TestClient, TestServer
from impid_host.view import server
from impid_host.view.scale import scale_of
from impid_host.view.server import View
from impid_host.view.stream import Stream


def tab(serving: BaseTestServer) -> TestClient[web.Request, None]:
    return TestClient(serving)


def view() -> View:
    return View("token", None, Stream(scale_of(None, {}, 65536), 1000.0))


def test_a_tab_that_takes_nothing_is_dropped_and_the_others_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pushes so large that the kernel's buffers are full at once."""
    monkeypatch.setattr(server, "_PATIENCE_S", 1.0)
    own = view()
    monkeypatch.setattr(own, "_state", lambda _now: {"points": "x" * 400_000})

    async def look() -> int:
        async with TestServer(own.application()) as serving, tab(serving) as client:
            good = await client.ws_connect("/ws")
            reading = asyncio.create_task(_drain(good))
            deaf = socket.create_connection(("127.0.0.1", serving.port))
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            deaf.sendall(
                b"GET /ws HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
            )
            pushing = asyncio.create_task(own.push_on())
            while len(own._tabs) < 2:
                await asyncio.sleep(0.05)
            deadline = asyncio.get_running_loop().time() + 20
            while len(own._tabs) > 1 and asyncio.get_running_loop().time() < deadline:
                await asyncio.sleep(0.1)
            left = len(own._tabs)
            pushing.cancel()
            reading.cancel()
            deaf.close()
            return left

    assert asyncio.run(look()) == 1


def test_there_is_a_last_seat(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MOST_TABS", 3)
    own = view()

    async def look() -> int:
        async with TestServer(own.application()) as serving, tab(serving) as client:
            seats = [await client.ws_connect("/ws") for _ in range(3)]
            answer = await client.get("/ws", headers={"Upgrade": "websocket", "Connection": "Upgrade"})
            for seat in seats:
                await seat.close()
            return answer.status

    assert asyncio.run(look()) == web.HTTPServiceUnavailable.status_code


async def _drain(socket_: object) -> None:
    async for _ in socket_:  # type: ignore[attr-defined]
        pass
