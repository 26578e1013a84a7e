"""LPIPS with made-up weights against its definition, written out."""

import logging

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from ico3d.errors import ModelError
from ico3d.measure.pictures import lpips as room
from support.weights.lpips import ALEXNET, STAGES, write_alexnet

pytestmark = pytest.mark.usefixtures("look_again")


def _scaled(a, b) -> torch.Tensor:
    """Two pictures as the authors' package scales them."""
    mean, deviation = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)
    values = torch.stack([torch.from_numpy(a), torch.from_numpy(b)]).float() * 2 - 1
    return ((values - torch.tensor(mean)) / torch.tensor(deviation)).movedim(-1, 1)


def _compared(values, weights) -> float:
    """The distance of two pictures' features."""
    unit = values / (values.square().sum(1, keepdim=True).sqrt() + 1e-10)
    difference = (unit[:1] - unit[1:]).square()
    return float(torch.nn.functional.conv2d(difference, weights).mean())


def _by_definition(a, b, vgg, linear) -> float:
    values = _scaled(a, b)
    number, total = 0, 0.0
    for stage, widths in enumerate(STAGES):
        for _ in widths:
            weight, bias = (vgg[f"features.{number}.{kind}"] for kind in ("weight", "bias"))
            values = torch.nn.functional.conv2d(values, weight, bias, padding=1).relu()
            number += 2
        total += _compared(values, linear[f"lin{stage}.model.1.weight"])
        values, number = torch.nn.functional.max_pool2d(values, 2), number + 1
    return total


def test_it_is_what_it_is_defined_as(lpips_weights, monkeypatch):
    path, vgg, linear = lpips_weights
    monkeypatch.setenv("ICO3D_MODELS", str(path))
    rng = np.random.default_rng(1)
    a, b = rng.random((2, 32, 40, 3)).astype(np.float32)
    assert room.lpips(a, b) == pytest.approx(_by_definition(a, b, vgg, linear), rel=1e-4)
    assert room.lpips(a, a) == 0


def test_alexnet_is_what_it_is_defined_as(tmp_path, monkeypatch):
    features, linear = write_alexnet(tmp_path)
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    a, b = np.random.default_rng(2).random((2, 70, 64, 3)).astype(np.float32)
    values, expected = _scaled(a, b), 0.0
    for stage, (number, _, _, _, options) in enumerate(ALEXNET):
        weight, bias = (features[f"features.{number}.{kind}"] for kind in ("weight", "bias"))
        values = torch.nn.functional.conv2d(values, weight, bias, **options).relu()
        expected += _compared(values, linear[f"lin{stage}.model.1.weight"])
        if stage < 2:
            values = torch.nn.functional.max_pool2d(values, 3, 2)
    assert room.lpips(a, b, "alex") == pytest.approx(expected, rel=1e-4)
    assert room.lpips(a, a, "alex") == 0
    assert room.lpips(a[:31], b[:31], "alex") is None


def test_a_file_of_something_else_is_refused(lpips_weights, tmp_path, monkeypatch):
    _, vgg, linear = lpips_weights
    save_file({k: v for k, v in vgg.items() if "28" not in k}, tmp_path / "vgg16.safetensors")
    save_file(linear, tmp_path / "lpips_vgg.safetensors")
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    with pytest.raises(ModelError, match="weights of LPIPS"):
        room.lpips(np.zeros((32, 32, 3)), np.zeros((32, 32, 3)))


def test_without_weights_it_is_not_measured_and_says_so_once(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    with caplog.at_level(logging.WARNING):
        values = [room.lpips(np.zeros((32, 32, 3)), np.zeros((32, 32, 3))) for _ in range(3)]
    assert values == [None] * 3
    assert [record.levelname for record in caplog.records] == ["WARNING"]
