"""Whether a name has one value everywhere, on rows of which it is known."""

import numpy as np
import pytest
from impid_host.diagnosis.constancy import Constancy, constancies

from .synthetic import Rows, curve, term

NAME = "friction.coulomb@joint1"


def taken(values: np.ndarray, **more: object) -> float:
    """Inconstancy of a name whose coefficient in each channel and trial is that of `values`."""
    rows = Rows([term("friction.coulomb", "joint1"), curve("tau1", "theta1", size=2)], **more)  # type: ignore[arg-type]
    target = rows.target({})
    target += values[:, :, None] * rows.of(rows.terms[0], 0.0)[..., 0]
    return constancies(rows.table(target), [0, 1], [0])[0].varies


@pytest.mark.parametrize("size", [0.1, 1.0, 30.0])
def test_one_value_everywhere_is_constant(size: float) -> None:
    found = [taken(np.full((1, 4), size), seed=seed) for seed in range(20)]
    assert max(found) == 0.0


def test_its_share_is_the_variance_of_the_values_over_their_mean_square() -> None:
    """Of independent columns of equal power: least squares takes the mean, and sums of squares add up."""
    values = np.array([[3.0, 5.0, 4.0, 4.0]])
    share = np.var(values) / np.mean(values) ** 2
    assert taken(values, count=4000) == pytest.approx(share, rel=0.1)


def test_channels_count_as_trials_do() -> None:
    values = np.array([[5.0, 5.0], [3.0, 3.0]])
    share = np.var(values) / np.mean(values) ** 2
    assert taken(values, channels=2, trials=2, count=4000) == pytest.approx(share, rel=0.1)


def test_what_noise_alone_would_ask_for_is_no_inconstancy() -> None:
    """A name of a tenth of the noise, half as large again in one trial: within a standard error."""
    assert taken(np.array([[0.1, 0.1, 0.1, 0.15]])) == 0.0
    assert taken(np.array([[0.1, 0.1, 0.1, 0.9]])) > 0.3


def test_a_name_is_trusted_by_how_much_could_hide() -> None:
    """Four trials hide a chi-square of four: 23.5 at one in ten thousand, over what the name takes away."""
    rows = Rows([term("friction.coulomb", "joint1"), curve("tau1", "theta1", size=2)])
    found = constancies(rows.table(rows.target({NAME: 0.5})), [0, 1], [0])[0]
    power = float(np.sum((0.5 * rows.of(rows.terms[0], 0.0)) ** 2))
    assert found.hidden == pytest.approx(23.51 / power, rel=0.2)
    assert found.trust == pytest.approx(1.0 - found.hidden / 0.2)
    assert Constancy(0.0, 0.3).trust == 0.0
