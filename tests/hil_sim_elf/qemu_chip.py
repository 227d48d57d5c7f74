"""The shipping binary on QEMU's STM32F4 machine, stopped and looked at through QEMU's debug port.

QEMU executes the processor's faults as the architecture has them (escalation, fault status, stacking), which the
emulator in hil_sim leaves out. Most peripherals of the machine are empty: the program runs up to where it waits
for a clock, which is all that its fault handlers need.
"""

import socket
import subprocess
from pathlib import Path
from types import TracebackType

MACHINE = "netduinoplus2"  # STM32F405: Cortex-M4, flash and RAM where the F446 has them
CORE_REGISTERS = {"r0": 0, "r1": 1, "sp": 13, "lr": 14, "pc": 15}
ANSWER_S = 20.0


class QemuChip:
    """A machine that stands still at reset; see GDB's remote serial protocol for the packets."""

    def __init__(self, image: Path, folder: Path) -> None:
        path = folder / "debug"
        self._listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listening.bind(str(path))
        self._listening.listen(1)
        self._process = subprocess.Popen(
            [
                *("qemu-system-arm", "-machine", MACHINE, "-kernel", image, "-S", "-display", "none"),
                *("-monitor", "none", "-serial", "none", "-chardev", f"socket,id=debug,path={path}"),
                *("-gdb", "chardev:debug"),
            ],
            stdout=subprocess.DEVNULL,
        )
        self._listening.settimeout(ANSWER_S)
        self._line, _ = self._listening.accept()
        self._line.settimeout(ANSWER_S)
        self._waiting = b""
        # QEMU gives single registers to those only who have asked what registers there are.
        assert self._ask("qXfer:features:read:target.xml:0,fff")[:1] in "lm"

    def __enter__(self) -> "QemuChip":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
        self._line.close()
        self._listening.close()

    # --- packets ------------------------------------------------------------------------------------

    def _send(self, text: str) -> None:
        self._line.sendall(f"${text}#{sum(text.encode()) & 0xFF:02x}".encode())

    def _receive(self) -> str:
        while not (b"#" in self._waiting and len(self._waiting) >= self._waiting.index(b"#") + 3):
            data = self._line.recv(4096)
            if not data:
                raise ConnectionError("QEMU has closed its debug port")
            self._waiting += data
        begin, end = self._waiting.index(b"$"), self._waiting.index(b"#")
        packet, self._waiting = self._waiting[begin + 1 : end], self._waiting[end + 3 :]
        self._line.sendall(b"+")
        return packet.decode()

    def _ask(self, text: str) -> str:
        self._send(text)
        return self._receive()

    # --- the chip -----------------------------------------------------------------------------------

    def register(self, name: str) -> int:
        """A core register."""
        return int.from_bytes(bytes.fromhex(self._ask(f"p{CORE_REGISTERS[name]:x}")), "little")

    def set_register(self, name: str, value: int) -> None:
        """Sets a core register."""
        assert self._ask(f"P{CORE_REGISTERS[name]:x}={value.to_bytes(4, 'little').hex()}") == "OK"

    def read(self, address: int, size: int) -> bytes:
        """Memory as the processor sees it."""
        return bytes.fromhex(self._ask(f"m{address:x},{size:x}"))

    def write(self, address: int, data: bytes) -> None:
        """Writes memory."""
        assert self._ask(f"M{address:x},{len(data):x}:{data.hex()}") == "OK"

    def run_to(self, address: int) -> None:
        """Runs until the instruction at an address is next."""
        assert self._ask(f"Z0,{address & ~1:x},2") == "OK"
        stopped = self._ask("c")
        assert stopped.startswith("T05"), stopped
        assert self.register("pc") == address & ~1
        assert self._ask(f"z0,{address & ~1:x},2") == "OK"
