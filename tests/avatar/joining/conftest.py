"""What the tests of joining share."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from planted_person import PlantedPerson, planted_head


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
