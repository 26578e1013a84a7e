"""A few random Gaussians, and deformations of a handy size."""

import torch

from ico3d.body.motion.deformation import Deformation
from ico3d.body.motion.encoder import EncoderShape
from ico3d.body.motion.tunable import MlpShape

ENCODED = Deformation(
    (0.0, 1.0, 0.0), (1.0, 1.0, 0.5), MlpShape(8, 6, 2), EncoderShape((4,), 3, 8), 0
)
POSITIONAL = Deformation((0.0, 1.0, 0.0), (1.0, 1.0, 0.5), MlpShape(52, 6, 4, sets=3), None, 6)


def canonical(count: int = 5) -> dict[str, torch.Tensor]:
    """Random stored tensors."""
    generator = torch.Generator().manual_seed(0)
    sizes = {"means": (3,), "quats": (4,), "log_scales": (3,), "opacity_logits": ()}
    sizes |= {"color_logits": (3,)}
    return {n: torch.randn(count, *s, generator=generator) for n, s in sizes.items()}
