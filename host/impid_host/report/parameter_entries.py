"""Which numbers of a load's matrices are worth a row or a panel, and in which unit people read them."""

from dataclasses import dataclass

from impid_host.impedance.identify import LoadFit, Quantity
from impid_host.signals.arrays import Floats

_AXES = ("x", "y")


@dataclass(frozen=True, slots=True)
class Entry:
    """One number of a load: its label, the quantity and index it is read from, and its unit for reading."""

    label: str
    quantity: str
    index: tuple[int, ...]
    unit: str
    scale: float = 1.0

    def of(self, fit: LoadFit) -> tuple[float, Floats]:
        """Value and 95 % interval (2,), in `unit`."""
        quantity: Quantity = getattr(fit, self.quantity)
        return float(quantity.value[self.index]) * self.scale, quantity.ci95[self.index] * self.scale


def parameter_entries(fit: LoadFit) -> list[Entry]:
    """The entries of a load; a scalar mass or a symmetric matrix shows each number once."""
    if fit.model.name == "mass-spring":
        own = [
            Entry("m", "M", (0, 0), "kg"),
            Entry("kxx", "K", (0, 0), "N/m"),
            Entry("kyy", "K", (1, 1), "N/m"),
            Entry("ks", "K", (0, 1), "N/m"),
        ]
    else:
        own = [
            Entry(f"{letter.lower()}{_AXES[i]}{_AXES[j]}", letter, (i, j), unit)
            for letter, unit in (("M", "kg"), ("B", "N*s/m"), ("K", "N/m"))
            for i in range(2)
            for j in range(2)
        ]
    return [*own, Entry("x0", "x0", (0,), "mm", 1e3), Entry("y0", "x0", (1,), "mm", 1e3)]
