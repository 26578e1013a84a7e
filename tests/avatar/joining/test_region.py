"""Which part of a head belongs to it, which Gaussians are drawn, and pictures of the face."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.cropping import cropped, near_border
from ico3d.avatar.joining.driving import head_poses, recorded_expressions
from ico3d.avatar.joining.face_views import WIDEST, face_views, faces
from ico3d.capture.face.region import CHIN, HeadRegion
from ico3d.errors import CaptureError, ModelError
from support.avatars.planted_person import AXES, FRAMES, face


@pytest.fixture
def region():
    return HeadRegion.around(face())


def test_directions(region):
    """Forward is where the nose is; the lower jaw's plane looks up and has the chin above it."""
    assert region.forward @ (0, 0, 1) > 0.99 and region.under @ (0, 1, 0) > 0.7
    for direction in (region.forward, region.under):
        assert np.linalg.norm(direction) == pytest.approx(1)
    assert 0.005 < region.depth(face()[[CHIN]])[0] < 0.03


def test_the_face_is_inside_and_neck_and_nape_are_not(region):
    """So are the ends of the jaw line; how deep is the distance to the nearer plane."""
    assert (region.depth(face()) > 0).all()
    outside = np.array([[0, -0.2, 0], [0, 0, -0.09], [0, -0.12, -0.03]])
    assert (region.depth(outside) < 0).all()
    point = np.array([[0.01, 0.02, 0.03]])
    inward = region.depth(point + 0.002 * region.forward) - region.depth(point)
    other = region.depth(point + 0.002 * region.under) - region.depth(point)
    assert max(inward[0], other[0]) == pytest.approx(0.002)


def test_the_body_keeps_clear_of_face_and_jaw(region):
    """Jaw, nose, eyes, mouth; not from throat, shoulders and nape."""
    assert region.trespassing(face()[[*range(2, 15), *range(27, 68)]]).all()
    assert not region.trespassing(np.array([[0, -0.2, -0.02], [0.15, -0.3, 0], [0, 0, -0.1]])).any()
    assert region.trespassing(np.zeros((0, 3))).shape == (0,)


def test_what_hovers_before_the_face_is_no_part_of_it(region):
    """Nothing of the face itself does, nor anything behind its foremost landmark."""
    nose = face()[(face() @ region.forward).argmax()]
    height = np.linalg.norm(face()[17:27].mean(0) - face()[CHIN])
    before = nose + np.outer([0.19, 0.21], height * region.forward)
    assert not region.floating(face()).any()
    assert region.floating(before).tolist() == [False, True]


def test_a_region_moves_and_grows_with_its_face(region):
    """Nothing in it depends on the space in which a head was recorded."""
    turn, move, size = Rotation.random(rng=np.random.default_rng(0)).as_matrix(), (1, 2, 3), 1.7
    there = HeadRegion.around(size * face() @ turn.T + move)
    points = np.random.default_rng(1).normal(0, 0.1, (200, 3))
    placed = size * points @ turn.T + move
    np.testing.assert_allclose(there.depth(placed), size * region.depth(points), atol=1e-12)
    np.testing.assert_array_equal(there.trespassing(placed), region.trespassing(points))
    np.testing.assert_array_equal(there.floating(placed), region.floating(points))


@pytest.mark.parametrize("landmarks", [np.zeros((68, 3)), np.linspace([0] * 3, [1] * 3, 68)])
def test_what_is_no_face_is_refused(landmarks):
    """All points in one place, or on a line."""
    with pytest.raises(ModelError, match="are no face: track its capture again"):
        HeadRegion.around(landmarks)


def test_cropping_keeps_what_is_inside_as_it_is(head, region):
    """The same colours and opacities from the same places, fewer Gaussians; no more changes."""
    means = head.model.means.numpy().astype(float)
    inside = torch.from_numpy((region.depth(means) > 0) & ~region.floating(means))
    assert 100 < inside.sum() < len(head.model)
    part = cropped(head, region)
    assert len(part.model) == int(inside.sum()) and len(head.model) == 500
    expression = torch.linspace(0, 1, 10)
    with torch.no_grad():
        whole, drawn = head.model(expression), part.model(expression)
    for name in ("means", "quats", "scales", "opacities", "colors"):
        torch.testing.assert_close(getattr(drawn, name), getattr(whole, name)[inside])
    assert part.landmarks is head.landmarks


def test_a_head_elsewhere_than_its_face_is_refused(head, region):
    """Nothing is left to draw."""
    head.model.means.data -= 5
    with pytest.raises(ModelError, match="no Gaussian of the head lies where"):
        cropped(head, region)


