"""Frames stream: a recording of full length costs no more memory than one of its pictures."""

import json
import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from support.recordings import dna_files

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
    sizes = []
    for turn in range(5):
        for _ in range(120):
            camera, frame = random.integers(60), random.integers(225)
            assert capture.image(camera, frame) is not None
            assert capture.mask(camera, frame) is not None
            capture.keypoints_2d(camera, frame), capture.smplx(frame)
        sizes.append(resident())
    opened = len(__import__("os").listdir("/proc/self/fd"))
    with open("/proc/self/status") as file:  # getrusage counts what ran before exec, too
        lines = dict(line.split(":", 1) for line in file)
    peak = int(lines["VmHWM"].split()[0]) * 1024
    print(json.dumps({"sizes": sizes, "peak": peak, "open": opened}))
    """
)


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """60 cameras, 225 frames: 13,500 pictures and as many masks."""
    rig = dna_files.Rig(cameras=tuple(range(60)), frames=225, sizes=((30, 25), (40, 30)))
    return dna_files.write_recording(tmp_path_factory.mktemp("long"), rig, same_picture=True)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_memory_and_files_stay_flat_over_hundreds_of_pictures(long):
    run = [sys.executable, "-c", LOOK, str(long)]
    found = json.loads(subprocess.run(run, check=True, capture_output=True, text=True).stdout)
    assert found["peak"] < 300 * 2**20
    # 480 pictures after the first 120 add nothing; HDF5 keeps a megabyte or two of its index.
    assert found["sizes"][-1] - found["sizes"][0] < 6 * 2**20
    assert found["open"] < 20


def test_several_processes_read_one_open_recording(tmp_path):
    """Also when they are forked after the first picture has been read."""
    main = dna_files.write_recording(tmp_path, dna_files.Rig(cameras=(0, 1, 2), frames=4))
    capture = open_capture(main)
    before = [capture.image(camera, frame) for camera in range(3) for frame in range(4)]
    children = []
    for _ in range(4):
        child = os.fork()
        if child == 0:
            code = 1
            try:
                after = [capture.image(camera, frame) for camera in range(3) for frame in range(4)]
                same = all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
                code = 0 if same else 2
            finally:
                os._exit(code)
        children.append(child)
    still = capture.image(2, 3)
    assert [os.waitpid(child, 0)[1] for child in children] == [0] * 4
    np.testing.assert_array_equal(still, before[-1])


def test_an_open_recording_can_be_sent_to_other_processes(tmp_path):
    import pickle

    capture = open_capture(
        dna_files.write_recording(tmp_path, dna_files.Rig(cameras=(0, 1), frames=1))
    )
    image = capture.image(1, 0)
    copy = pickle.loads(pickle.dumps(capture))
    np.testing.assert_array_equal(copy.image(1, 0), image)
    assert copy.smplx(0).gender == "female"
