"""The true joints of a synthetic person are those that moved the mesh."""

import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from ico3d.studio.person.choice import load_subject
from ico3d.studio.recording import Recording, record
from ico3d.studio.truth import true_joints
from support.recordings.synthetic_bodies import write_body

pytestmark = pytest.mark.slow


def test_the_head_is_where_the_recording_says(tmp_path):
    subject = write_body(tmp_path / "body.npz")
    out = tmp_path / "out"
    settings = Recording(
        str(subject), "body", 1, 4, 15.0, 1, 32, "hello", 2, True, "studio", "showcase"
    )
    record(settings, out, 1)
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
