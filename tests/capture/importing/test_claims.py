"""Foreign recordings that claim more than they hold."""

import tracemalloc

import pytest

from ico3d.capture.importing.recording import import_recording
from ico3d.capture.importing.settings import ImportSettings
from ico3d.errors import CaptureError
from support.recordings import foreign_models


def test_a_table_of_colmap_that_claims_much_is_not_kept(tmp_path):
    root = foreign_models.write_colmap(tmp_path, foreign_models.poses(2), "OPENCV", False)
    with (root / "sparse/0/points3D.txt").open("r+b") as file:
        file.truncate(1 << 30)  # of which the disk holds nothing
    tracemalloc.start()
    try:
        with pytest.raises(CaptureError, match="damaged or cut off"):
            import_recording(root, tmp_path / "out", ImportSettings())
        assert tracemalloc.get_traced_memory()[1] < 200 << 20
    finally:
        tracemalloc.stop()
