"""Heads whose recording had no landmarks: their face is found in pictures drawn of them."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ico3d.avatar.joining.assemble import place_head
from ico3d.avatar.joining.finding import found_face
from ico3d.avatar.joining.similarity import canonical_from_head, moved, scale_of
from ico3d.avatar.render_bundle import baked_gaussians
from ico3d.errors import ModelError
from ico3d.splat.gaussians import Gaussians
from support.avatars.filmed_demo import FilmedDemo, away, demo, head_abroad, saved

pytestmark = pytest.mark.slow


def resting() -> Gaussians:
    """The demo's head in its own space."""
    baked = demo().head
    return baked_gaussians(baked, np.zeros(baked.expression_size, np.float32))


def test_any_turn_and_unit(face_model, packaged_demo):
    """What is found turns, moves and grows with the head, to a tenth of a millimetre."""
    gaussians = resting()
    there = np.eye(4)
    there[:3, :3] = 7.3 * Rotation.from_euler("xyz", (-70, 130, 20), degrees=True).as_matrix()
    there[:3, 3] = 5, -3, 9
    with found_face.face_seeker() as seeker:
        usual = seeker.of_head(gaussians, Path("a"))
        other = seeker.of_head(gaussians.transform(there), Path("a"))
    matrix, _ = canonical_from_head(moved(there, usual.landmarks), other.landmarks)
    placed = moved(matrix, other.landmarks)
    apart = np.linalg.norm(placed - other.landmarks, axis=1).mean() / scale_of(there)
    assert apart < 1e-4 and other.apart == pytest.approx(7.3 * usual.apart, rel=0.05)
    # the person's left is +x, the brows are above the chin, the nose is in front
    marks = usual.landmarks
    assert marks[45, 0] > 0.02 > -0.02 > marks[36, 0] and marks[27, 1] > marks[8, 1] + 0.05


def test_a_body_whose_pictures_show_no_face(face_model, packaged_demo, tmp_path, monkeypatch):
    """Seen from behind: what the recording says of it stands in, and that is said."""
    capture, said = FilmedDemo(tmp_path / "capture", (170, 190)), []
    with found_face.face_seeker() as seeker:
        marks = seeker.of_head(resting(), tmp_path).landmarks
    own = moved(np.linalg.inv(_posed(capture)), marks)
    monkeypatch.setattr(capture, "landmarks_3d", lambda frame: own)
    place_head(capture, tmp_path / "out", saved(head_abroad(), tmp_path / "head"), said.append)
    assert away(capture, tmp_path / "out") < 0.001
    assert "do not show it well enough: its recording's landmarks stand in." in said[0]


def _posed(capture: FilmedDemo) -> np.ndarray:
    """(4, 4) from the space of the recording's head poses to that of the demo's head."""
    return np.linalg.inv(capture.true_world_from_head(0)) @ capture.world_from_head(0)


def test_views_that_do_not_agree_are_refused(face_model, packaged_demo, tmp_path, monkeypatch):
    """With figures."""
    monkeypatch.setattr(found_face, "MOST_APART", 1e-5)
    monkeypatch.setattr(found_face, "CANDIDATES", 1)
    monkeypatch.setattr(found_face, "ROUNDS", 1)
    with found_face.face_seeker() as seeker:
        words = r"head: of 15 views drawn of this head 15 show one face, within \d\.\d mm; that is"
        with pytest.raises(ModelError, match=words):
            seeker.of_head(resting(), tmp_path / "head")
