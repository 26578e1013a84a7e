"""Sound inputs that the tests have no writer for."""

import struct
from pathlib import Path

import numpy as np

from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.headpose.track_file import HeadTrack
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import from_rotvec
from ico3d.rig.rig import Rig
from support.recordings import multiview_folders

FRAMES = 3


def write_multiview_film(folder: Path) -> None:
    """A multiview folder of two cameras with videos."""
    cameras = [multiview_folders.entry(c) for c in multiview_folders.ring(2, (64, 48))]
    multiview_folders.write_cameras(folder, cameras, 6)
    for camera in cameras:
        multiview_folders.write_video(folder / "videos" / f"{camera['name']}.mp4", 6)


def small_track() -> BodyTrack:
    """A body track of two joints."""
    random = np.random.default_rng(0)
    rig = Rig(("root", "arm"), (-1, 0), np.array([[0, 1, 0], [0.2, 1, 0.0]]))
    return BodyTrack(
        rig=rig,
        fps=30.0,
        rotations=from_rotvec(random.normal(size=(FRAMES, 2, 3))).astype(np.float32),
        roots=random.normal(size=(FRAMES, 3)).astype(np.float32),
        fitted=np.ones(FRAMES, bool),
        vertices=random.normal(size=(4, 3)).astype(np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        binding=Binding.strongest(random.random((4, 2))),
        source="nobody",
    )


def small_head_track(cameras: int) -> HeadTrack:
    """A head that stands still."""
    return HeadTrack(
        world_from_head=np.tile(np.eye(4), (FRAMES, 1, 1)),
        landmarks=np.zeros((FRAMES, 68, 3), np.float32),
        eyes=np.zeros((FRAMES, 7), np.float32),
        blendshapes=np.zeros((FRAMES, len(BLENDSHAPES)), np.float32),
        views=np.ones((FRAMES, cameras), np.uint8),
    )


def ascii_ply(data: bytes, order: str = "") -> bytes:
    """A binary PLY of floats as text, or big-endian."""
    head, body = data.split(b"end_header\n", 1)
    values = struct.unpack(f"<{len(body) // 4}f", body)
    if order:
        return (
            head.replace(b"little", b"big")
            + b"end_header\n"
            + struct.pack(f">{len(values)}f", *values)
        )
    head = head.replace(b"binary_little_endian", b"ascii")
    return head + b"end_header\n" + b"\n".join(b"%.6g" % value for value in values)
