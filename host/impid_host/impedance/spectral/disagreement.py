"""Where two results on the same quantities disagree, in standard errors.

Meant for the time-domain and the spectral result on one study. Both come from the same data, so their errors
go together and the difference scatters less than the two would independently: the stated z is then on the
small side.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.impedance.spectral.arrays import Floats

NOTABLE_Z = 1.96


@dataclass(frozen=True, slots=True)
class Disagreement:
    """Two results side by side.

    Attributes:
        labels: of the two methods.
        names: of the quantities, each with its unit.
        first, second: values, shape (q,); first_sd, second_sd: their standard deviations.
        z: difference over the root of the summed variances, shape (q,).
    """

    labels: tuple[str, str]
    names: tuple[str, ...]
    first: Floats
    second: Floats
    z: Floats
    first_sd: Floats
    second_sd: Floats

    @property
    def verdict(self) -> str:
        """One sentence: which quantities disagree and by how many standard errors."""
        order = np.argsort(-np.abs(self.z))
        apart = [f"{self.names[k]} by {abs(self.z[k]):.1f}" for k in order if abs(self.z[k]) > NOTABLE_Z]
        expected = 0.05 * len(self.names)
        if not apart:
            largest = int(order[0])
            return (
                f"{self.labels[0]} and {self.labels[1]} agree; the largest difference is "
                f"{abs(self.z[largest]):.1f} standard errors, in {self.names[largest]}"
            )
        return (
            f"{self.labels[0]} and {self.labels[1]} disagree in {', '.join(apart)} standard errors "
            f"({len(apart)} of {len(self.names)} beyond 1.96; chance gives {expected:.1f})"
        )

    def __str__(self) -> str:
        head = f"{'':14s} {self.labels[0]:>14s} {self.labels[1]:>14s} {'z':>6s}"
        rows = [
            f"{name:14s} {a:14.5g} {b:14.5g} {z:6.1f}"
            for name, a, b, z in zip(self.names, self.first, self.second, self.z, strict=True)
        ]
        return "\n".join([head, *rows, self.verdict])


def disagreement(
    labels: tuple[str, str],
    names: tuple[str, ...],
    first: tuple[Floats, Floats],
    second: tuple[Floats, Floats],
) -> Disagreement:
    """Compare two results.

    Args:
        labels: of the two methods, e.g. ("time domain", "spectral").
        names: of the q quantities.
        first: values and standard deviations, shape (q,) each.
        second: the same of the other method.
    """
    (a, a_sd), (b, b_sd) = first, second
    return Disagreement(labels, names, a, b, (a - b) / np.hypot(a_sd, b_sd), a_sd, b_sd)
