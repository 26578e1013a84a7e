"""What the tests of bodies share."""

import pytest

from support.bodies.moving_ball import MovingBall
from support.bodies.recorded_capture import record
from support.bodies.window_tasks import files_of_a_sequence
from support.made_once import made_once


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


@pytest.fixture(scope="module")
def sequence(two_threads, recorded, tmp_path_factory):
    """Contents of the windows' files if they train one after another.

    Whichever process of the tests asks first has them trained, for all.
    """
    with made_once(tmp_path_factory, "sequence") as folder:
        return files_of_a_sequence(recorded, folder)
