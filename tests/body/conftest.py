"""What the tests of bodies share."""

import pytest

from support.bodies.moving_ball import MovingBall
from support.bodies.recorded_capture import record
from support.bodies.window_tasks import files_of_a_sequence


@pytest.fixture
def moving_ball(tmp_path):
    """Makes captures: moving_ball(heights, cameras)."""
    return lambda heights, cameras=8: MovingBall(tmp_path / "ball", heights, cameras)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """The moving capture on disk."""
    folder = tmp_path_factory.mktemp("recorded")
    record(folder)
    return folder


@pytest.fixture(scope="session")
def sequence(recorded, tmp_path_factory):
    """Contents of the windows' files if they train one after another."""
    return files_of_a_sequence(recorded, tmp_path_factory.mktemp("sequence"))
