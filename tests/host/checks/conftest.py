"""The campaign's laboratories and mistakes serve here too; one laboratory for the whole folder."""

import pytest
from mistakes_campaign.laboratories import KINDS, laboratory


@pytest.fixture(scope="session")
def study():
    """With force sensor and weighed payload, so that every mistake contradicts something."""
    return laboratory(7005, KINDS[0])[0]
