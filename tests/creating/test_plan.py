"""How long an avatar takes, and which share of tracking is done when."""

import shutil
from types import SimpleNamespace

import pytest

from ico3d.capture.portrait.settings import CUTOUTS, FACES, POSES
from ico3d.creating.plan import check_room, expected, tracking_spans
from ico3d.creating.settings import QUALITIES
from ico3d.errors import StorageError


def test_a_better_quality_takes_longer_and_so_does_a_slower_machine():
    quick, good, best = (sum(expected(one, 60.0, 0.02).values()) for one in QUALITIES.values())
    assert 60 < quick < good < best < 3600
    assert sum(expected(QUALITIES["quick"], 60.0, 0.04).values()) == pytest.approx(2 * quick)


@pytest.mark.parametrize("quality", QUALITIES.values(), ids=QUALITIES)
@pytest.mark.parametrize("seconds", [4.0, 60.0, 600.0])
def test_tracking_advances_as_its_work_does_to_its_end(quality, seconds):
    spans = tracking_spans(quality, seconds)
    assert list(spans) == [FACES, CUTOUTS, POSES]
    (start, faces), (cut, cutouts), (posed, end) = spans.values()
    assert (start, faces, cutouts, end) == pytest.approx((0, cut, posed, 1))
    assert (cutouts == 1) == (not quality.refine)  # else it would leap to its end there


def test_wide_pictures_want_more_room_and_an_honest_video_no_absurd_one(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=1.2e9))
    check_room(tmp_path, QUALITIES["good"], 60.0, 910 * 512)
    with pytest.raises(StorageError, match=r"1\.2 GB left and 7\.1 GB are needed"):
        check_room(tmp_path, QUALITIES["good"], 60.0, 16_384 * 512)
