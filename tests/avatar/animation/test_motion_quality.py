"""Motion that does not look as it was recorded is found, and not played."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ico3d.avatar.animation.command import table
from ico3d.avatar.animation.keyframes import Motion
from ico3d.avatar.animation.motion_quality import (
    FAR_BELOW,
    in_words,
    least_quality,
    measure_motion,
    playable,
    refused,
)
from ico3d.bundle.animation import Action, Animation, Rest
from ico3d.errors import BundleError, CaptureError
from ico3d.splat.gaussians import Gaussians
from support.avatars.filmed_person import FilmedPerson
from support.avatars.moving_body import MovingPerson, Span

pytestmark = pytest.mark.slow

CLIP = Span(0, 22)
HEAD, ARM = 1, 2
DISSOLVED = range(9, 13)


class Trained:
    """The person as somebody learnt it: right but for a bone that is missing in some frames."""

    def __init__(self, person: MovingPerson, bone: int, frames: range):
        self.person, self.bone, self.frames = person, bone, frames

    def whole(self, tau: float) -> Gaussians:
        frame = round(tau * CLIP.last)
        gaussians = self.person.gaussians(frame / self.person.fps)
        gone = torch.from_numpy(self.person.bone == self.bone) & (frame in self.frames)
        return replace(gaussians, opacities=gaussians.opacities * ~gone)

    def body(self, tau: float) -> Gaussians:
        gaussians = self.whole(tau)
        head = torch.from_numpy(self.person.bone == HEAD)
        return replace(gaussians, opacities=gaussians.opacities * ~head)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    person = MovingPerson(300)
    return person, FilmedPerson(person, tmp_path_factory.mktemp("filmed"))


def animation(quality=(), frames=23, rest=(1, 5), actions=(7, 11, 16)):
    chosen = tuple(Action(frame, 0.5) for frame in actions)
    return Animation(15.0, frames, Rest(*rest), chosen, quality=tuple(quality))


def test_an_arm_that_dissolves_is_found_in_its_frames_and_nowhere_else(recorded):
    person, capture = recorded
    trained = Trained(person, ARM, DISSOLVED)
    quality = measure_motion(trained.whole, None, capture, CLIP)
    assert len(quality) == 23
    judged = animation(quality)
    bad = [frame for frame, value in enumerate(quality) if value < least_quality(judged)]
    assert bad == list(DISSOLVED)
    good = [value for frame, value in enumerate(quality) if frame not in DISSOLVED]
    assert np.ptp(good) < FAR_BELOW  # noise and poses alone refuse nothing


def test_what_the_face_does_is_not_judged(recorded):
    person, capture = recorded
    trained = Trained(person, HEAD, DISSOLVED)
    with_face = measure_motion(trained.whole, None, capture, CLIP)
    assert with_face[10] < with_face[5] - FAR_BELOW

    # a face in another mood than the recorded one: there is a head in every frame, of other colour
    def moody(tau):
        gaussians = person.gaussians(tau * CLIP.last / person.fps)
        head = torch.from_numpy(person.bone == HEAD)[:, None]
        return replace(gaussians, colors=torch.where(head, 0.05, gaussians.colors))

    blind = measure_motion(moody, Trained(person, ARM, range(0)).body, capture, CLIP)
    assert min(blind) > 25 and np.ptp(blind) < FAR_BELOW


def test_frames_without_a_picture_lie_between_their_neighbours(recorded, monkeypatch):
    person, capture = recorded
    trained = Trained(person, ARM, DISSOLVED)
    every = measure_motion(trained.whole, None, capture, CLIP)
    picture = capture.image
    gaps = {3, 20, 21, 22}
    monkeypatch.setattr(
        capture, "image", lambda camera, frame: None if frame in gaps else picture(camera, frame)
    )
    some = measure_motion(trained.whole, None, capture, CLIP)
    assert some[3] == pytest.approx((every[2] + every[4]) / 2, abs=0.01)
    assert some[20:] == (every[19],) * 3
    monkeypatch.setattr(capture, "image", lambda camera, frame: None)
    assert measure_motion(trained.whole, None, capture, CLIP) == ()


def test_a_picture_without_a_mask_judges_nothing(recorded, monkeypatch):
    """What is behind would be compared with nothing."""
    person, capture = recorded
    trained = Trained(person, ARM, range(0))
    views = [(camera, frame) for camera in range(5) for frame in range(23)]
    pictures = {view: (capture.image(*view), capture.mask(*view)) for view in views}
    monkeypatch.setattr(capture, "background", lambda camera: None)
    monkeypatch.setattr(capture, "image", lambda *view: pictures[view][0])
    monkeypatch.setattr(capture, "mask", lambda c, f: None if f == 9 else pictures[c, f][1])
    quality = measure_motion(trained.whole, None, capture, CLIP)
    assert np.ptp(quality) < FAR_BELOW
    monkeypatch.setattr(capture, "mask", lambda camera, frame: None)
    assert measure_motion(trained.whole, None, capture, CLIP) == ()


def test_a_dark_camera_that_misses_frames_refuses_nothing(recorded, monkeypatch):
    person, capture = recorded
    trained, picture = Trained(person, ARM, range(0)), capture.image

    def image(camera, frame):
        if camera == 0 and 8 <= frame <= 10:
            return None
        return picture(camera, frame) * (1.0 if camera == 0 else 0.8)

    monkeypatch.setattr(capture, "image", image)
    assert np.ptp(measure_motion(trained.whole, None, capture, CLIP)) < FAR_BELOW


def test_the_recording_of_another_clip_is_refused(recorded):
    person, capture = recorded
    with pytest.raises(CaptureError, match="has 23 frames, the body 24"):
        measure_motion(person.gaussians, None, capture, Span(0, 23))


def test_gestures_beyond_bad_frames_are_left_out():
    quality = np.full(23, 26.0)
    quality[9:13] = 20.0
    judged = animation(quality)
    played = playable(judged)
    assert played.rest == judged.rest and played.quality == judged.quality
    assert [action.frame for action in played.actions] == [7]  # 16 is good, but not its way
    assert [action.frame for action in refused(judged.actions, played)] == [11, 16]
    words = in_words(played, 2)
    assert "frames 9 to 12 fall far below" in words and "20.0 dB against 26.0 dB" in words
    assert "2 gestures are not played" in words
    assert "1 gesture is not played" in in_words(played, 1)
    assert playable(animation()) == animation()  # nobody measured
    assert playable(animation(np.full(23, 26.0))).actions == judged.actions
    assert "all motion looks alike (26.0 dB" in in_words(animation(np.full(23, 26.0)), 0)


@pytest.mark.parametrize("bad, rest, actions", [(3, (4, 8), [11]), (7, (1, 6), [0])])
def test_a_rest_loop_is_cut_to_its_longest_good_stretch(bad, rest, actions):
    quality = np.full(23, 26.0)
    quality[[bad, 14]] = 10.0
    played = playable(animation(quality, rest=(1, 8), actions=(0, 11, 16)))
    assert played.rest == Rest(*rest)
    assert [action.frame for action in played.actions] == actions


def test_somebody_who_never_rests_well_is_refused():
    quality = np.full(23, 26.0)
    quality[1:6] = 10.0
    with pytest.raises(BundleError, match="rest loop"):
        playable(animation(quality))


def test_the_file_keeps_what_was_measured_and_older_files_are_read():
    known = animation(np.linspace(20, 26, 23))
    assert Animation.from_bytes(known.to_bytes()) == known
    assert b"quality" not in animation().to_bytes()
    assert Animation.from_bytes(animation().to_bytes()) == animation()
    with pytest.raises(BundleError, match="quality must have 23 entries, or none"):
        animation([1.0, 2.0])


def test_the_table_shows_what_is_refused():
    quality = np.full(23, 26.0)
    quality[9:13] = 20.0
    played = playable(animation(quality))
    motion = Motion(15.0, np.full(23, 0.1), tuple(np.zeros((4, 3)) for _ in range(23)))
    shown = table(played, motion, refused(animation().actions, played))
    columns = {column.header: list(column.cells) for column in shown.columns}
    assert columns["frame"] == ["1", "5", "7", "11", "16"]
    assert columns["what"] == ["rest start", "rest end", "action", "refused", "refused"]
    assert columns["picture dB"] == ["26.0", "26.0", "26.0", "20.0", "26.0"]
