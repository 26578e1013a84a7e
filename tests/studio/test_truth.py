"""The true skeleton of a synthetic person is what moved the mesh."""

import numpy as np
import pytest
from safetensors.numpy import load_file
from scipy.spatial import KDTree

from ico3d.capture.formats import open_capture
from ico3d.errors import CaptureError
from ico3d.rig.body_track import write_body_track
from ico3d.studio.choice import load_subject
from ico3d.studio.recording import Recording, record
from ico3d.studio.truth import true_joints, true_track
from support.recordings.synthetic_bodies import write_body

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The file of a synthetic person, and the folder of a recording."""
    folder = tmp_path_factory.mktemp("truth")
    subject = write_body(folder / "body.npz")
    settings = Recording(
        str(subject), "body", 1, 4, 15.0, 1, 32, "hello", 2, True, "studio", "showcase"
    )
    record(settings, folder / "out", 1)
    return subject, folder / "out"


def test_the_head_is_where_the_recording_says(recorded):
    subject, out = recorded
    found = true_joints(out, subject)
    bones = load_subject(str(subject), True).skeleton
    assert bones is not None and found.names == bones.names
    head = found.names.index("head")
    for frame in range(4):
        pose = open_capture(out).world_from_head(frame)
        assert pose is not None
        np.testing.assert_allclose(
            found.places[frame, head], pose[:3, :3] @ bones.at[head] + pose[:3, 3], atol=1e-6
        )
    assert np.ptp(found.places, axis=0).max() > 1e-3


def test_the_surface_of_the_track_is_where_the_recorded_points_are(recorded):
    subject, out = recorded
    write_body_track(true_track(out, subject), out)
    track, true = open_capture(out).body_track(), true_joints(out, subject)
    assert track is not None
    np.testing.assert_allclose(track.joints(), true.places, atol=1e-5)
    points = load_file(out / "frames.safetensors")["points"]  # (4, P, 3)
    for frame in range(4):
        near = KDTree(points[frame]).query(track.surface(frame))[0]  # (V,)
        assert np.quantile(near, 0.95) < 0.03  # recorded points lie about as far apart
    assert np.ptp([track.surface(frame) for frame in range(4)], axis=0).max() > 0.05


def test_other_recordings_have_no_true_skeleton(recorded, tmp_path):
    (tmp_path / "capture.json").write_text("{}")
    with pytest.raises(CaptureError, match="no recording that ico3d capture synthetic made"):
        true_track(tmp_path, recorded[0])
