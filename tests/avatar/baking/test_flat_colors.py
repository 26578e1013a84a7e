"""Colours of degree 0 in the place of those that depend on the view."""

import numpy as np
import pytest
import torch

from ico3d.avatar.baking.command import _flat_body
from ico3d.avatar.baking.flat import cost
from ico3d.avatar.baking.flat.colors import flat_body, flat_head, mean_harmonics
from ico3d.avatar.baking.head_cost import references
from ico3d.body.model_folder import TrainedBody
from ico3d.body.motion.formulas import Still
from ico3d.body.motion.window_model import HARMONICS, WindowModel
from ico3d.body.planning.windows import Window
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.splat import harmonics
from ico3d.splat.render import render
from support.bodies.moving_capture import FRAMES, MovingCapture
from support.heads.offset_head import OffsetHead, offset_head
from support.heads.shapes import head_shape


def _head(strength: float) -> TrainedHead:
    """A head of 40 Gaussians whose colours depend on the view by so much."""
    plain = offset_head()
    model = HeadModel(head_shape(2, "no-mlp", sh_degree=2), 40)
    model.means.data, model.log_scales.data = plain.model.means.data, plain.model.log_scales.data
    model.basis.data[:, :, :4] = plain.model.basis.data
    model.basis.data[:, :, 4:] = strength * torch.randn(3, 40, 24)
    return TrainedHead(model, "blendshapes", ("a", "b"), "", "", None, {})


def _body(capture, strength: float) -> TrainedBody:
    """What stands at the capture's points, with colours that depend on the view by so much."""
    points = torch.from_numpy(capture.world_points(0)).float()
    count = len(points)
    values = {
        "means": points,
        "quats": torch.tensor([1.0, 0, 0, 0]).repeat(count, 1),
        "log_scales": torch.full((count, 3), -3.8),
        "opacity_logits": torch.full((count,), 2.0),
        "color_logits": torch.zeros(count, 3),
        HARMONICS: strength * torch.randn(count, 15, 3),
    }
    model = WindowModel(Still(), values, {})
    return TrainedBody([model], (Window(0, FRAMES - 1),), capture.fps, "static", {})


def test_means_are_those_of_the_cameras_that_see(tmp_path):
    """By how much each sees: a slow sum over cameras and Gaussians."""
    capture = MovingCapture(tmp_path)
    gaussians = _body(capture, 0.1).models[0].at(0.0)[::12]
    cameras = capture.cameras[:3]
    found = mean_harmonics((gaussians, camera) for camera in cameras)
    weights, total = torch.zeros(len(gaussians)), torch.zeros(len(gaussians), 15)
    for camera in cameras:
        one = torch.zeros(len(gaussians), 3, requires_grad=True)
        picture = render(gaussians.painted(one), [camera]).rgb[..., 0].sum()
        (given,) = torch.autograd.grad(picture, one)
        for n in range(len(gaussians)):
            way = gaussians.means[n].numpy() - camera.camera_to_world[:3, 3]
            unit = torch.from_numpy(way / np.linalg.norm(way)).float()
            weights[n] += given[n, 0]
            total[n] += given[n, 0] * harmonics.basis(unit, 3)[1:]
    seen = weights > 1e-6
    assert int(seen.sum()) > 10
    torch.testing.assert_close(found[seen], total[seen] / weights[seen, None], rtol=0, atol=1e-4)


def test_one_camera_sees_the_same_body(tmp_path):
    """A mean over one view is that view; from elsewhere the body looks otherwise."""
    capture = MovingCapture(tmp_path)
    body = _body(capture, 0.05)
    flat = flat_body(body, capture.cameras[:1])
    assert HARMONICS in body.models[0].gaussians and HARMONICS not in flat.models[0].gaussians
    for camera, same in ((capture.cameras[0], True), (capture.cameras[3], False)):
        exact, ours = (
            render(one.window_gaussians(0, 0.4), [camera]).rgb.detach() for one in (body, flat)
        )
        assert ((exact - ours).abs().max() < 2e-3) == same


def test_what_a_body_loses_is_reported(tmp_path):
    """In dB, with and without its recording; one without harmonics stays as it is."""
    capture, lines = MovingCapture(tmp_path), []
    _flat_body(_body(capture, 0.05), capture, lines.append)
    flat = _flat_body(_body(capture, 0.05), None, lines.append)
    assert "dB lost" in lines[0] and "dB lost" not in lines[1]
    assert all("dB baked against exact" in line for line in lines)
    assert _flat_body(flat, capture, lines.append) is flat and len(lines) == 2


@pytest.mark.parametrize("strength", [0.0, 0.2])
def test_what_a_head_loses(strength, tmp_path):
    """Nothing if its colours do not differ between views, much if they do."""
    torch.manual_seed(1)
    head = _head(strength)
    capture = OffsetHead(tmp_path, head)
    expressions = [torch.rand(2) for _ in range(3)]
    flat = flat_head(head, capture, expressions)
    assert flat.model.logits(expressions[0]).shape == (40, 4)
    assert flat.model(expressions[0]).colors.shape == (40, 3)
    loss = cost.head_loss(flat, references(head, capture, (0.5, 0.5, 0.5), 4))
    assert (loss.psnr_baked_vs_exact > 60) == (strength == 0)
    again = offset_head()
    assert flat_head(again, capture, expressions) is again
