"""What is connected to which pin of the chip, by board: the world's side of docs/hardware.md.

A signal that the program takes from another pin does not arrive.
"""

from dataclasses import dataclass, replace

Pin = tuple[str, int]  # port, number


@dataclass(frozen=True)
class Wiring:
    """A board around the chip.

    Attributes:
        hse_bypass: the external clock is a signal (True) or a crystal (False).
        axes: analogue channels of the accelerometer's x and y outputs (data sheet, pin definitions).
        signals: pin of each signal as `soc.PINS` names them.
        self_test, led: outputs of the board.
        encoder_faults: inputs that a healthy encoder line keeps high.
        select: output that selects a digital accelerometer on SPI2, whose SYNC is TIM1's output; None: none.
    """

    hse_bypass: bool
    axes: tuple[int, int]
    signals: dict[str, Pin]
    self_test: Pin
    led: Pin
    encoder_faults: tuple[Pin, Pin]
    select: Pin | None = None


SHARED: dict[str, Pin] = {
    "TIM2_CH2": ("B", 3),
    "TIM5_CH1": ("A", 0),
    "TIM5_CH2": ("A", 1),
    "TIM4_CH1": ("B", 6),
    "USART2_TX": ("A", 2),
    "USART2_RX": ("A", 3),
}
FAULTS: tuple[Pin, Pin] = (("B", 10), ("A", 8))
NUCLEO = Wiring(
    hse_bypass=True,
    axes=(10, 11),
    signals=SHARED | {"TIM2_CH1": ("A", 15), "CAN1_RX": ("B", 8), "CAN1_TX": ("B", 9)},
    self_test=("B", 5),
    led=("A", 5),
    encoder_faults=FAULTS,
)
NUCLEO_ADXL355 = replace(
    NUCLEO,
    signals=NUCLEO.signals
    | {"SPI2_SCK": ("B", 13), "SPI2_MISO": ("B", 14), "SPI2_MOSI": ("B", 15), "TIM1_CH2": ("A", 9)},
    select=("B", 12),
)
CUSTOM = Wiring(
    hse_bypass=False,
    axes=(12, 13),
    signals=SHARED | {"TIM2_CH1": ("A", 15), "CAN1_RX": ("A", 11), "CAN1_TX": ("A", 12)},
    self_test=("B", 5),
    led=("B", 12),
    encoder_faults=FAULTS,
)
