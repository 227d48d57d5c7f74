"""Many readers of a live page at once, in a thread of their own."""

import asyncio
import threading
from typing import Self

import aiohttp


class ManyTabs:
    """Opens `count` sockets, reads all of them until closed, and counts what each was sent."""

    def __init__(self, url: str, count: int) -> None:
        self.counts = [0] * count
        self._url = url
        self._loop = asyncio.new_event_loop()
        self._open = threading.Event()
        self._thread = threading.Thread(target=self._loop.run_until_complete, args=(self._read(),))
        self._done = asyncio.Event()

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._open.wait(60), "the sockets did not open"
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._done.set)
        self._thread.join(20)
        self._loop.close()

    async def _read(self) -> None:
        connector = aiohttp.TCPConnector(limit=0)
        async with aiohttp.ClientSession(connector=connector) as session:
            sockets = [await session.ws_connect(f"{self._url}ws") for _ in self.counts]
            readers = [asyncio.create_task(self._count(k, each)) for k, each in enumerate(sockets)]
            self._open.set()
            await self._done.wait()
            for reader in readers:
                reader.cancel()
            await asyncio.gather(*readers, return_exceptions=True)

    async def _count(self, number: int, socket: aiohttp.ClientWebSocketResponse) -> None:
        async for _ in socket:
            self.counts[number] += 1
