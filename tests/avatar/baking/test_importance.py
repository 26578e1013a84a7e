"""The importance of logits against the exact Jacobian."""

import numpy as np
import torch

from ico3d.avatar.baking.importance import logit_importance
from ico3d.splat.render import render


def test_it_estimates_the_diagonal_of_the_squared_jacobian(blendshape_head):
    head, capture = blendshape_head
    camera = capture.cameras[1].resized(12, 12)
    expression, behind = torch.full((10,), 0.5), torch.tensor([0.3, 0.4, 0.5])
    estimate = logit_importance(head.model, expression.expand(300, -1), [camera] * 300, behind, 0)

    logits = head.model.logits(expression).detach().requires_grad_()
    shown = head.model.gaussians(logits, head.model.moves(expression))
    image = render(shown, [camera], behind).rgb.flatten()
    rows = [torch.autograd.grad(pixel, logits, retain_graph=True)[0] for pixel in image]
    exact = torch.stack(rows).square().sum(0).sqrt().numpy()  # (N, 4)
    exact /= exact.mean()
    seen = exact > 0.3
    assert seen.sum() > 50
    np.testing.assert_allclose(estimate[seen], exact[seen], rtol=0.25)
    assert abs(np.mean(estimate[seen] / exact[seen]) - 1) < 0.03


def test_what_is_never_seen_keeps_a_floor(blendshape_head):
    head, capture = blendshape_head
    away = capture.cameras[1].moved(np.diag([-1.0, 1.0, -1.0, 1.0]) * 1.0)
    away = away.moved(np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 50.0], [0, 0, 0, 1]]))
    importance = logit_importance(head.model, torch.zeros(1, 10), [away], torch.zeros(3), 0)
    assert (importance == np.float32(0.02)).all()
