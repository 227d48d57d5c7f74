"""The platform of impid: the system's own tools first, PlatformIO's packages where the system has none."""

import shutil

from platformio.public import PlatformBase


class ImpidPlatform(PlatformBase):
    """Boards of impid."""

    def configure_default_packages(self, options, targets):
        board = options.get("board")
        if board and self.board_config(board).get("build.toolchain") == "arm":
            if shutil.which("arm-none-eabi-gcc") is None:
                self.packages["toolchain-gccarmnoneeabi"]["optional"] = False
            if "upload" in targets and shutil.which("openocd") is None:
                self.packages["tool-openocd"]["optional"] = False
        return super().configure_default_packages(options, targets)
