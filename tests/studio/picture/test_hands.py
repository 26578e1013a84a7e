"""Lines and nails on the skin of hands."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from ico3d.studio.choice import load_subject
from ico3d.studio.picture.hands import (
    ALONG,
    FINE,
    NAIL,
    PALM,
    hands_of,
    line_depth,
    nail_share,
)
from support.recordings import synthetic_bodies
from support.shared import SUBJECTS

HUMAN = SUBJECTS / "human_face_f.npz"
FINEST = 1e-6  # m, smaller than any width


@pytest.fixture(scope="module")
def human():
    if not HUMAN.is_file():
        pytest.skip("the shared subjects are not here")
    return load_subject(str(HUMAN), whole=True)


def test_a_line_fades_with_the_distance_from_it_and_is_no_finer_than_pixels():
    lines = np.array([[0.0, 0, 0, 0.01, 0, 0, 0.001, 0.8]])
    for away in (0.0, 0.0007, 0.0015):
        expected = 0.8 * np.exp(-0.5 * (away / 0.001) ** 2)
        assert line_depth(lines, 0.004, away, 0.0, FINEST) == pytest.approx(expected)
        assert line_depth(lines, 0.01 + away, 0.0, 0.0, FINEST) == pytest.approx(expected)
    assert line_depth(lines, 0.004, 0.0031, 0.0, FINEST) == 0
    # Twice as wide, half as deep: from afar the same light is lost.
    assert line_depth(lines, 0.004, 0.0, 0.0, 0.002 / 0.6) == pytest.approx(0.4)
    assert line_depth(np.zeros((3, 8)), 0.0, 0.0, 0.0, FINEST) == 0


def test_a_nail_ends_at_its_rim():
    nails = np.zeros((5, 7))
    nails[3] = [0, 0, 0, 0.004, 0, 0, 0.005]
    assert nail_share(nails, 0.002, 0.0025, 0.0, FINEST) == (1.0, pytest.approx(0.5))
    assert nail_share(nails, 0.002, 0.0051, 0.0, FINEST)[0] == 0
    share, away = nail_share(nails, 0.002, 0.005, 0.0, 0.001)
    assert share == pytest.approx(0.5) and away == pytest.approx(1.0)
    assert nail_share(nails, 0.1, 0.1, 0.1, FINEST) == (0.0, 1.0)


def test_lines_lie_on_the_inner_side_of_both_hands_and_nails_on_their_backs(human):
    hands, bones = hands_of(human), human.skeleton
    skin = KDTree(human.vertices[hands.share > 0.5])
    for k, side in enumerate("LR"):
        rows = hands.lines[k][hands.lines[k, :, 6] > 0]
        assert len(rows) > 0.95 * hands.lines.shape[1]
        assert skin.query(rows[:, :3])[0].max() < 0.008  # of the mesh's width
        palm = hands.lines[k, : len(PALM) * ALONG]
        palm = palm[palm[:, 6] > 0]
        assert palm[:, 6] == pytest.approx(FINE)
        knuckles, wrist = (
            bones.at[[bones.index(f"finger{n}-1.{side}") for n in (2, 3, 5)]],
            bones.at[bones.index(f"wrist.{side}")],
        )
        normal = np.cross(knuckles[0] - wrist, knuckles[2] - wrist)
        normal /= np.linalg.norm(normal)
        nails = hands.nails[k]
        assert (nails[:, 6] == np.float32(NAIL[2])).all()
        inner = np.sign((palm[:, :3] - wrist) @ normal).sum()
        assert abs(inner) > 0.9 * len(palm)  # all on one side
        last = bones.at[[bones.index(f"finger{n}-3.{side}") for n in (2, 3, 4, 5)]]
        outwards = (0.5 * (nails[1:, :3] + nails[1:, 3:6]) - last) @ normal
        along = last - bones.at[[bones.index(f"finger{n}-2.{side}") for n in (2, 3, 4, 5)]]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        past = ((0.5 * (nails[1:, :3] + nails[1:, 3:6]) - last) * along).sum(1)
        lifted = outwards - past * (along @ normal)
        assert (np.sign(lifted) == -np.sign(inner)).all()
        assert ((past > 0.005) & (past < 0.03)).all()
    left, right = (0.5 * (rows[:, :3] + rows[:, 3:6])[rows[:, 6] > 0] for rows in hands.lines)
    assert KDTree(left).query(right * (-1, 1, 1))[0].max() < 0.003  # hands mirror one another


def test_blood_shows_at_finger_tips_more_than_on_the_back_of_a_hand(human):
    hands = hands_of(human)
    skin = KDTree(human.vertices)
    tips = skin.query(hands.nails[:, :, 3:6].reshape(-1, 3))[1]
    assert hands.redness[tips].min() > 0.25
    assert np.median(hands.redness[hands.share > 0.5]) < 0.2
    assert hands.redness[hands.share == 0].max() == 0


def test_a_bust_has_no_hands_and_hands_without_skin_no_nails(tmp_path):
    path = str(synthetic_bodies.write_body(tmp_path / "tubes.npz"))
    bust, whole = (hands_of(load_subject(path, whole)) for whole in (False, True))
    assert bust.lines.shape == (2, 0, 8) and bust.nails.shape == (2, 0, 7)
    assert not bust.share.any() and not bust.redness.any()
    assert not whole.nails.any() and np.isfinite(whole.lines).all()
    assert np.isfinite(whole.redness).all() and whole.share.max() == 1
