"""Key frames of a body whose rest and whose gestures are known."""

import numpy as np
import pytest

from ico3d.avatar.animation import keyframes
from ico3d.avatar.animation.keyframes import Motion, find_actions, find_animation, find_rest
from ico3d.bundle.animation import Rest
from ico3d.splat.gaussians import Gaussians
from support.avatars.moving_body import MovingPerson

FPS = 15.0
KEYS = {0: 0.0, 20: 0.0, 28: 0.6, 38: -0.5, 46: 0.9, 56: 0.9, 64: 0.35, 70: 0.0, 80: 0.0}
"""Frame: radians that the left arm is raised; it stands still there."""


def smooth(part):
    return part * part * (3 - 2 * part)


class Gesturing(MovingPerson):
    """Raises and lowers its left arm between known frames; breathes a little."""

    def __init__(self, keys=KEYS):
        self.keys = keys
        last = max(keys)
        super().__init__(borders=(0, last // 3, 2 * last // 3, last))
        self.still = super().gaussians(0.0)

    def angle(self, frame):
        frames = np.array(sorted(self.keys))
        index = min(int(np.searchsorted(frames, frame, side="right")) - 1, len(frames) - 2)
        begin, end = frames[index], frames[index + 1]
        part = smooth((frame - begin) / (end - begin))
        return (1 - part) * self.keys[begin] + part * self.keys[end]

    def gaussians(self, seconds):
        still = self.still
        means = still.means.numpy().astype(np.float64)
        arm, pivot = self.bone == 2, np.array([0.2, 1.4, 0.0])
        angle = self.angle(seconds * FPS)
        turn = np.array(
            [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
        )
        means[arm] = (means[arm] - pivot) @ turn.T + pivot
        means[:, 1] += 0.002 * np.sin(2 * np.pi * seconds / 3)
        return Gaussians(
            means=still.means.new_tensor(means),
            quats=still.quats,
            scales=still.scales,
            opacities=still.opacities,
            colors=still.colors,
        )


@pytest.fixture(scope="module")
def motion():
    return Motion.of(Gesturing())


def test_speeds_are_those_of_the_arm_in_every_window(motion):
    person = Gesturing()
    reach = 0.55  # from shoulder to hand
    frames = np.arange(len(motion.speeds))
    angles = np.array([person.angle(frame) for frame in frames])
    true = np.abs(np.gradient(angles)) * FPS * reach
    assert len(motion.places) == len(frames) == 81
    moving = true > 0.2
    assert (motion.speeds[moving] > 0.35 * true[moving]).all()
    assert (motion.speeds[moving] < 1.2 * true[moving]).all()
    assert motion.speeds[2:18].max() < 0.01


def test_rest_is_the_longest_calm_span(motion):
    rest = find_rest(motion)
    assert rest.start <= 4 and 16 <= rest.end <= 21
    assert motion.speeds[[rest.start, rest.end]].max() < 0.01


def test_actions_are_the_frames_where_the_arm_turns_or_is_held(motion):
    actions = find_actions(motion, find_rest(motion))
    frames = sorted(action.frame for action in actions)
    assert len(frames) == 4
    for frame, (low, high) in zip(frames, [(28, 28), (38, 38), (46, 56), (64, 64)], strict=True):
        assert low - 1 <= frame <= high + 1
    best, worst = actions[0], actions[-1]
    assert 45 <= best.frame <= 57 and worst.frame in (63, 64, 65)
    assert 0 < worst.score < best.score <= 1


def test_the_animation_fits_the_body(motion):
    animation = find_animation(motion)
    assert animation.fps == FPS and animation.num_frames == 81
    assert animation.actions == find_actions(motion, animation.rest)
    assert animation == find_animation(Motion.of(Gesturing()))


def test_a_calm_clip_rests_all_the_time():
    animation = find_animation(Motion.of(Gesturing({0: 0.0, 30: 0.0})))
    assert animation.actions == ()
    assert animation.rest.start <= 6 and animation.rest.end >= 24


def test_somebody_who_always_moves_rests_where_it_is_calmest():
    keys = {i * 8: (i % 2) * 0.8 for i in range(5)} | {48: 0.6, 56: 0.8, 64: 0.0, 72: 0.8}
    rest = find_animation(Motion.of(Gesturing(keys))).rest
    assert rest.end - rest.start >= 5 and 30 <= rest.start < rest.end <= 58


def test_a_steady_wave_does_not_rest_all_the_time():
    speeds = np.abs(np.sin(np.arange(200) / 3)) + 0.01
    rest = find_rest(Motion(15.0, speeds, ()))
    assert 6 <= rest.end - rest.start <= 8


@pytest.mark.parametrize("count", [2, 3])
def test_the_shortest_clips_have_a_rest(count):
    places = tuple(np.random.default_rng(0).normal(size=(count, 50, 3)))
    motion = Motion(15.0, np.arange(1.0, count + 1), places)
    animation = find_animation(motion)
    assert animation.rest == Rest(0, count - 1) and animation.actions == ()


def test_of_a_long_clip_no_more_places_are_kept_than_are_needed(motion, monkeypatch):
    all_places = sum(len(places) for places in motion.places)
    monkeypatch.setattr(keyframes, "MOST_PLACES", all_places // 3)
    fewer = Motion.of(Gesturing())
    assert sum(len(places) for places in fewer.places) <= all_places // 3
    found, before = find_animation(fewer), find_animation(motion)
    assert found.rest == before.rest
    assert {action.frame for action in found.actions} == {action.frame for action in before.actions}
