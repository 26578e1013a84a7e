"""Folders that appear once they are complete."""

import os
import stat

import pytest

from ico3d.capture.multiview.writing import new_folder


@pytest.mark.parametrize(("umask", "mode"), [(0o077, 0o700), (0o022, 0o755)])
def test_who_may_read_a_folder_is_for_the_umask_to_say(tmp_path, umask, mode):
    before = os.umask(umask)
    try:
        with new_folder(tmp_path / "out") as work:
            assert work.name.startswith(".out.")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "out").stat().st_mode) == mode


def test_nothing_is_left_of_one_that_failed(tmp_path):
    with pytest.raises(ValueError, match="halfway"), new_folder(tmp_path / "out") as work:
        (work / "file").touch()
        raise ValueError("halfway")
    assert not list(tmp_path.iterdir())
