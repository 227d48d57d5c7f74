"""A TCP port that carries the serial bytes as they are: pyserial opens it as socket://host:port."""

import contextlib
import select
import socket
import time

from hil_sim.carriers.backlog import Backlog
from hil_sim.errors import SimError

READ_BYTES = 65536


class TcpCarrier:
    """Implements `Carrier` for one client at a time; a second one is turned away."""

    def __init__(self, host: str = "127.0.0.1", port: int = 0) -> None:
        """Listens.

        Args:
            host, port: where; port 0 takes a free one.

        Raises:
            SimError: the machine does not let us listen there.
        """
        self._place = (host, port)
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None
        self._backlog = Backlog(self._write)
        self.plug()

    @property
    def address(self) -> str:
        """The URL that a client opens."""
        host, port = self._place
        return f"socket://{host}:{port}"

    @property
    def connected(self) -> bool:
        """A client is there."""
        return self._client is not None

    @property
    def dropped(self) -> int:
        """Bytes lost because the client did not read."""
        return self._backlog.dropped

    def pull(self) -> None:
        """The connection drops, and new ones are refused."""
        self._hang_up()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def plug(self) -> None:
        """Listens at the same address again."""
        host, port = self._place
        try:
            self._listener = socket.create_server(self._place, reuse_port=False)
        except OSError as error:
            raise SimError(
                f"{host}:{port}: cannot listen there ({error.strerror}); choose another --address"
            ) from None
        self._place = (host, self._listener.getsockname()[1])

    def close(self) -> None:
        """Hangs up and stops listening."""
        self.pull()

    def receive(self, timeout_s: float) -> bytes:
        """Waits until bytes come, at most timeout_s, and returns them."""
        if self._listener is None:
            time.sleep(timeout_s)
            return b""
        self._backlog.flush()
        sockets = [self._listener] if self._client is None else [self._listener, self._client]
        writers = [self._client] if self._client is not None and self._backlog else []
        readable, _, _ = select.select(sockets, writers, [], timeout_s)
        if self._listener in readable:
            self._welcome()
        return self._read() if self._client in readable else b""

    def send(self, data: bytes) -> None:
        """Queues bytes for the client and writes what it takes at once."""
        if self._client is not None:
            self._backlog.put(data)

    def _welcome(self) -> None:
        assert self._listener is not None
        client, _ = self._listener.accept()
        if self._client is not None:
            client.close()
            return
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.setblocking(False)
        self._client = client

    def _read(self) -> bytes:
        assert self._client is not None
        try:
            data = self._client.recv(READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._hang_up()
        return data

    def _write(self, data: bytearray) -> int:
        if self._client is None:
            raise BrokenPipeError
        return self._client.send(data)

    def _hang_up(self) -> None:
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.close()
        self._client = None
        self._backlog.clear()
