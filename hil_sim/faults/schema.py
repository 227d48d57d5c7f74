"""[[faults]] of a scenario: what goes wrong, when, for how long, how badly.

at_s counts on the board's clock from the moment when the motion begins (the robot log's first row); times are
whole milliseconds, the board's tick.
"""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

Probability = Annotated[float, Field(gt=0.0, le=1.0)]
Duration = Annotated[float, Field(gt=0.0, le=86400.0)]
US_PER_MS = 1000


class _Fault(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    at_s: Annotated[float, Field(ge=0.0, le=86400.0)]
    trials: tuple[str, ...] | None = None  # None: all

    @field_validator("at_s", "duration_s", check_fields=False)
    @classmethod
    def _whole_milliseconds(cls, value: float) -> float:
        if abs(1e3 * value - round(1e3 * value)) > 1e-6:
            raise ValueError("the board knows whole milliseconds only: round it to 0.001")
        return value

    @property
    def begin_us(self) -> int:
        """From the start of the motion to the fault."""
        return US_PER_MS * round(1e3 * self.at_s)

    @property
    def end_us(self) -> int:
        """From the start of the motion to the fault's end; begin_us for what takes no time."""
        return self.begin_us


class _Window(_Fault):
    duration_s: Duration

    @property
    def end_us(self) -> int:
        """From the start of the motion to the fault's end."""
        return self.begin_us + US_PER_MS * round(1e3 * self.duration_s)


class _SerialDamage(_Window):
    rate: Probability
    direction: Literal["to_host", "to_board"] = "to_host"


class BitErrors(_SerialDamage):
    """Bits of the serial line arrive inverted; rate is per bit."""

    kind: Literal["bit_errors"]


class DroppedBytes(_SerialDamage):
    """Bytes of the serial line do not arrive; rate is per byte."""

    kind: Literal["dropped_bytes"]


class DuplicatedBytes(_SerialDamage):
    """Bytes of the serial line arrive twice; rate is per byte."""

    kind: Literal["duplicated_bytes"]


class DroppedFrames(_Window):
    """CAN frames to the host are missed by the adapter; rate is per frame."""

    kind: Literal["dropped_frames"]
    rate: Probability


class DuplicatedFrames(_Window):
    """CAN frames to the host come twice, as when an acknowledge is lost; rate is per frame."""

    kind: Literal["duplicated_frames"]
    rate: Probability


class LineStall(_Window):
    """Nothing passes in either direction; what waited comes at once at the end, as behind a busy USB hub."""

    kind: Literal["line_stall"]


class SlowReader(_Window):
    """The client's machine fetches slowly; what the adapter's buffer cannot hold is lost.

    On CAN a frame counts as its 14 bytes on the bus.
    """

    kind: Literal["slow_reader"]
    bytes_per_s: Annotated[float, Field(ge=0.0)]
    buffer_bytes: Annotated[int, Field(ge=0)] = 4096


class CablePulled(_Window):
    """The cable is out: the connection drops, and comes back at the same address."""

    kind: Literal["cable_pulled"]


class MainLoopStall(_Window):
    """The board's main loop hangs; sampling goes on into the ring of 256, the rest is lost and counted."""

    kind: Literal["main_loop_stall"]


class BoardReset(_Fault):
    """The reset button; the board is back 5 ms later."""

    kind: Literal["board_reset"]


class BrownOut(_Window):
    """The supply is gone for duration_s; then the board boots."""

    kind: Literal["brown_out"]


class Watchdog(_Window):
    """The main loop hangs for duration_s, then the watchdog resets the board."""

    kind: Literal["watchdog"]


class BusOff(_Window):
    """The bus is shorted: the controller leaves it, recovers, and leaves again until the short is gone."""

    kind: Literal["bus_off"]


class AdcSaturation(_Window):
    """An input of the converter is driven to a rail."""

    kind: Literal["adc_saturation"]
    axis: Literal["x", "y", "both"] = "both"
    rail: Literal["high", "low"] = "high"


class EncoderLost(_Window):
    """One quadrature line is broken: the counter stands still, and what it missed is missing for good.

    `reported` says whether the encoder's line driver tells the board.
    """

    kind: Literal["encoder_lost"]
    encoder: Literal[1, 2]
    reported: bool = True


class TorqueLogTruncated(_Fault):
    """The robot's controller dies: its log ends in the middle of a row."""

    kind: Literal["torque_log_truncated"]


Fault = Annotated[
    BitErrors
    | DroppedBytes
    | DuplicatedBytes
    | DroppedFrames
    | DuplicatedFrames
    | LineStall
    | SlowReader
    | CablePulled
    | MainLoopStall
    | BoardReset
    | BrownOut
    | Watchdog
    | BusOff
    | AdcSaturation
    | EncoderLost
    | TorqueLogTruncated,
    Field(discriminator="kind"),
]

# What makes sense only where such bytes or frames exist.
SERIAL_ONLY = (BitErrors, DroppedBytes, DuplicatedBytes)
RESTARTS = (BoardReset, BrownOut, Watchdog)
CAN_ONLY = (DroppedFrames, DuplicatedFrames, BusOff)
