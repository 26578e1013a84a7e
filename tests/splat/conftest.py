import pytest

from support.splats.reference import camera_at


@pytest.fixture
def cameras():
    """Two cameras; the picture is no multiple of a tile."""
    return [camera_at((0.1, 0.2, 1.2)), camera_at((-0.9, 0.1, 0.6))]
