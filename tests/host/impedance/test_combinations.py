"""Combinations of parameters that rows determine, against a dependence put there by hand."""

import numpy as np
import pytest
from impid_host.impedance.combinations import combinations, needs_unseen
from impid_host.impedance.linear import Stretch, fit_linear


def test_a_dependent_column_joins_the_one_before_it() -> None:
    rng = np.random.default_rng(1)
    first, third = rng.normal(size=(2, 300, 2))
    design = np.stack([first, 0.09 * first, third, 0 * third], axis=2)
    target = design @ [0.5, 2.0, -1.0, 7.0]
    found = combinations([Stretch(design, target)], ("J", "m", "b", "unmoved"))
    assert found.labels == ("J + 0.09*m", "b")
    fit = fit_linear([found.cut(Stretch(design, target))], found.labels, ("", ""), ar_order=0)
    assert fit.value == pytest.approx([0.5 + 0.09 * 2.0, -1.0])
    assert design @ found.unseen == pytest.approx(np.zeros((300, 2, 2)), abs=1e-12)
    assert not needs_unseen(design, found.unseen)
    other = design.copy()
    other[:, :, 1] *= 2
    assert needs_unseen(other, found.unseen)
