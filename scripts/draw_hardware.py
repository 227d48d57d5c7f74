"""Draw the figures of docs/hardware.md into docs/img: the wiring and the bandwidth.

The bandwidth is that of the taps committed in firmware/core/impid_decimator_taps.h; the figures that the
page quotes are printed here.
"""

import re
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch
from scipy import signal

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "img"
TAPS_HEADER = ROOT / "firmware" / "core" / "impid_decimator_taps.h"
ADC_HZ, SAMPLE_HZ = 8000, 1000
R_FILTER_OHM, R_TOLERANCE = 32e3, 0.25  # ADXL203 data sheet: 32 kOhm, typically within 25 %
C_FILTER_F = 10e-9
INK, SOFT = "#22313f", "#5b6b7b"
COLOURS = {
    "power": "#c0392b",
    "ground": "#22313f",
    "signal": "#2a6f97",
    "bus": "#b8860b",
    "digital": "#3a7d44",
}


def taps() -> np.ndarray:
    """Impulse response of the committed decimation filter, gain 1 at DC. Shape (28,)."""
    values = re.search(r"IMPID_DECIMATOR_TAP_VALUES((?:.|\n)*?)\n\n", TAPS_HEADER.read_text())
    assert values is not None
    integers = np.array([int(number) for number in re.findall(r"-?\d+", values[1])])
    return np.asarray(integers / integers.sum())


def sensor_gain(f_hz: np.ndarray, r_ohm: float = R_FILTER_OHM) -> np.ndarray:
    """First-order low-pass of the accelerometer's output. Shape of `f_hz`."""
    return 1 / np.sqrt(1 + (2 * np.pi * f_hz * r_ohm * C_FILTER_F) ** 2)


def decibels(gain: np.ndarray) -> np.ndarray:
    return np.asarray(20 * np.log10(np.maximum(gain, 1e-6)))


def half_power_hz(f_hz: np.ndarray, gain: np.ndarray) -> float:
    return float(f_hz[np.argmax(gain < np.sqrt(0.5))])


def draw_bandwidth() -> list[str]:
    """The plot; returns the figures that the page quotes."""
    f = np.linspace(0.5, 4000, 80000)
    fir = np.abs(signal.freqz(taps(), worN=f, fs=ADC_HZ)[1])
    sensor = sensor_gain(f)
    both = fir * sensor
    figure, (whole, band) = plt.subplots(1, 2, figsize=(9.6, 3.7), width_ratios=(1.5, 1))
    for axes in (whole, band):
        axes.plot(f, decibels(sensor), color="#2a6f97", lw=1.2, label="ADXL203 with 10 nF (497 Hz)")
        axes.fill_between(
            f, decibels(sensor_gain(f, R_FILTER_OHM * (1 + R_TOLERANCE))),
            decibels(sensor_gain(f, R_FILTER_OHM * (1 - R_TOLERANCE))), color="#2a6f97", alpha=0.15, lw=0,
            label="its resistor, 32 kΩ ± 25 %",
        )  # fmt: skip
        axes.plot(f, decibels(fir), color="#b8860b", lw=1.2, label="decimation filter, 28 taps")
        axes.plot(f, decibels(both), color="#c0392b", lw=1.8, label="both: what a sample sees")
        axes.grid(color="#d7dde3", lw=0.5)
        axes.set_xlabel("frequency (Hz)")
    for image in range(1, 4):
        near = (image * SAMPLE_HZ - 60, image * SAMPLE_HZ + 60)
        whole.axvspan(
            *near, color="#22313f", alpha=0.12, lw=0, label="folds into 0..60 Hz" if image == 1 else None
        )
    whole.set(xlim=(0, 4000), ylim=(-100, 5), ylabel="gain (dB)")
    whole.legend(fontsize=7.5, loc=(0.44, 0.43), framealpha=0.95)
    band.set(xlim=(0, 120), ylim=(-0.5, 0.05), title="the band of arm impedance")
    whole.set_title("what aliases, and what does not")
    figure.tight_layout()
    save(figure, "hardware-bandwidth")
    folding = (f >= SAMPLE_HZ - 60) & (f <= SAMPLE_HZ + 60)
    noise_hz = float(np.trapezoid(both**2, f))
    at = {hz: float(np.interp(hz, f, decibels(both))) for hz in (10, 30, 60)}
    folded, folded_fir = decibels(both)[folding].max(), decibels(fir)[folding].max()
    delay_us = 1e6 * R_FILTER_OHM * C_FILTER_F
    return [
        f"-3 dB: sensor {half_power_hz(f, sensor):.0f} Hz, filter {half_power_hz(f, fir):.0f} Hz, "
        f"both {half_power_hz(f, both):.0f} Hz",
        f"gain of both at 10, 30, 60 Hz: {at[10]:.3f}, {at[30]:.3f}, {at[60]:.3f} dB",
        f"worst gain that folds into 0..60 Hz: {folded:.1f} dB (filter alone {folded_fir:.1f} dB)",
        f"equivalent noise bandwidth {noise_hz:.0f} Hz: "
        f"{0.19 * np.sqrt(noise_hz):.2f} mg rms of 190 ug/sqrt(Hz)",
        f"sensor delay {delay_us:.0f} us nominal, {delay_us * R_TOLERANCE:.0f} us either way by its resistor",
    ]


