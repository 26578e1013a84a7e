import pytest

from support.recordings import multiview_folders


@pytest.fixture
def folder(tmp_path):
    """Five cameras, three frames, without faults."""
    return multiview_folders.write_folder(tmp_path / "recording")
