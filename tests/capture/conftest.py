import pytest

from support.recordings import portrait_folder


@pytest.fixture
def folder(tmp_path):
    """A talking-portrait folder without faults."""
    return portrait_folder.write_folder(tmp_path / "person")
