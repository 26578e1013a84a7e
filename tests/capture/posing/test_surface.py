"""The template's surface before outlines."""

import numpy as np
import pytest

from ico3d.capture.posing.fitting.body import Body, Kinematics
from ico3d.capture.posing.fitting.rows import Rows
from ico3d.capture.posing.fitting.surface import Surface
from ico3d.capture.posing.model.anatomy import anatomy_of
from ico3d.capture.posing.model.template import load_template
from ico3d.capture.posing.seeing.outlines import Outlines
from ico3d.common.camera import Camera, look_at
from ico3d.rig.quaternions import from_rotvec, to_matrix
from support.needs import needs

pytestmark = needs("anny")
STEP = 1e-6
SIZE = 200


@pytest.fixture(scope="module")
def standing():
    """Surface, kinematics and body of somebody whom one camera sees from the front."""
    template = load_template()
    kinematics = Kinematics(template, anatomy_of(template))
    pose = look_at(np.array([0, 0.9, 4.0]), np.array([0, 0.9, 0]))
    focal = np.array([[300.0, 0, SIZE / 2], [0, 300.0, SIZE / 2], [0, 0, 1]])
    outlines = Outlines.empty(1, [Camera(SIZE, SIZE, focal, pose)])
    outlines.add(0, 0, np.ones((SIZE, SIZE)))
    surface = Surface(kinematics, outlines, np.array([0]), seed=0)
    body = Body.at_rest(template, surface.usual, np.eye(3)[None], np.zeros((1, 3)))
    return surface, kinematics, body


def test_points_follow_what_stands_off_and_shape_as_finite_differences(standing):
    surface, kinematics, rest = standing
    random = np.random.default_rng(1)
    turns = to_matrix(from_rotvec(np.array([[0.3, 1.2, -0.2]])))
    body = Body.at_rest(kinematics.template, surface.usual, turns, rest.roots)
    body.angles = random.normal(0, 0.3, body.angles.shape)
    posed = kinematics.posed(body, 0)
    points, _ = surface.skinned(body, posed)
    numbers = random.integers(0, len(points), 60)
    ways = random.normal(size=(60, 3))
    rows = Rows(points[numbers], ways, np.zeros(60), np.ones(60), numbers)
    own = surface.own(posed, rows)
    for node in range(0, len(body.off_skin), 20):
        body.off_skin[node] += STEP
        moved = (surface.skinned(body, posed)[0] - points)[numbers] / STEP
        body.off_skin[node] -= STEP
        np.testing.assert_allclose(own[:, node], (moved * ways).sum(1), atol=1e-5)
    change = surface.reshaped(posed, kinematics.reshaped(posed))
    for shape in (0, 4, 11):
        body.shape[shape] += STEP
        there, _ = surface.skinned(body, kinematics.posed(body, 0))
        body.shape[shape] -= STEP
        np.testing.assert_allclose(change[..., shape], (there - points) / STEP, atol=1e-5)


def test_only_what_is_outermost_is_an_outline(standing):
    surface, kinematics, body = standing
    posed = kinematics.posed(body, 0)
    rows = surface.rows(body, posed, 0)  # a mask of everything: what is used is the rim
    names = np.array(kinematics.template.names)
    thigh = kinematics.template.joints[0, names == "upperleg02.L"][0]
    near = np.abs(rows.points[:, 1] - thigh[1]) < 0.03
    near &= np.abs(rows.points[:, 0] - thigh[0]) < 0.12
    assert near.sum() >= 2 and (rows.points[near, 0] > thigh[0]).all()


def test_what_stands_off_is_the_same_between_nodes(standing):
    surface, _, body = standing
    np.testing.assert_allclose(surface.whole(np.full_like(body.off_skin, 0.01)), 0.01)
    assert (np.linalg.eigvalsh(surface.information) > 0).all()
    assert surface.usual.max() == pytest.approx(0.012) and surface.usual.min() == 0
