"""The head in a recording of the whole body: crops, masks and points."""

import numpy as np
import pytest

from ico3d.capture.face.region import HeadRegion
from ico3d.capture.parts.head_of_body import HeadOfBody, head_in
from ico3d.capture.parts.head_solid import HeadSolid
from ico3d.common.camera import Camera, look_at
from ico3d.errors import CaptureError
from support.avatars.planted_person import AXES, FRAMES, PlantedPerson, face
from support.heads.tiny_capture import TinyCapture


@pytest.fixture
def person(tmp_path):
    """A head on a trunk, with the camera's picture twice as tall as the head."""
    return PlantedPerson(tmp_path / "person")


def test_a_crop_sees_what_the_picture_saw(person):
    """Pixels, masks and projections agree where both have them; a camera has one crop."""
    head, sizes = head_in(person), set()
    assert isinstance(head, HeadOfBody)
    marks = face()
    for camera, frame in ((0, 0), (3, 4)):
        small, large = head.cameras[camera], person.cameras[camera]
        left, top = np.rint(large.intrinsics[:2, 2] - small.intrinsics[:2, 2]).astype(int)
        cut = slice(top, top + small.height), slice(left, left + small.width)
        np.testing.assert_array_equal(head.image(camera, frame), person.image(camera, frame)[cut])
        np.testing.assert_array_equal(head.mask(camera, frame), person.mask(camera, frame)[cut])
        np.testing.assert_array_equal(head.background(camera), person.background(camera)[cut])
        seen, before = (c.moved(person.world_from_head(frame)) for c in (small, large))
        np.testing.assert_allclose(seen.project(marks)[0], before.project(marks)[0] - (left, top))
        np.testing.assert_allclose(
            head.landmarks(camera, frame), person.landmarks(camera, frame) - (left, top)
        )
        sizes.add((small.width, small.height))
    assert all(width <= 30 and height <= 32 for width, height in sizes)  # of 40 x 52


def test_neck_and_trunk_are_not_of_the_head(person):
    """The head's mask holds the head that is there, and ends under the jaw."""
    head, region = head_in(person), HeadRegion.around(face())
    means = person.head.model.means.numpy()
    means = means[means @ region.under > region.under_at]
    for camera in range(len(head.cameras)):
        for frame in (0, FRAMES - 1):
            view = head.cameras[camera].moved(person.world_from_head(frame))
            mask, whole = head.head_mask(camera, frame), head.mask(camera, frame)
            pixels = np.floor(view.project(means)[0]).astype(int)
            assert mask[pixels[:, 1], pixels[:, 0]].mean() > 0.95
            chest = np.floor(view.project(np.array([0.0, -0.24, 0.09]))[0]).astype(int)
            if 0 <= chest[0] < view.width and 0 <= chest[1] < view.height:
                assert mask[chest[1], chest[0]] == 0
            assert (mask <= whole).all() and mask.sum() < whole.sum()


def test_points_are_in_head_space(person):
    """Those of the body that lie in the head, of all frames, and nothing else."""
    head = head_in(person)
    points = head.head_points()
    assert head.world_points() is None and person.head_points() is None
    on_ellipsoid = np.linalg.norm(points / AXES, axis=1)
    assert np.median(np.abs(on_ellipsoid - 1)) < 0.02
    region = HeadRegion.around(face())
    assert (points @ region.under > region.under_at - 1e-6).all()


def test_without_points_there_is_the_hull_of_the_head(person, monkeypatch):
    """Of its masks: no neck below."""
    monkeypatch.setattr(person, "world_points", lambda frame=0: None)
    points = head_in(person).head_points()
    assert len(points) > 200
    assert np.abs(points).max(0) == pytest.approx(AXES, abs=0.04)


def test_a_head_is_not_cropped(tmp_path):
    """A capture that shows a head is one already."""
    capture = TinyCapture(tmp_path)
    assert head_in(capture) is capture


def test_what_is_missing_is_said(person, monkeypatch):
    """A body without head poses; cameras that look elsewhere."""
    with monkeypatch.context() as patch:
        patch.setattr(person, "world_from_head", lambda frame: None)
        with pytest.raises(CaptureError, match="tells of no head: find it with ico3d capture trac"):
            head_in(person)
    away = look_at((0, 0, 3), (0, 9, 3), (0, 0, 1))
    person.cameras = tuple(
        Camera(c.width, c.height, c.intrinsics, away, c.name) for c in person.cameras
    )
    with pytest.raises(CaptureError, match="no camera sees the head"):
        head_in(person)


def test_a_camera_that_misses_the_head_recorded_nothing(person):
    """Of the head; the others keep their numbers."""
    first = person.cameras[0]
    turned = look_at(first.camera_to_world[:3, 3], (0, 0, 9))
    person.cameras = (
        Camera(first.width, first.height, first.intrinsics, turned, first.name),
        *person.cameras[1:],
    )
    head = head_in(person)
    assert head.image(0, 0) is None and not head.has_image(0, 0) and not head.has_mask(0, 0)
    assert head.image(1, 0) is not None and len(head.cameras) == len(person.cameras)


def test_a_solid_covers_what_it_holds():
    """Points inside project into the outline, by any camera; the ears and the hair are inside."""
    solid = HeadSolid.around(face())
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.25, 0.25, (500, 3))
    inside = points[solid.holds(points)]
    assert 20 < len(inside) < 250
    assert solid.holds(1.05 * AXES * np.array([[0, 1, 0], [0, 0.1, -0.99], [0.99, 0.1, 0.0]])).all()
    intrinsics = np.array([[300.0, 0, 100], [0, 300.0, 100], [0, 0, 1]])
    for eye in rng.normal(size=(5, 3)):
        camera = Camera(200, 200, intrinsics, look_at(eye / np.linalg.norm(eye), (0, 0, 0)))
        covered, box = solid.covered(camera), solid.box(camera)
        pixels = np.floor(camera.project(inside)[0]).astype(int)
        assert covered[pixels[:, 1], pixels[:, 0]].all()
        rows, columns = np.nonzero(covered)
        found = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
        np.testing.assert_allclose(box, found, atol=1)
