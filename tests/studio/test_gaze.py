"""Eyes turn with their shapes, and the sight of both meets at the point that is looked at."""

import numpy as np
import pytest

from ico3d.studio.acting.gaze import KAPPA, looking
from ico3d.studio.acting.performance import Performance
from ico3d.studio.choice import load_subject
from ico3d.studio.person.skeleton import about
from ico3d.studio.picture.eyeball import eye_rows
from support.needs import needs

pytestmark = needs("anny")


@pytest.fixture(scope="module")
def anny():
    return load_subject("anny")


def _still(subject, degrees):
    pose = np.eye(4)
    pose[:3, :3] = about(np.array([0.0, 1.0, 0.0]), np.radians(degrees))
    pose[:3, 3] = subject.head_in_world
    weights = np.zeros((1, len(subject.blendshape_names)), np.float32)
    return Performance(np.zeros(1), "", (), weights, np.zeros((1, 7)), pose[None])


@pytest.mark.parametrize("degrees", [0.0, 6.0, -6.0])
@pytest.mark.parametrize("away", [0.5, 1.35])
def test_the_sight_of_both_eyes_meets_at_the_point(anny, degrees, away):
    point = anny.head_in_world + np.array([0.02, 0.03, away])
    acted = looking(anny, _still(anny, degrees), point)
    inverse = np.linalg.inv(acted.world_from_head[0])
    local = inverse[:3, :3] @ point + inverse[:3, 3]
    for row, outward in zip(eye_rows(anny, anny.posed(acted.weights[0])), (1, -1), strict=True):
        sight = (local - row[:3]) / np.linalg.norm(local - row[:3])
        # The axis through the pupil stands outward of the line of sight, the left eye's to the
        # person's left.
        wanted = about(np.array([0.0, 1.0, 0.0]), outward * KAPPA) @ sight
        assert np.degrees(np.arccos(min(1.0, row[9:12] @ wanted))) < 1.2


def test_a_glance_leaves_the_point_as_far_as_it_left_ahead(anny):
    point = anny.head_in_world + np.array([0.0, 0.0, 1e3])  # straight ahead of anny's eyes
    calm, glancing = _still(anny, 0.0), _still(anny, 0.0)
    glance = [anny.blendshape_names.index(f"eyeLook{w}") for w in ("OutLeft", "InRight")]
    glancing.weights[0, glance] = 0.3

    def turned(acted):
        x, _, z = eye_rows(anny, anny.posed(acted.weights[0]))[:, 9:12].T
        return np.degrees(np.arctan2(x, z))

    at_rest = turned(glancing) - turned(calm)
    on_point = turned(looking(anny, glancing, point)) - turned(looking(anny, calm, point))
    assert at_rest.min() > 4
    np.testing.assert_allclose(on_point, at_rest, atol=0.3)


def test_anny_has_hair_brows_and_lashes_of_strands(anny):
    strands = anny.strands
    assert sorted(set(strands.material)) == [6, 8, 9]
    roots = strands.on(anny.vertices)[strands.first[:-1][strands.material == 9]]
    eyes = np.array([eye.centre for eye in anny.eyes])
    away = np.linalg.norm(roots[:, None] - eyes, axis=2).min(axis=1)
    assert (away < 0.025).all()
    assert ((roots[:, 0] > 0).mean() > 0.4) and ((roots[:, 0] < 0).mean() > 0.4)


def test_the_same_person_grows_the_same_hair(anny):
    again = load_subject("anny").strands
    for name in ("first", "corners", "parts", "offsets", "open", "radius", "tone", "material"):
        np.testing.assert_array_equal(getattr(again, name), getattr(anny.strands, name))
