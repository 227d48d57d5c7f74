"""Which numbers of a load's matrices are worth a row or a panel, and in which unit people read them."""

from dataclasses import dataclass

from impid_host.impedance.identify import LoadFit
from impid_host.impedance.loads import Signal
from impid_host.impedance.matrices import Matrices, Quantity
from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Entry:
    """One number of a load: its label, the quantity and index it is read from, and its unit for reading."""

    label: str
    quantity: str
    index: tuple[int, ...]
    unit: str
    scale: float = 1.0

    def of(self, fit: LoadFit | Matrices) -> tuple[float, Floats]:
        """Value and 95 % interval (2,), in `unit`."""
        quantity: Quantity = getattr(fit, self.quantity)
        return float(quantity.value[self.index]) * self.scale, quantity.ci95[self.index] * self.scale


def parameter_entries(fit: LoadFit) -> list[Entry]:
    """The entries of a load, one for each number of its model; then the equilibrium."""
    letters: dict[Signal, str] = {"a": "M", "v": "B", "x": "K"}
    own = [
        Entry(column.name, letters[column.signal], column.entries[0], column.unit)
        for column in fit.model.columns
        if column.signal != "1"
    ]
    if fit.model.rotary:
        return [*own, Entry("theta0", "x0", (0,), "rad")]
    return [*own, *(Entry(f"{axis}0", "x0", (k,), "mm", 1e3) for k, axis in enumerate(fit.model.axes))]