def box(axes: Axes, x: float, y: float, w: float, h: float, title: str, fill: str = "#f4f6f8") -> None:
    axes.add_patch(
        FancyBboxPatch((x, y), w, h, boxstyle="round,pad=0,rounding_size=0.12", fc=fill, ec=SOFT, lw=1.1)
    )
    axes.text(x + w / 2, y + h - 0.2, title, ha="center", va="top", fontsize=9, weight="bold", color=INK)


def pin(axes: Axes, x: float, y: float, text: str, side: str) -> None:
    axes.plot([x], [y], "s", color=INK, ms=3.5, zorder=3)
    inside = 0.12 if side == "left" else -0.12
    axes.text(
        x + inside, y, text, ha="left" if side == "left" else "right", va="center", fontsize=7, color=INK
    )


def wire(axes: Axes, points: list[tuple[float, float]], kind: str, label: str = "", at: float = 0.5) -> None:
    xs, ys = zip(*points, strict=True)
    axes.plot(xs, ys, color=COLOURS[kind], lw=1.4, solid_joinstyle="round", zorder=1)
    if label:
        (x0, y0), (x1, _) = points[0], points[1]
        axes.text(x0 + at * (x1 - x0), y0 + 0.05, label, ha="center", va="bottom", fontsize=6.3, color=SOFT)


def draw_wiring() -> None:
    figure, axes = plt.subplots(figsize=(10.4, 7.3))
    axes.set(xlim=(0, 16), ylim=(0, 11.6))
    axes.axis("off")
    draw_nucleo(axes)
    draw_accelerometer(axes)
    draw_encoders(axes)
    draw_right_side(axes)
    for i, (name, colour) in enumerate(
        {
            "supply": "power",
            "ground": "ground",
            "analogue": "signal",
            "digital 3.3 V": "digital",
            "line pairs": "bus",
        }.items()
    ):
        axes.plot([0.3 + 2.3 * i, 0.8 + 2.3 * i], [0.25, 0.25], color=COLOURS[colour], lw=2)
        axes.text(0.9 + 2.3 * i, 0.25, name, va="center", fontsize=7.5, color=INK)
    figure.tight_layout(pad=0.3)
    save(figure, "hardware-wiring")


LEFT_PINS = {
    10.3: "AVDD  CN10-7", 9.7: "GND  CN10-9", 9.1: "A5  PC0  x", 8.5: "A4  PC1  y", 7.9: "D4  PB5  self-test",
    6.3: "3V3  CN6-4", 5.7: "GND  CN6-6", 5.1: "CN7-17  PA15  enc 1 A", 4.5: "D3  PB3  enc 1 B",
    3.9: "A0  PA0  enc 2 A", 3.3: "A1  PA1  enc 2 B",
    2.1: "D6  PB10  enc 1 fault", 1.5: "D7  PA8  enc 2 fault",
}  # fmt: skip
RIGHT_PINS = {
    9.7: "USB  ST-LINK", 7.4: "3V3  CN7-16", 6.8: "GND  CN7-20", 6.2: "PB9  D14  CAN TX",
    5.6: "PB8  D15  CAN RX", 3.6: "PB6  D10  sync", 3.0: "GND  CN5-7",
}  # fmt: skip


def draw_nucleo(axes: Axes) -> None:
    box(axes, 7.0, 1.0, 3.9, 10.2, "Nucleo-F446RE", "#e3eef5")
    for y, text in LEFT_PINS.items():
        pin(axes, 7.0, y, text, "left")
    for y, text in RIGHT_PINS.items():
        pin(axes, 10.9, y, text, "right")


def draw_accelerometer(axes: Axes) -> None:
    box(axes, 0.3, 7.5, 3.0, 3.5, "ADXL203 module\non the end point")
    for y, text in {10.3: "Vs", 9.7: "COM", 9.1: "Xout", 8.5: "Yout", 7.9: "ST"}.items():
        pin(axes, 3.3, y, text, "right")
    wire(axes, [(3.3, 10.3), (7.0, 10.3)], "power", "100 nF to COM at the module", 0.5)
    wire(axes, [(3.3, 9.7), (7.0, 9.7)], "ground")
    wire(axes, [(3.3, 9.1), (7.0, 9.1)], "signal", "10 nF to COM", 0.3)
    wire(axes, [(3.3, 8.5), (7.0, 8.5)], "signal", "10 nF to COM", 0.3)
    wire(axes, [(3.3, 7.9), (7.0, 7.9)], "digital")


