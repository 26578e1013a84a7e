"""Exposure and white balance that wander are divided out; what else changes is left alone."""

import tracemalloc

import numpy as np
import pytest

from ico3d.capture.face.landmarks import FACE_OVAL
from ico3d.capture.portrait.exposure import (
    agree,
    displayed,
    even_out,
    evened,
    factors_of,
    linear,
)
from ico3d.capture.portrait.files import load_uint8, save_picture
from ico3d.capture.portrait.readings import Readings

pytestmark = pytest.mark.slow

FRAMES = 12


def _factors(seed=0):
    """(FRAMES, 3) whose logarithms have mean 0."""
    logs = np.random.default_rng(seed).normal(0, 0.2, (FRAMES, 3))
    return np.exp(logs - logs.mean(0))


def _oval():
    """(478, 2) a face of 60 × 80 pixels in the middle of a picture of 200 × 200."""
    turn = np.linspace(0, 2 * np.pi, len(FACE_OVAL), endpoint=False)
    landmarks = np.full((478, 2), 100.0)
    landmarks[FACE_OVAL] = 100 + np.stack([30 * np.sin(turn), -40 * np.cos(turn)], 1)
    return landmarks


def _clip(work, background, face):
    """Pictures of a face before a wall, of linear light (FRAMES, 3) each; their readings."""
    readings = Readings(frames=[3 * i for i in range(FRAMES)])
    readings.landmarks = [_oval()] * FRAMES
    y, x = np.mgrid[:200, :200]
    inside = ((x - 100) / 32.0) ** 2 + ((y - 100) / 42.0) ** 2 < 1
    wall = 0.25 + 0.1 * np.sin(x / 15.0)
    for number, far, near in zip(readings.frames, background, face, strict=True):
        light = np.where(inside[..., None], [0.4, 0.3, 0.2] * near, wall[..., None] * far)
        save_picture(work / "ori_imgs" / f"{number}.jpg", _bytes(light))
    return readings


def _bytes(light):
    return (displayed(light) * 255 + 0.5).astype(np.uint8)


def _faces(work, readings):
    """(FRAMES, 3) linear light of the middle of the face."""
    pictures = [load_uint8(work / "ori_imgs" / f"{n}.jpg") for n in readings.frames]
    return np.stack([linear(p[90:110, 90:110] / 255.0).mean((0, 1)) for p in pictures])


def test_display_values_come_back_from_linear_light():
    values = np.linspace(0, 1, 256)
    assert np.abs(displayed(linear(values)) - values).max() < 1e-6
    assert displayed(np.array([2.0]))[0] == pytest.approx(1.0)  # clipped


def test_factors_are_found_in_noise():
    random, factors = np.random.default_rng(1), _factors()
    wall = random.uniform(0.1, 0.4, (2000, 3))
    seen = wall * factors[:, None] + random.normal(0, 0.02, (FRAMES, 2000, 3))
    assert factors_of(seen, np.median(seen, 0)) == pytest.approx(factors, rel=0.01)


def test_what_is_black_or_clipped_tells_nothing():
    for light in (0.95, 0.001):
        wall = np.full((FRAMES, 500, 3), light)
        assert (factors_of(wall, wall[0]) == 1).all()


def test_evening_out_brings_a_picture_back():
    light = np.random.default_rng(0).uniform(0.02, 0.5, (40, 40, 3))
    factor = np.array([1.4, 0.8, 1.1])
    back = evened(_bytes(light * factor), factor).astype(int)
    assert np.abs(back - _bytes(light)).max() <= 2


def test_a_clip_whose_exposure_wanders_is_evened_out(tmp_path):
    factors = _factors()
    readings = _clip(tmp_path, factors, factors)
    before = _faces(tmp_path, readings)
    assert even_out(tmp_path, readings) == pytest.approx(np.log(factors).std(0).max(), rel=0.05)
    after = _faces(tmp_path, readings)
    assert np.log(before).std(0).min() > 0.1
    assert np.log(after).std(0).max() < 0.02  # a flat face: 8 bits have steps of 3 %
    assert after.mean(0) == pytest.approx([0.4, 0.3, 0.2], rel=0.03)


@pytest.mark.parametrize("spread", [0.0, 0.005])
def test_a_steady_clip_keeps_its_files(tmp_path, spread):
    light = 1 + spread * np.sin(np.arange(FRAMES))[:, None] * np.ones(3)
    readings = _clip(tmp_path, light, light)
    files = sorted((tmp_path / "ori_imgs").iterdir())
    before = [file.read_bytes() for file in files]
    assert even_out(tmp_path, readings) == 0
    assert [file.read_bytes() for file in files] == before


def test_a_screen_behind_somebody_changes_nothing(tmp_path):
    readings = _clip(tmp_path, _factors(), np.ones((FRAMES, 3)))
    before = _faces(tmp_path, readings)
    assert even_out(tmp_path, readings) == 0
    assert (_faces(tmp_path, readings) == before).all()


def test_a_face_agrees_with_factors_that_it_shows_itself():
    factors = _factors()
    assert agree(factors, 0.3 * factors)
    assert not agree(factors, 0.3 * np.ones((FRAMES, 3)))


def test_a_long_clip_takes_no_more_memory_than_a_short_one(tmp_path):
    readings = _clip(tmp_path, np.ones((FRAMES, 3)), np.ones((FRAMES, 3)))
    readings.frames, readings.landmarks = readings.frames * 30, readings.landmarks * 30
    tracemalloc.start()
    try:
        even_out(tmp_path, readings)
        assert tracemalloc.get_traced_memory()[1] < 48e6  # 360 pictures at once take 85 MB
    finally:
        tracemalloc.stop()
