"""The gap between head and body, and the seam in pictures."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from ico3d.avatar.avatar import Placement, TrainedAvatar
from ico3d.avatar.joining.driving import head_poses
from ico3d.avatar.joining.face_views import face_views
from ico3d.avatar.joining.seam_quality import gap, largest_gap, seam_scores
from ico3d.capture.face.region import HeadRegion
from ico3d.errors import CaptureError
from ico3d.splat.gaussians import Gaussians
from support.avatars.planted_person import FRAMES, face

FLAT = HeadRegion(
    np.array([0, 0, 1.0]), np.array([0, 1.0, 0]), 0.0, -1.0, 1.0, np.array([[0, 0.1, 0, 0.05]])
)
"""A head above the plane y = 0."""
SIZE = 0.003


def disc(height, opacity=0.9, radius=0.1):
    """Round Gaussians, all 4 mm, in a plane of this height."""
    steps = np.arange(-radius, radius + 1e-9, 0.004)
    x, z = (axis.ravel() for axis in np.meshgrid(steps, steps))
    points = np.stack([x, np.full_like(x, height), z], 1)
    count = len(points)
    return Gaussians(
        torch.from_numpy(points).float(),
        torch.tensor([1.0, 0, 0, 0]).repeat(count, 1),
        torch.full((count, 3), SIZE),
        torch.full((count,), opacity),
        torch.full((count, 3), 0.5),
    )


@pytest.mark.parametrize("width", [0.0, 0.004, 0.012, 0.03])
def test_the_gap_between_two_discs(width):
    """Their distance, less the size of both; nothing where they touch."""
    found = gap(disc(0.001), disc(0.001 - width), np.eye(4), FLAT)
    assert found == pytest.approx(max(width - 2 * SIZE, 0), abs=1e-6)


def test_a_gap_goes_where_the_head_goes():
    """Turned and moved with both, and grown with the head's scale."""
    where = np.eye(4)
    where[:3, :3] = Rotation.from_euler("y", 30, degrees=True).as_matrix()
    where[:3, 3] = 1, 2, 3
    head, body = disc(0.001).transform(where), disc(-0.011).transform(where)
    assert gap(head, body, where, FLAT) == pytest.approx(0.012 - 2 * SIZE, abs=1e-5)


def test_only_the_rim_counts():
    """What of a head lies far inside may be far from the body."""
    far = disc(0.05, radius=0.008)
    head = disc(0.001)
    both = Gaussians(*(torch.cat([getattr(g, n) for g in (head, far)]) for n in NAMES))
    assert gap(both, disc(-0.011), np.eye(4), FLAT) == gap(head, disc(-0.011), np.eye(4), FLAT)


NAMES = ("means", "quats", "scales", "opacities", "colors")


def test_nothing_opaque_is_no_gap():
    """Neither can be measured without the other."""
    head, glass = disc(0.001), disc(-0.011, 0.01)
    assert gap(head, glass, np.eye(4), FLAT) is None
    assert gap(disc(0.5), disc(-0.011), np.eye(4), FLAT) is None


class StillBody:
    """Enough of a body for what is measured on it."""

    def __init__(self, gaussians, drop=None):
        self.fps, self._drawn, self._drop = 15.0, gaussians, drop or {}

    def gaussians(self, seconds):
        down = torch.tensor([0.0, self._drop.get(round(seconds * self.fps), 0.0), 0.0])
        return replace(self._drawn, means=self._drawn.means - down)


@pytest.fixture
def avatar(person):
    """The planted person as an avatar: what is recorded is what is drawn."""
    expressions = np.stack([person.blendshapes(i) for i in range(FRAMES)])
    body = StillBody(person._body)
    placement = Placement(np.eye(4), head_poses(person))
    return TrainedAvatar(person.head, body, placement, expressions, {})  # type: ignore[arg-type]


def test_the_largest_gap_of_all_frames(avatar):
    """A body that drops by centimetres in one frame opens by about as much there."""
    region = HeadRegion.around(face())
    closed = largest_gap(avatar, region) or 0.0
    avatar.body._drop = {2: 0.5, 4: 0.02}
    open_ = largest_gap(avatar, region)
    assert (
        closed is not None and open_ is not None and open_ == pytest.approx(closed + 0.5, abs=0.1)
    )


def test_pictures_of_the_truth_have_no_seam(avatar, person):
    """The same Gaussians and cameras: the same pictures, but for what is cut off at 1."""
    region = HeadRegion.around(face())
    views = face_views(person, avatar.placement, region, face())
    scores = seam_scores(avatar, views)
    assert scores.psnr_face > 35 and scores.psnr_border > 35 and scores.color_step < 0.01


def test_another_tint_of_the_head_is_a_step(avatar, person):
    """By as much as its colours differ; the border suffers less than the face, being half body."""
    region = HeadRegion.around(face())
    views = face_views(person, avatar.placement, region, face())
    sharp = seam_scores(avatar, views)
    avatar.head.model.color_branch.bias += 1.0
    dull = seam_scores(avatar, views)
    assert dull.color_step > 0.1 > 10 * sharp.color_step
    assert dull.psnr_face < 20 and dull.psnr_face < dull.psnr_border < sharp.psnr_border


def test_without_a_border_nothing_is_scored(avatar, person):
    """Heads that nobody sees have no seam."""
    region = HeadRegion.around(face())
    views = face_views(person, avatar.placement, region, face())
    avatar.head.model.opacity_branch.bias -= 30
    with pytest.raises(CaptureError, match="no picture shows the border"):
        seam_scores(avatar, views)
