"""The similarity between two canonical head spaces, and what follows from it on every frame."""

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.similarity import STEADY, canonical_from_head, moved, similarity
from ico3d.capture.face.canonical import canonical_landmarks
from ico3d.errors import ModelError
from ico3d.splat import quaternions
from support.avatars.planted_person import ABROAD, face

pytestmark = pytest.mark.slow

seeds = st.integers(0, 2**32 - 1)
OUTLIERS = round(0.2 * len(STEADY))


def rigid(rng):
    """(4, 4) any turn and move."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.random(rng=rng).as_matrix()
    matrix[:3, 3] = rng.normal(0, 1, 3)
    return matrix


def sim3(rng):
    """(4, 4) the same with a scale from 1/20 to 20."""
    matrix = rigid(rng)
    matrix[:3, :3] *= 20 ** rng.uniform(-1, 1)
    return matrix


@given(seeds, st.integers(3, 20))
def test_any_similarity_is_found(seed, count):
    """To 1e-9, from three points on, flat ones included."""
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 0.1, (count, 3)) * ((1, 1, 0) if count % 2 else (1, 1, 1))
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    assume(spread[1] > 1e-3 * spread[0])  # three points may all but lie on a line
    truth = sim3(rng)
    found = similarity(moved(truth, points), points)
    np.testing.assert_allclose(found, truth, atol=1e-9 * max(1, np.abs(truth).max()))


@given(seeds)
def test_it_never_mirrors(seed):
    """The best turn to a mirrored face is a turn, though nothing fits."""
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 0.1, (8, 3))
    found = similarity(points * (-1, 1, 1), points)
    scale = np.cbrt(np.linalg.det(found[:3, :3]))
    assert scale > 0
    turn = found[:3, :3] / scale
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)


def test_a_line_tells_no_turn():
    """Nor do landmarks on one line tell where a head is."""
    line = np.linspace(0, 1, 68)[:, None] * np.array([0.1, 0.2, 0.3])
    with pytest.raises(ValueError, match="line"):
        similarity(line, line)
    with pytest.raises(ModelError, match="on one line: track head and body again"):
        canonical_from_head(line, line)


@settings(max_examples=25)
@given(seeds)
def test_a_fifth_of_the_landmarks_may_be_wrong(seed):
    """By centimetres: the rest decides. What moves with the face does not count at all."""
    rng = np.random.default_rng(seed)
    truth, there = sim3(rng), face()
    size = np.cbrt(np.linalg.det(truth[:3, :3]))
    wrong = rng.choice(STEADY, OUTLIERS, replace=False)
    there[wrong] += rng.choice([-1, 1], (OUTLIERS, 3)) * rng.uniform(0.01, 0.08, (OUTLIERS, 3))
    unsteady = np.setdiff1d(np.arange(68), STEADY)
    there[unsteady] += rng.normal(0, 0.05, (len(unsteady), 3))
    found, rest = canonical_from_head(moved(truth, there), face())
    np.testing.assert_allclose(found, truth, atol=1e-8 * max(1, size))
    assert rest < 1e-9 * max(1, size)


@settings(max_examples=50)
@given(seeds)
def test_the_composition_across_setups(seed):
    """W_{i,2}·G is C_2⁻¹·A_{i,2}·A_{0,1}⁻¹·C_1 with absolute poses A; checked to 1e-12."""
    rng = np.random.default_rng(seed)
    c1, c2, a01 = (rigid(rng) for _ in range(3))
    later = [rigid(rng) for _ in range(4)]
    w_2 = np.stack([np.linalg.inv(c2) @ a for a in later])
    points = rng.normal(0, 0.1, (5, 3))
    recorded = moved(np.linalg.inv(c1) @ a01, points)  # the head of frame 0 in its own world
    placement = Placement(np.eye(4), w_2)
    for frame, a in enumerate(later):
        expected = moved(np.linalg.inv(c2) @ a @ np.linalg.inv(a01) @ c1, recorded)
        np.testing.assert_allclose(
            moved(placement.world_from_head(frame), points), expected, atol=1e-12
        )


def test_one_setup_is_the_identity():
    """With one tracker's pose and cameras, frame 0 gives x_0 back, and G is the identity."""
    found, _ = canonical_from_head(face(), face())
    np.testing.assert_allclose(found, np.eye(4), atol=1e-12)

    @settings(max_examples=50)
    @given(seeds)
    def gives_the_frame_back(seed):
        rng = np.random.default_rng(seed)
        c, a = rigid(rng), rigid(rng)
        w = np.linalg.inv(c) @ a
        points = rng.normal(0, 0.1, (5, 3))
        placement = Placement(found, w[None])
        recorded = moved(w, points)
        again = moved(placement.world_from_head(0) @ np.linalg.inv(w), recorded)
        np.testing.assert_allclose(again, recorded, atol=1e-12)

    gives_the_frame_back()


