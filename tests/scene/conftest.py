import pytest

from support.scenes.still_capture import Still


@pytest.fixture
def still(tmp_path):
    """Makes captures: still(cameras, frames, test frames)."""
    return lambda cameras=2, frames=1, test=0: Still(tmp_path / "still", cameras, frames, test)
