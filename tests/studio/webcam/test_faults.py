"""What a webcam does wrong: each fault as it is meant, the same for the same seed."""

import numpy as np
import pytest

from ico3d.capture.portrait.exposure import displayed, linear
from ico3d.studio.webcam.faults import (
    ELECTRONS,
    READ_NOISE,
    Shown,
    dropping,
    noisy,
    random_of,
    rolled,
    swings,
)
from ico3d.studio.webcam.film import pictures_of, webcam_of

FPS = 25.0


def _flat(value: int) -> np.ndarray:
    return np.full((64, 64, 3), value, np.uint8)


def _textured(shift: float) -> np.ndarray:
    """(64, 96, 3) uint8 waves, moved to the right by `shift` pixels."""
    y, x = np.mgrid[:64, :96].astype(float)
    waves = np.sin((x - shift) / 4.0) + np.sin((x - shift) / 9.0 + y / 6.0)
    return np.repeat((128 + 50 * waves).astype(np.uint8)[..., None], 3, 2)


def test_noise_is_shot_and_read_noise():
    random = np.random.default_rng(0)
    for light in (0.01, 0.2, 0.8):
        found = noisy(np.full((200, 200, 3), light), random) - light
        assert found.mean() == pytest.approx(0, abs=5e-4)
        assert found.var() == pytest.approx(light / ELECTRONS + READ_NOISE**2, rel=0.03)


def test_noise_shows_most_in_the_dark():
    random = np.random.default_rng(0)
    spread = [
        (displayed(noisy(linear(_flat(v) / 255.0), random)) - v / 255).std() for v in (40, 200)
    ]
    assert spread[0] > 1.5 * spread[1]


def test_exposure_wanders_about_what_is_right():
    gains = swings(500, FPS, np.random.default_rng(0))
    stops = np.log2(gains)
    assert stops.mean(0) == pytest.approx(0, abs=1e-9)
    assert stops[:, 1].std() == pytest.approx(0.3, abs=1e-9)
    assert np.abs(np.diff(stops, axis=0)).max() < 0.15  # over seconds, not from picture to picture
    assert np.abs(stops[:, 0] - stops[:, 2]).max() > 0.1  # warm, then cold
    assert (swings(1, FPS, np.random.default_rng(0)) == 1).all()


def test_a_rolling_shutter_leans_what_moves_aside():
    pytest.importorskip("cv2")
    moving = rolled(_textured(-4), _textured(0), _textured(4))
    above, middle, below = (
        min(np.arange(-3, 3.1, 0.1), key=lambda s: _away(moving, float(s), row))
        for row in (6, 32, 58)
    )
    # Row r is read 0.7 · (r / 64 − 1/2) pictures late, and a picture's motion is 4 pixels.
    assert above == pytest.approx(-1.1, abs=0.3)
    assert middle == pytest.approx(0.0, abs=0.3)
    assert below == pytest.approx(1.2, abs=0.3)


def _away(picture: np.ndarray, shift: float, row: int) -> float:
    wanted = _textured(shift)[row, 10:-10].astype(float)
    return float(np.abs(picture[row, 10:-10] - wanted).mean())


def test_what_stands_still_is_read_as_it_is():
    pytest.importorskip("cv2")
    still = _textured(0)
    assert (rolled(still, still, still) == still).all()


def test_a_slow_webcam_repeats_or_loses_pictures():
    film = dropping(1000, FPS, np.random.default_rng(0))
    times = [one.at for one in film]
    fresh = [one for one in film if one.at == one.frame]
    assert times == sorted(set(times))
    assert all(0 <= one.at - one.frame <= 3 for one in film)
    lost, repeated = 1000 - len(film), len(film) - len(fresh)
    assert 130 < lost + repeated < 270  # 10 of 25 pictures, half of the time
    assert 0.4 < repeated / (lost + repeated) < 0.6
    assert film[0] == Shown(0, 0)


def test_a_webcam_that_is_slow_anyway_drops_nothing():
    film = dropping(100, 12.5, np.random.default_rng(0))
    assert film == [Shown(number, number) for number in range(100)]


def test_each_fault_is_the_same_alone_and_with_others():
    alone = webcam_of(["drops"], 300, FPS, seed=3)
    both = webcam_of(["exposure", "drops"], 300, FPS, seed=3)
    assert alone.shown == both.shown
    assert (both.gains == webcam_of(["exposure"], 300, FPS, seed=3).gains).all()
    assert both.shown != webcam_of(["drops"], 300, FPS, seed=4).shown
    assert random_of(3, "noise").random() != random_of(3, "drops").random()


def test_a_repeated_picture_has_the_noise_of_the_first():
    webcam = webcam_of(["drops"], 200, FPS, seed=0)
    pictures = list(pictures_of(webcam, ["noise", "drops"], 0, lambda frame: _flat(90)))
    again = [
        (before, now)
        for before, now, one in zip(pictures, pictures[1:], webcam.shown[1:], strict=False)
        if one.at != one.frame
    ]
    assert again
    assert all((before == now).all() for before, now in again)
    assert (pictures[0] != pictures[1]).any()


def test_without_faults_pictures_stay():
    webcam = webcam_of([], 3, FPS, seed=0)
    pictures = list(pictures_of(webcam, [], 0, lambda frame: _flat(frame)))
    assert [int(picture[0, 0, 0]) for picture in pictures] == [0, 1, 2]
