"""Frames stream: a recording by many cameras costs no more memory than one of its pictures."""

import json
import pickle
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from support.recordings import renderme_files

pytestmark = pytest.mark.slow

LOOK = textwrap.dedent(
    """
    import gc, json, sys, resource
    import numpy as np
    from ico3d.capture.capture import Capture
    from ico3d.capture.formats import open_capture

    def resident():
        gc.collect()
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * resource.getpagesize()

    capture = open_capture(sys.argv[1])
    random = np.random.default_rng(0)
    capture.world_from_head(0)
    sizes = []
    for turn in range(3):
        for _ in range(60):
            camera, frame = random.integers(60), random.integers(24)
            assert capture.image(camera, frame) is not None
            assert capture.mask(camera, frame) is not None
            capture.keypoints_2d(camera, frame), capture.head_points(frame)
        sizes.append(resident())
    print(json.dumps({"sizes": sizes, "open": len(__import__("os").listdir("/proc/self/fd"))}))
    """
)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_memory_and_files_stay_flat_over_hundreds_of_pictures(tmp_path):
    """60 cameras, 24 frames: 1440 pictures and mattes, 120 kB of vertices for each frame."""
    rig = renderme_files.Rig(cameras=tuple(range(60)), frames=24, size=(30, 36))
    raw = renderme_files.write_recording(tmp_path, rig, same_picture=True)
    run = [sys.executable, "-c", LOOK, str(raw)]
    found = json.loads(subprocess.run(run, check=True, capture_output=True, text=True).stdout)
    # 120 pictures after the first 60 add nothing; HDF5 keeps a megabyte or two of its index.
    assert found["sizes"][-1] - found["sizes"][0] < 6 * 2**20
    assert found["open"] < 20


def test_an_open_recording_can_be_sent_to_other_processes(tmp_path):
    capture = open_capture(
        renderme_files.write_recording(tmp_path, renderme_files.Rig(cameras=(22, 25), frames=2))
    )
    image, pose = capture.image(1, 0), capture.world_from_head(1)
    copy = pickle.loads(pickle.dumps(capture))
    np.testing.assert_array_equal(copy.image(1, 0), image)
    np.testing.assert_array_equal(copy.world_from_head(1), pose)
