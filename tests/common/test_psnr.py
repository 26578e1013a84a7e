"""PSNR against closed forms; that of training's progress bars agrees with it."""

import numpy as np
import pytest
import torch

from ico3d.common.psnr import decibels, psnr
from ico3d.splat.losses import tensor_psnr


def test_equal_pictures_have_120_db_whoever_measures():
    picture = np.full((2, 3, 3), 0.25, np.float32)
    assert psnr(picture, picture) == psnr(picture, picture, np.ones((2, 3))) == 120
    assert tensor_psnr(*[torch.from_numpy(picture)] * 2) == decibels(0.0) == 120


def test_a_tenth_of_the_range_is_20_db():
    assert decibels(0.01) == pytest.approx(20)


def test_tensors_are_measured_as_files_are():
    rng = np.random.default_rng(0)
    predicted, truth = rng.random((2, 8, 9, 3)).astype(np.float32)
    mask = rng.random((8, 9)).astype(np.float32)
    tensors = [torch.from_numpy(values) for values in (predicted, truth, mask)]
    assert tensor_psnr(*tensors) == pytest.approx(psnr(predicted, truth, mask), abs=1e-4)
    assert tensor_psnr(*tensors[:2]) == pytest.approx(psnr(predicted, truth), abs=1e-4)
