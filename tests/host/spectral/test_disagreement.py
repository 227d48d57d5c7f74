import numpy as np
from impid_host.impedance.spectral.disagreement import disagreement


def test_difference_is_counted_in_standard_errors():
    result = disagreement(
        ("time domain", "spectral"),
        ("m (kg)", "k (N/m)"),
        (np.array([1.0, 100.0]), np.array([0.3, 3.0])),
        (np.array([1.2, 115.0]), np.array([0.4, 4.0])),
    )
    np.testing.assert_allclose(result.z, [-0.4, -3.0])
    assert "disagree in k (N/m) by 3.0 standard errors (1 of 2" in str(result)


def test_agreement_names_the_largest_difference():
    value, sd = np.array([1.0, 2.0]), np.array([0.1, 0.1])
    text = disagreement(("a", "b"), ("p", "q"), (value, sd), (value + np.array([0.0, 0.1]), sd)).verdict
    assert text == "a and b agree; the largest difference is 0.7 standard errors, in q"