def draw_encoders(axes: Axes) -> None:
    box(axes, 3.1, 2.45, 2.3, 4.9, "AM26LV32\nline receiver")
    for y, text in {6.3: "Vcc", 5.7: "GND", 5.1: "1Y", 4.5: "2Y", 3.9: "3Y", 3.3: "4Y"}.items():
        pin(axes, 5.4, y, text, "right")
        kind = {"Vcc": "power", "GND": "ground"}.get(text, "digital")
        wire(axes, [(5.4, y), (7.0, y)], kind)
    note(axes, 6.2, 6.36, "100 nF")
    note(axes, 4.25, 2.52, "G to Vcc")
    for n, top in ((1, 5.1), (2, 3.3)):
        box(axes, 0.4, top - 0.95, 1.4, 1.6, f"encoder {n}")
        for row, line in enumerate("AB"):
            y = top - 0.6 * row
            axes.text(1.72, y, f"{line}, {line}̅", ha="right", va="center", fontsize=6.5, color=INK)
            wire(axes, [(1.8, y - 0.06), (3.1, y - 0.06)], "bus")
            wire(axes, [(1.8, y + 0.06), (3.1, y + 0.06)], "bus")
            note(axes, 2.45, y + 0.09, "120 Ω across")
    axes.text(
        0.4, 6.75, "The encoders keep their\nown supply; grounds joined.", va="top", fontsize=6.5, color=SOFT
    )
    wire(axes, [(7.0, 2.1), (0.15, 2.1), (0.15, 4.5), (0.4, 4.5)], "digital")
    wire(axes, [(7.0, 1.5), (1.1, 1.5), (1.1, 2.35)], "digital")
    note(axes, 4.6, 2.16, "fault output of encoder 1, low = fault, 3.3 V; else leave open")
    note(axes, 4.6, 1.56, "the same of encoder 2")


def note(axes: Axes, x: float, y: float, text: str) -> None:
    axes.text(x, y, text, ha="center", va="bottom", fontsize=6.3, color=SOFT)


def draw_right_side(axes: Axes) -> None:
    box(axes, 12.6, 8.9, 3.1, 1.7, "PC")
    axes.text(
        14.15,
        9.5,
        "USB: power, flashing,\nserial line 921600 baud",
        ha="center",
        va="center",
        fontsize=7,
        color=INK,
    )
    wire(axes, [(10.9, 9.7), (12.6, 9.7)], "digital", "USB", 0.5)
    box(axes, 12.6, 5.1, 1.9, 3.0, "SN65HVD230")
    for y, text in {7.4: "Vcc", 6.8: "GND, Rs", 6.2: "D", 5.6: "R"}.items():
        pin(axes, 12.6, y, text, "left")
        wire(axes, [(10.9, y), (12.6, y)], {7.4: "power", 6.8: "ground"}.get(y, "digital"))
    for y, text in {6.5: "CANH", 5.9: "CANL"}.items():
        pin(axes, 14.5, y, text, "right")
        wire(axes, [(14.5, y), (15.7, y)], "bus")
    axes.text(15.1, 6.62, "CAN 1 Mbit/s", ha="center", fontsize=6.3, color=SOFT)
    axes.text(15.1, 5.5, "120 Ω at each\nend of the bus", ha="center", va="center", fontsize=6.3, color=SOFT)
    box(axes, 12.6, 2.5, 3.1, 1.9, "robot controller")
    axes.text(
        14.15,
        3.35,
        "sync output: a rising edge\nat a known row of its log",
        ha="center",
        va="center",
        fontsize=7,
        color=INK,
    )
    wire(axes, [(10.9, 3.6), (12.6, 3.6)], "digital", "1 kΩ", 0.5)
    wire(axes, [(10.9, 3.0), (12.6, 3.0)], "ground")


def save(figure: mpl.figure.Figure, name: str) -> None:
    # Neither date nor random names: the same drawing gives the same bytes.
    figure.savefig(IMAGES / f"{name}.svg", metadata={"Date": None})
    if "--png" in sys.argv:
        figure.savefig(ROOT / "build" / f"{name}.png", dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    mpl.use("Agg")
    mpl.rcParams.update({"svg.hashsalt": "impid", "svg.fonttype": "none", "font.family": "DejaVu Sans"})
    draw_wiring()
    sys.stdout.write("\n".join(draw_bandwidth()) + "\n")
