import pytest

from ico3d.measure.pictures import lpips
from support.weights.lpips import write_weights


@pytest.fixture(scope="session")
def lpips_weights(tmp_path_factory):
    """The folder of made-up weights of LPIPS, and both tables in it."""
    path = tmp_path_factory.mktemp("models")
    return path, *write_weights(path)


@pytest.fixture
def look_again():
    """Which weights are here is asked anew by each test."""
    lpips._installed.cache_clear()
    yield
    lpips._installed.cache_clear()
