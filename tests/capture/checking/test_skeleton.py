"""What is drawn of a body track lies where the body is."""

import numpy as np
from PIL import Image

from ico3d.capture.checking.check import examine
from ico3d.capture.checking.contact_sheet import contact_sheet
from ico3d.capture.checking.skeleton import BONE, GUESSED, OUTLINE, draw_skeleton
from ico3d.capture.formats import open_capture
from ico3d.common.camera import Camera
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack, write_body_track
from ico3d.rig.rig import Rig
from support.recordings import multiview_folders

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
FACES += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]


def cube(frames: int, fps: float, fitted: bool = True, step: float = 0.0) -> BodyTrack:
    """A cube of 0.4 m with a bone that points 0.3 m up, moved by so many metres each frame."""
    rig = Rig(("root", "up"), (-1, 0), np.array([[0.0, 0, 0], [0, 0.3, 0]]))
    roots = np.zeros((frames, 3), np.float32)
    roots[:, 0] = step * np.arange(frames)
    return BodyTrack(
        rig,
        fps,
        rig.rest(frames).astype(np.float32),
        roots,
        np.full(frames, fitted),
        (0.2 * CORNERS).astype(np.float32),
        np.array(FACES, np.int32),
        Binding.strongest(np.tile([1.0, 0.0], (8, 1))),
        "a cube",
    )


def test_outline_and_bone_lie_where_the_camera_sees_them():
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = 2.2  # the cube's front is 2 m away
    camera = Camera(100, 100, np.array([[200.0, 0, 50], [0, 200, 50], [0, 0, 1]]), pose)
    for fitted, colour in ((True, BONE), (False, GUESSED)):
        drawn = draw_skeleton(Image.new("RGB", (100, 100)), cube(1, 15.0, fitted), camera, 0)
        pixels = np.asarray(drawn)
        rows, columns = np.nonzero((pixels == OUTLINE).all(-1))
        edges = (rows.min(), rows.max(), columns.min(), columns.max())
        np.testing.assert_allclose(edges, (30, 69, 30, 69), atol=1)
        bone = (pixels == colour).all(-1)
        # The joint lies 2.2 m away: the bone of 0.3 m is 27 pixels long.
        np.testing.assert_allclose(np.nonzero(bone.any(1))[0][[0, -1]], (22.7, 50), atol=1)
        assert np.nonzero(bone.any(0))[0].tolist() in ([49], [50])


def test_a_check_tells_of_the_track_and_draws_it(tmp_path):
    folder = multiview_folders.write_folder(tmp_path / "clip")
    capture = open_capture(folder)
    before = np.asarray(contact_sheet(capture, [(0, 0)]))

    def found() -> tuple[str, str]:
        finding = next(f for f in examine(capture) if f.what == "skeleton")
        return finding.level, finding.text

    assert found() == ("ok", "no body track; ico3d capture pose finds one")
    write_body_track(cube(capture.num_frames, capture.fps), capture.path)
    assert found() == ("ok", "2 joints in 3 frames, 0 of them interpolated")
    assert (np.asarray(contact_sheet(capture, [(0, 0)])) != before).any()
    write_body_track(cube(capture.num_frames, capture.fps, step=2.0), capture.path)
    assert found()[0] == "warn" and "moves at" in found()[1]
