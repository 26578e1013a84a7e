"""The body that tests of embodying change."""

import pytest

from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import FILE


@pytest.fixture(scope="module")
def body():
    """The packaged avatar's body."""
    found = Bundle.open(FILE).skinned
    assert found is not None
    return found
