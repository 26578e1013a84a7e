"""What the tests of joining share."""

import pytest

from ico3d.bundle import packaged
from support.avatars.planted_person import PlantedPerson, planted_head
from support.shared import MODELS


@pytest.fixture
def head():
    """The head by itself, as a capture in its own studio would have taught it."""
    return planted_head()


@pytest.fixture
def person(tmp_path):
    """A recording of the whole person, in the same studio as the head's."""
    return PlantedPerson(tmp_path / "same")


@pytest.fixture
def abroad(tmp_path):
    """A recording of the whole person elsewhere: another world, scale and light."""
    return PlantedPerson.elsewhere(tmp_path / "abroad")


@pytest.fixture
def face_model(monkeypatch):
    """MediaPipe and its model."""
    pytest.importorskip("mediapipe")
    if not (MODELS / "face_landmarker.task").is_file():
        pytest.skip("face_landmarker.task is not here: set ICO3D_MODELS")
    monkeypatch.setenv("ICO3D_MODELS", str(MODELS))


@pytest.fixture
def packaged_demo():
    """The avatar that comes in the package."""
    if not packaged.FILE.is_file():
        pytest.skip("no packaged avatar")
