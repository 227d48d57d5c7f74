"""What the emulator refuses: it never guesses what the chip would do."""

from hil_sim.errors import SimError


class EmulatorError(SimError):
    """The binary did something that the emulator does not carry on from."""


class UnmodelledAccess(EmulatorError):
    """A register or a bit that no model covers was read or written.

    Attributes:
        peripheral, register: names as in the reference manual; register may be "?".
        address: where on the bus.
        bits: the offending bits of the value, or the whole value.
        pc: address of the block of instructions that did it.
    """

    def __init__(self, what: str, peripheral: str, register: str, address: int, bits: int, pc: int) -> None:
        super().__init__(
            f"{what}: {peripheral}_{register} at 0x{address:08X}, bits 0x{bits:08X}, "
            f"block at PC 0x{pc:08X}; the emulator does not model it"
        )
        self.peripheral = peripheral
        self.register = register
        self.address = address
        self.bits = bits
        self.pc = pc


class RuleViolation(EmulatorError):
    """The reference manual forbids what the binary did, or leaves its effect undefined.

    Attributes:
        section: of RM0390, where the rule stands.
        pc: address of the block of instructions that did it.
    """

    def __init__(self, peripheral: str, rule: str, section: str, pc: int) -> None:
        super().__init__(f"{peripheral}: {rule} (RM0390 {section}); block at PC 0x{pc:08X}")
        self.section = section
        self.pc = pc


class CpuFault(EmulatorError):
    """The processor touched memory that is not there, or met an instruction that it cannot execute."""


class PowerCut(EmulatorError):
    """The supply was cut, as a test asked; the flash keeps what was in it."""
