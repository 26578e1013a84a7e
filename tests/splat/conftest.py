import sys
from pathlib import Path

import numpy as np
import pytest

from ico3d.common.camera import Camera, look_at

sys.path.insert(0, str(Path(__file__).parent))


def camera_at(eye, width=44, height=30, focal=55.0, name="0"):
    intrinsics = np.array(
        [[focal, 0, width / 2 + 1.5], [0, focal * 1.1, height / 2 - 2], [0, 0, 1]]
    )
    return Camera(width, height, intrinsics, look_at(np.array(eye), np.zeros(3)), name)


@pytest.fixture
def cameras():
    """Two cameras; the picture is no multiple of a tile."""
    return [camera_at((0.1, 0.2, 1.2)), camera_at((-0.9, 0.1, 0.6))]
