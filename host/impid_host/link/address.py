"""Where the board is, as the user says it, and how to get there as often as it takes."""

from dataclasses import dataclass

from impid_host.errors import LinkError
from impid_host.extras import need
from impid_host.link.discovery import find_baud, find_port
from impid_host.link.link import Link
from impid_host.link.port import SerialLink
from impid_host.wire.messages import SERIAL_BAUD

AUTO = "auto"


@dataclass(slots=True)
class Address:
    """A serial port (device, socket://host:port, or "auto") or a CAN bus (INTERFACE:CHANNEL[@BITRATE]).

    `baud` None: the speed is found at the first opening and kept.
    """

    port: str | None = None
    can: str | None = None
    baud: int | None = None

    @property
    def comes_back(self) -> bool:
        """Whether what goes by this name later is the same port: a terminal's number is given to the next."""
        return "/dev/pts/" not in (self.port or self.can or "")

    def open(self) -> Link:
        """Open it.

        Raises:
            LinkError: it cannot be found or opened.
            MissingExtraError: it is a CAN bus, and the packages for these are not installed.
        """
        if self.can is not None:
            need("can", "a CAN bus")
            from impid_host.link.can_bus import CanLink  # noqa: PLC0415  (an extra)

            return CanLink.open(self.can)
        # Looked for each time: after a cable was out, the system may give the board another name.
        port = find_port() if self.port in (None, AUTO) else str(self.port)
        link = SerialLink.open(port, self.baud or SERIAL_BAUD)
        if self.baud is None:
            try:
                self.baud = find_baud(link)
            except LinkError:
                link.close()
                raise
        return link
