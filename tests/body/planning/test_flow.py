"""How much moves, and where."""

import os
import sys

import cv2
import numpy as np
import pytest

from ico3d.body.planning.flow import (
    MOST_CACHED,
    MOST_CAMERAS,
    clip_flow,
    copy_cache,
    dynamic_weights,
)
from ico3d.body.planning.flow_methods import DisFlow, best_method
from ico3d.body.planning.windows import Window
from ico3d.errors import CaptureError, MissingExtraError, ModelError
from support.bodies.moving_ball import BALL, HEIGHT
from support.weights.raft import NAME, install_torchvision, write_raft

pytestmark = pytest.mark.slow

STEPS = [0.0, 0.0, 0.01, 0.05, 0.0, 0.1]
"""Metres that the ball rises in each step."""


class Shift:
    """Says that everything moves by (3, 4) pixels."""

    name = "shift"

    def __call__(self, before, after):
        return np.full((*before.shape[:2], 2), [3.0, 4.0], np.float32)


@pytest.fixture
def rising(moving_ball):
    return lambda cameras=8: moving_ball(np.cumsum([-0.1, *STEPS]), cameras)


def _motion(capture, *arguments, **more):
    return clip_flow(capture, *arguments, **more).motion


def test_dis_finds_a_shift():
    rng = np.random.default_rng(0)
    large = cv2.resize(rng.random((40, 50, 3)).astype(np.float32), (400, 320))
    large = (large * 255).astype(np.uint8)
    flow = DisFlow()(large[10:210, 20:220], large[7:207, 24:224])
    assert flow.shape == (200, 200, 2)
    np.testing.assert_allclose(np.median(flow, (0, 1)), [-4, 3], atol=0.1)


def test_motion_is_the_mean_square_in_centimetres_at_the_person(rising):
    capture = rising()
    motion = _motion(capture, method=Shift())
    # cameras at 3 m in the plane and 0.3 m up, with 300 px focal length
    pixel = 100 * np.hypot(3, 0.3) / 300
    np.testing.assert_allclose(motion, np.full(6, 25 * pixel**2), rtol=1e-6)


def test_motion_of_a_clip_is_that_of_its_ball(rising):
    motion = _motion(rising())
    assert motion.shape == (6,) and (motion[[0, 1, 4]] < 1e-3).all()
    # the ball takes about a tenth of the person's pixels
    capture = rising()
    share = np.mean([BALL**2 * np.pi * 9e4 / 9 / capture.mask(c, 0).sum() for c in (0, 1, 2)])
    np.testing.assert_allclose(motion[[2, 3, 5]], share * np.array([1, 25, 100]), rtol=0.4)


def test_the_test_cameras_are_not_looked_at(rising):
    capture = rising()
    flow = clip_flow(capture)
    assert [one.index for one in flow.cameras] == [0, 1, 2, 3, 5, 6]
    assert {camera for camera, _ in capture.asked} == {0, 1, 2, 3, 5, 6}


def test_of_many_cameras_some_spread_around_are_looked_at(rising):
    flow = clip_flow(rising(45), span=Window(0, 1))
    turns = [np.arctan2(*one.camera.camera_to_world[[0, 2], 3]) for one in flow.cameras]
    gaps = np.diff(np.sort(turns))
    assert len(turns) == 16 and gaps.max() < 2 * np.pi / 16 * 2


