"""The stand-in's platform: nothing to choose, the system's tools are used as they are."""

from platformio.public import PlatformBase


class Ststm32Platform(PlatformBase):
    """Boards with an STM32, built without a framework."""
