"""What the tests of bodies share."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from moving_ball import MovingBall


@pytest.fixture
def moving_ball(tmp_path):
    """Makes captures: moving_ball(heights, cameras)."""
    return lambda heights, cameras=8: MovingBall(tmp_path / "ball", heights, cameras)
