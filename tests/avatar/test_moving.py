"""Times within windows, and clips of a single frame."""

from pathlib import Path

import pytest

from ico3d.avatar.animation.keyframes import Motion
from ico3d.avatar.baked_body import place_in
from ico3d.avatar.clip_views import recorded_view
from ico3d.avatar.moving import tau_in
from ico3d.body.planning.windows import Window, cut
from ico3d.errors import BundleError
from support.avatars.moving_body import MovingPerson
from support.bodies.moving_capture import MovingCapture


def test_a_window_is_passed_from_0_to_1():
    windows = (Window(0, 4), Window(4, 10))
    assert [tau_in(windows[1], frame) for frame in (4, 5.5, 10)] == [0.0, 0.25, 1.0]
    assert [place_in(windows, frame) for frame in (-1.0, 4.0, 7.0, 99.0)] == [
        (0, 0.0), (0, 1.0), (1, 0.5), (1, 1.0),
    ]  # fmt: skip


def test_a_clip_of_one_frame_has_one_time(tmp_path: Path):
    (still,) = cut([], 100.0, 2, 6)
    assert tau_in(still, 0) == still.tau(0) == 0.0
    assert place_in((still,), 0.5) == (0, 0.0)
    view = recorded_view(MovingCapture(tmp_path), 0, 0, still)
    assert view is not None and view.tau == 0.0


def test_a_body_of_one_frame_has_no_motion():
    with pytest.raises(BundleError, match="one frame, so it does not move"):
        Motion.of(MovingPerson(borders=(0, 0)))
