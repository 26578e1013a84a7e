"""How long an avatar takes, and which share of tracking is done when."""

import pytest

from ico3d.capture.portrait.settings import CUTOUTS, FACES, POSES
from ico3d.creating.plan import expected, tracking_spans
from ico3d.creating.settings import QUALITIES


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