def test_gaussians_follow(head):
    """Rotations turn, scales scale; the network sees positions as they were, so colours stay."""
    rng = np.random.default_rng(0)
    placement = Placement(sim3(rng), rigid(rng)[None])
    matrix = placement.world_from_head(0)
    size = np.cbrt(np.linalg.det(matrix[:3, :3]))
    before = head.model.means.clone()
    still = head.model(torch.full((10,), 0.3))
    there = still.transform(matrix)
    assert torch.equal(head.model.means, before)
    assert torch.equal(there.colors, still.colors)
    assert torch.equal(there.opacities, still.opacities)
    turned = quaternions.to_matrix(there.quats).numpy()
    expected = matrix[:3, :3] / size @ quaternions.to_matrix(still.quats).numpy()
    np.testing.assert_allclose(turned, expected, atol=1e-5)
    np.testing.assert_allclose(there.scales.numpy(), size * still.scales.numpy(), rtol=1e-5)
    np.testing.assert_allclose(
        there.means.numpy(), moved(matrix, before.numpy().astype(float)), rtol=1e-5, atol=1e-5
    )


def test_landmarks_come_from_pixels(person, abroad):
    """Of all cameras and frames together: half a millimetre with a tenth of a pixel of noise."""
    for capture in (person, abroad):
        found = canonical_landmarks(capture)
        truth = moved(capture.canonical_from_head, face())
        assert np.linalg.norm(found - truth, axis=1).mean() < 1e-3
        capture.landmarks = lambda camera, frame, c=capture: c.cameras[camera].project(
            moved(c.true_world_from_head(frame), face())
        )[0]
        np.testing.assert_allclose(canonical_landmarks(capture), truth, atol=1e-9)
    matrix, rest = canonical_from_head(canonical_landmarks(abroad), face())
    np.testing.assert_allclose(matrix, ABROAD, atol=1e-8)
    assert rest < 1e-8


def test_landmarks_with_holes(person):
    """Frames without a pose and views without landmarks are left out; none at all is None."""
    pixels, pose = person.landmarks, person.world_from_head
    person.world_from_head = lambda frame: None if frame == 0 else pose(frame)
    person.landmarks = lambda camera, frame: None if camera == 1 else pixels(camera, frame)
    assert np.linalg.norm(canonical_landmarks(person) - face(), axis=1).mean() < 1e-3
    person.landmarks = lambda camera, frame: np.full((68, 2), np.nan)
    assert canonical_landmarks(person) is None
    person.landmarks = lambda camera, frame: pixels(0, 1) if (camera, frame) == (0, 1) else None
    assert canonical_landmarks(person) is None


def test_known_landmarks_are_taken(person):
    """Those that a format has in space, averaged over the frames that have them."""
    person.landmarks_3d = lambda frame: face() + 0.001 * frame if frame % 2 else None
    np.testing.assert_allclose(canonical_landmarks(person), face() + 0.003, atol=1e-12)