def test_the_border_is_near_both_sides(head, region):
    """Closer to it than asked for, inside and outside."""
    places = near_border(head, region, 0.01)
    depth = region.depth(places)
    assert (np.abs(depth) < 0.01).all() and (depth > 0).any() and (depth < 0).any()
    assert len(near_border(head, region, 1e-9)) == 0
    surface = np.square(places / AXES).sum(1)
    np.testing.assert_allclose(surface, 1, rtol=1e-5)


def views_of(capture, **changes):
    """Views of the face in a capture."""
    placement = Placement(capture.canonical_from_head, head_poses(capture))
    return face_views(capture, placement, HeadRegion.around(face()), face(), **changes)


def test_views_show_the_face_from_in_front(person, region):
    """Cropped pictures of training cameras; every landmark lies inside; projection goes along."""
    views = views_of(person)
    assert {view.frame for view in views} == set(range(FRAMES))
    for view in views:
        assert view.camera_index not in person.split.test_cameras
        where = person.true_world_from_head(view.frame)
        camera = person.cameras[view.camera_index]
        assert faces(camera, where, region, face())
        forward = where[:3, :3] @ region.forward
        towards = camera.camera_to_world[:3, 3] - where[:3, :3] @ face().mean(0) - where[:3, 3]
        assert forward @ towards > WIDEST * np.linalg.norm(towards)
        pixels, _ = view.camera.project(face() @ where[:3, :3].T + where[:3, 3])
        height, width = view.mask.shape
        assert (pixels > -1).all() and (pixels < (width + 1, height + 1)).all()
        left, top = (camera.intrinsics - view.camera.intrinsics)[:2, 2].astype(int)
        mouth = np.floor(pixels[48:68].mean(0)).astype(int)
        assert view.steady[mouth[1], mouth[0]] == 0 and 0.3 < view.steady.mean() < 1
        whole = person.image(view.camera_index, view.frame)
        assert np.array_equal(view.image.numpy(), whole[top : top + height, left : left + width])


def test_views_are_spread(person):
    """Few of many, from the first to the last frame."""
    few = views_of(person, most=3)
    assert len(few) == 3 and few[0].frame == 0 and few[-1].frame == FRAMES - 1


def test_faces_nobody_sees(person):
    """No camera in front, and no pictures by those that are: two sentences."""
    behind = [i for i, c in enumerate(person.cameras) if c.camera_to_world[2, 3] < -0.5]
    with pytest.raises(CaptureError, match="no camera sees the face: check the head's poses"):
        views_of(person, cameras=behind)
    person.mask = lambda camera, frame: None
    with pytest.raises(CaptureError, match="has a picture of it with a mask"):
        views_of(person)


def test_cameras_inside_the_head_see_no_face(person):
    """Some landmarks are behind them."""
    close = person.cameras[0].world_to_camera.copy()
    close[:3, 3] = 0, 0, 0.05
    object.__setattr__(person.cameras[0], "world_to_camera", close)
    with pytest.raises(CaptureError, match="no camera"):
        views_of(person, cameras=[0])


def test_poses_of_all_frames_are_needed(person):
    """A missing one, one that is not finite, and one that grows are named."""
    pose = person.world_from_head
    np.testing.assert_array_equal(head_poses(person)[3], pose(3))
    for wrong, sentence in (
        (None, r"frame 2 has no head pose \(1 have none\): find them with ico3d capture track"),
        (np.full((4, 4), np.nan), "frame 2 has no head pose"),
        (1.1 * np.eye(4), "frame 2 stretches or mirrors"),
        (np.diag([-1.0, 1, 1, 1]), "frame 2 stretches or mirrors"),
    ):
        person.world_from_head = lambda frame, wrong=wrong: wrong if frame == 2 else pose(frame)
        with pytest.raises(CaptureError, match=sentence):
            head_poses(person)


def test_faces_that_were_not_tracked_stay_neutral(person, head, caplog):
    """Said once; else the recorded expressions."""
    found = recorded_expressions(head, person, head.neutral())
    np.testing.assert_array_equal(found, [person.blendshapes(i) for i in range(FRAMES)])
    shapes = person.blendshapes
    person.blendshapes = lambda frame: None if frame == 4 else shapes(frame)
    assert not recorded_expressions(head, person, head.neutral()).any()
    person.blendshape_names = None
    assert recorded_expressions(head, person, head.neutral()).shape == (FRAMES, 10)
    assert caplog.text.count("The head keeps a neutral face") == 2
