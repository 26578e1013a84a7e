"""A person who was recorded gets a skeleton where theirs is."""

import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from ico3d.capture.posing.command import Pose
from ico3d.studio.picture import paint
from ico3d.studio.recording import Recording, record
from ico3d.studio.truth import true_joints
from support.needs import needs
from support.shared import MODELS, SUBJECTS

SUBJECT = SUBJECTS / "human_face_f.npz"
pytestmark = [needs("mediapipe"), needs("anny"), pytest.mark.slow]
SEEN = ("upperarm01", "lowerarm01", "wrist", "upperleg01", "lowerleg01", "foot")


@pytest.mark.skipif(not SUBJECT.is_file(), reason="the synthetic woman is not here")
@pytest.mark.skipif(
    not (MODELS / "pose_landmarker.task").is_file(), reason="MediaPipe's models are not here"
)
def test_four_cameras_place_her_joints(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(MODELS))
    monkeypatch.setattr(paint, "DIRECTIONS", 6)  # of light: drawn sooner, and no easier to see
    recording = Recording(
        str(SUBJECT), "body", 5, 1, 2.0, 5, 192, "Hello.", 0, True, "studio", "showcase"
    )
    folder = tmp_path / "clip"
    record(recording, folder, 1)
    Pose(folder, workers=1).run()
    track, true = open_capture(folder).body_track(), true_joints(folder, SUBJECT)
    assert track is not None and track.fitted.all()
    off = [
        track.joints()[:, track.rig.index(name)] - true.places[:, true.names.index(name)]
        for name in track.rig.names
        if name.startswith(SEEN)
    ]
    away = np.linalg.norm(off, axis=-1)
    assert np.median(away) < 0.02 and np.percentile(away, 95) < 0.07