def test_resolution_and_framing_do_not_matter(rising, monkeypatch):
    usual = _motion(rising())
    capture, larger = rising(), rising()
    image, mask = larger.image, larger.mask
    larger.cameras = [camera.resized(576, 640) for camera in larger.cameras]
    monkeypatch.setattr(larger, "image", lambda *v: cv2.resize(image(*v), (576, 640)))
    monkeypatch.setattr(larger, "mask", lambda *v: cv2.resize(mask(*v), (576, 640)))
    flow = clip_flow(larger)
    assert flow.cameras[0].moving.shape == (6, 320, 36)  # made smaller
    np.testing.assert_allclose(flow.motion[[2, 3, 5]], usual[[2, 3, 5]], rtol=0.25)
    image, mask = capture.image, capture.mask
    capture.cameras = [camera.cropped(10, 20, 130, 130) for camera in capture.cameras]
    monkeypatch.setattr(capture, "image", lambda *v: image(*v)[20:150, 10:140])
    monkeypatch.setattr(capture, "mask", lambda *v: mask(*v)[20:150, 10:140])
    np.testing.assert_allclose(_motion(capture)[[2, 3, 5]], usual[[2, 3, 5]], rtol=0.25)


def test_results_are_kept_on_disk(rising, tmp_path):
    first = clip_flow(rising(), tmp_path)
    files = sorted(tmp_path.iterdir())
    assert len(files) == 6
    times = [file.stat().st_mtime_ns for file in files]
    capture = rising()
    again = clip_flow(capture, tmp_path)
    assert len(capture.asked) == 6 * 3  # a few pictures tell that they are the same
    np.testing.assert_array_equal(again.motion, first.motion)
    for one, other in zip(first.cameras, again.cameras, strict=True):
        np.testing.assert_array_equal(one.moving, other.moving)
    assert [file.stat().st_mtime_ns for file in files] == times
    # another method, span or other pictures are another thing
    clip_flow(rising(), tmp_path, method=Shift())
    clip_flow(rising(), tmp_path, span=Window(1, 4))
    changed = rising()
    changed.heights = changed.heights + 0.02
    clip_flow(changed, tmp_path)
    # (one camera sees nothing of the ball behind the trunk)
    assert len(list(tmp_path.iterdir())) == 23


def test_a_damaged_file_is_measured_again(rising, tmp_path, caplog):
    first = _motion(rising(), tmp_path)
    file = min(tmp_path.iterdir())
    file.write_bytes(file.read_bytes()[:100])
    np.testing.assert_array_equal(_motion(rising(), tmp_path), first)
    assert "is damaged" in caplog.text
    np.load(file)


def test_missing_pictures_are_left_out(rising, monkeypatch):
    usual, capture = _motion(rising()), rising()
    image = capture.image
    gone = {(0, frame) for frame in range(7)} | {(camera, 1) for camera in range(8)}
    monkeypatch.setattr(capture, "image", lambda *v: None if v in gone else image(*v))
    flow = clip_flow(capture)
    assert np.isnan(flow.cameras[0].energy).all()
    assert np.isnan(flow.cameras[1].energy).tolist() == [True, True, *[False] * 4]
    # what no camera saw is as what follows
    np.testing.assert_allclose(flow.motion[:2], flow.motion[2])
    np.testing.assert_allclose(flow.motion[2:], usual[2:], rtol=0.35, atol=1e-3)
    monkeypatch.setattr(capture, "image", lambda *_: None)
    with pytest.raises(CaptureError, match="two frames on end"):
        clip_flow(capture)


def test_a_single_frame_has_no_motion(moving_ball):
    assert _motion(moving_ball([0.0])).shape == (0,)


def test_moving_pixels_are_those_of_the_ball_in_a_window(rising):
    capture = rising()
    flow = clip_flow(capture)
    front = flow.cameras[0]
    still, moving = flow.moving(front, Window(0, 2)), flow.moving(front, Window(2, 6))
    assert not still.any() and moving.shape == (HEIGHT, front.camera.width)
    rows, columns = np.nonzero(moving)
    center = front.camera.project(capture.center(4))[0]
    assert abs(columns.mean() - center[0]) < 4 and columns.min() > center[0] - 100 * BALL - 3
    assert len(rows) > 0.7 * np.pi * (100 * BALL) ** 2


