"""The body track in `golden/`, written by the first program that knew tracks (2026-11-23)."""

import shutil
from pathlib import Path

import pytest

from ico3d.rig.body_track import NAME, read_body_track

GOLDEN = Path(__file__).parent / "golden"


def test_an_old_track_moves_as_it_moved(tmp_path):
    shutil.copy(GOLDEN / NAME, tmp_path)
    track = read_body_track(tmp_path, 3, 15.0)
    assert track is not None and track.licence == ""
    assert track.fitted.tolist() == [True, False, True]
    assert float(track.joints().sum()) == pytest.approx(11.766150, abs=1e-4)
    assert float(track.surface(1).sum()) == pytest.approx(2.421343, abs=1e-4)
