"""Why nobody is found, in sentences."""

from types import SimpleNamespace

import numpy as np
import pytest

from ico3d.capture.posing.seeing.agreement import CORE
from ico3d.capture.posing.seeing.evidence import detected
from ico3d.capture.posing.seeing.sightings import Seen
from ico3d.errors import CaptureError
from support.bodies.moving_capture import MovingCapture


@pytest.mark.parametrize(
    ("finding", "why"),
    [
        ((), "none of 18 pictures shows a person whom MediaPipe finds"),
        (
            ((0, slice(None)),),
            "a person is found in 9 of 18 pictures, but never by two cameras in one frame; cameras "
            "c2 see nobody",
        ),
        (
            ((0, slice(0, 4)), (1, slice(4, None))),
            "a person is found in 9 of 18 pictures, but never by two cameras in one frame",
        ),
        (
            ((0, slice(None)), (1, slice(None))),
            "people are found in 18 of 18 pictures, but in no frame do two cameras agree on where: "
            "check the calibration and its scale (metres), and whether the cameras run in step",
        ),
    ],
)
def test_whoever_is_not_found_is_told_why(tmp_path, finding, why):
    seen = Seen(MovingCapture(tmp_path), [0, 2])
    seen.pixels[:] = np.random.default_rng(0).uniform(0, 36, seen.pixels.shape)
    for camera, frames in finding:
        seen.weights[frames, camera, CORE] = 1
    watcher = SimpleNamespace(seen=seen, look=lambda bodies: None)
    with pytest.raises(CaptureError) as caught:
        detected(watcher)  # type: ignore (as far as it looks)
    instead = "ico3d train body --method swings++ needs no skeleton."
    assert str(caught.value) == f"{tmp_path}: {why}; {instead}"