def test_points_that_move_are_dynamic(rising):
    capture = rising(16)
    window = Window(2, 6)
    points, _ = capture.surface(window.center, 1000)
    known = clip_flow(capture)
    weights = dynamic_weights(points, capture, window, known)
    assert weights.shape == (2000,) and weights.min() >= 0 and weights.max() <= 1
    away = points[:1000, 0] < -0.05  # the trunk's side that the ball never hides from in front
    assert weights[1000:].mean() > 0.85 and weights[:1000][away].mean() < 0.1
    np.testing.assert_array_equal(dynamic_weights(points, capture, window), weights)
    calm = Window(0, 2)
    assert dynamic_weights(capture.surface(1, 1000)[0], capture, calm, known).max() == 0


def test_without_raft_it_is_dis(monkeypatch):
    monkeypatch.setitem(sys.modules, "torchvision", None)
    assert best_method().name == "dis"
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(MissingExtraError, match="opencv-contrib-python"):
        best_method()


@pytest.mark.parametrize("place", ["cpu", "cuda"])
def test_raft_is_taken_where_its_weights_are(monkeypatch, tmp_path, place, request):
    device = request.getfixturevalue("cuda") if place == "cuda" else place
    install_torchvision(monkeypatch, tmp_path)
    assert best_method(device).name == "dis"
    write_raft(tmp_path, 2.0)
    method = best_method(device)
    assert method.name == NAME
    before = np.zeros((150, 90, 3), np.uint8)
    after = before.copy()
    after[:, 40:] = 255
    flow = method(before, after)
    assert flow.shape == (150, 90, 2) and flow.dtype == np.float32
    # from -1 to 1 where the picture turns white, times two
    np.testing.assert_array_equal(flow[:, :40], np.full((150, 40, 2), [0.0, -2.0]))
    np.testing.assert_array_equal(flow[:, 40:], np.full((150, 50, 2), [4.0, 2.0]))


def test_the_cache_of_a_folder_that_somebody_else_began_is_copied_by_its_names_alone(tmp_path):
    source, target, secret = tmp_path / "flow", tmp_path / "other", tmp_path / "id_ed25519"
    source.mkdir()
    names = [f"{digit:024x}.npz" for digit in range(4)]
    (source / names[0]).write_bytes(b"measured")
    secret.write_bytes(b"secret")
    (source / names[1]).symlink_to(secret)
    (source / names[2]).symlink_to("/dev/zero")
    with (source / names[3]).open("wb") as hole:
        hole.truncate(MOST_CACHED + 1)
    (source / ".profile").write_text("echo stranger")
    (source / "more").mkdir()
    copy_cache(source, target)
    assert {file.name: file.read_bytes() for file in target.iterdir()} == {names[0]: b"measured"}
    copy_cache(tmp_path / "none", target)  # nothing was measured yet


def test_no_more_flow_is_copied_than_one_clip_has(tmp_path):
    (tmp_path / "flow").mkdir()
    for number in range(MOST_CAMERAS + 5):
        file = tmp_path / "flow" / f"{number:024x}.npz"
        file.write_bytes(b"measured")
        os.utime(file, (1e9 + number, 1e9 + number))
    copy_cache(tmp_path / "flow", tmp_path / "other")
    copied = sorted(int(file.stem, 16) for file in (tmp_path / "other").iterdir())
    assert copied == list(range(5, MOST_CAMERAS + 5))


def test_no_flow_is_written_through_a_link(tmp_path):
    (tmp_path / "flow").mkdir()
    (tmp_path / "flow" / f"{7:024x}.npz").write_bytes(b"measured")
    (tmp_path / "home").mkdir()
    (tmp_path / "linked").symlink_to(tmp_path / "home")
    with pytest.raises(ModelError, match="is a link"):
        copy_cache(tmp_path / "flow", tmp_path / "linked")
    assert not list((tmp_path / "home").iterdir())
    copy_cache(tmp_path / "linked", tmp_path / "fresh")
    assert not (tmp_path / "fresh").exists()
