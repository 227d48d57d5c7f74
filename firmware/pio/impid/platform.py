"""The platform has nothing of its own to configure: compilers come from the system, boards from boards/."""

from platformio.public import PlatformBase


class ImpidPlatform(PlatformBase):
    """Boards of impid."""
