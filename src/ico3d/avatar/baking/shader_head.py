"""Bakes an exact head into a linear basis for a shader (docs/bundle.md, head.safetensors)."""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial import KDTree

from ico3d.avatar.baking.lowrank import LowRank, factorise
from ico3d.avatar.baking.quantise import in_units, quantise
from ico3d.bundle.head import BakedHead, no_displacements
from ico3d.capture.face.region import BROWS, EYES, MOUTH
from ico3d.common.spread import spread
from ico3d.errors import BundleError
from ico3d.head.blending.distil import CoefficientNetwork, augmented, distil
from ico3d.head.model import HeadModel
from ico3d.splat.convention import MIN_ALPHA

CLIP = 8.0
"""Logits are clipped to ±8: beyond, their sigmoids differ by less than 1/2,980."""


ATTENTION, NEAR = 7.0, 0.006
"""By how much more brows, eyes and lips are looked at, and the metres about their landmarks."""


@dataclass(frozen=True)
class BakeSettings:
    """How a head is baked.

    Attributes:
        hidden: H, width of the coefficient network's hidden layer.
        max_frames: Most expressions that are used, spread evenly over the given ones.
        augmented: Number of expressions that are made up besides, for the coefficient network.
        steps: Optimisation steps of the coefficient network.
        seed: Seed of all randomness.
    """

    hidden: int = 128
    max_frames: int = 1000
    augmented: int = 1500
    steps: int = 2500
    seed: int = 0


class HeadBaker:
    """Bakes one head with any rank; samples, components and network are computed once."""

    def __init__(
        self,
        model: HeadModel,
        expressions: np.ndarray,
        importance: np.ndarray,
        rank: int,
        settings: BakeSettings = BakeSettings(),
        landmarks: np.ndarray | None = None,
    ):
        """Samples the model and fits its principal components and coefficient network.

        Args:
            model: The exact head.
            expressions: (T, B) expressions in which the baked head has to look right.
            importance: (N, 4) how much an error in each logit matters.
            rank: Largest rank that `baked` will be asked for.
            settings: Settings of the fit.
            landmarks: (68, 3) landmarks of the face, by whose features people are recognised: the
                Gaussians there come earlier than by their importance.

        Raises:
            BundleError: If no Gaussian is ever opaque enough to be drawn.
        """
        chosen = expressions[spread(len(expressions), settings.max_frames)]
        samples = sample_logits(model, chosen)  # (T, N, 4)
        seen = (samples[:, :, 3] > np.log(MIN_ALPHA / (1 - MIN_ALPHA))).any(axis=0)  # (N,)
        looked_at = importance.sum(axis=1) * _attention(model, landmarks)  # (N,)
        order = np.argsort(-looked_at, kind="stable")  # (N,)
        self._kept = order[seen[order]]  # (N',) indices, those that matter most first
        if len(self._kept) == 0:
            raise BundleError("the head has no Gaussian that is ever seen: train it again.")
        self._model, self._weights = model, importance[self._kept]
        flat = _flat(samples[:, self._kept])
        self._factors: LowRank = factorise(flat, self._weights.reshape(-1), rank)
        self._network = self._fit(chosen, settings)

    def baked(self, rank: int) -> BakedHead:
        """The baked head with the first `rank` components, its Gaussians by importance."""
        count = len(self._kept)
        basis = self._factors.basis[:rank].reshape(rank, count, 4)  # (K, N, 4)
        sizes = np.sqrt(np.square(self._factors.scores[:, :rank]).mean(axis=0))  # (K,)
        rounded = quantise(basis, sizes, self._weights)
        network = self._network
        return BakedHead(
            **_geometry(self._model, self._kept),
            **_displacements(self._model, self._kept),
            mean_logits=self._factors.mean.reshape(count, 4).astype(np.float16),
            basis=rounded.values,
            basis_scale=rounded.scale,
            w1=network.w1,
            b1=network.b1,
            w2=network.w2[:, :rank] * rounded.gains,
            b2=network.b2[:rank] * rounded.gains,
        )

    def _fit(self, recorded: np.ndarray, settings: BakeSettings) -> CoefficientNetwork:
        """Fits the coefficient network to scores of recorded and of made-up expressions."""
        rng = np.random.default_rng(settings.seed)
        made = augmented(recorded, settings.augmented, rng)
        scores = [self._factors.scores]
        for part in np.array_split(made, max(1, len(made) // 100)):
            logits = sample_logits(self._model, part)[:, self._kept]
            scores.append(self._factors.project(_flat(logits)))
        inputs = np.concatenate([recorded, made])  # (T + A, B)
        targets = np.concatenate(scores)  # (T + A, K)
        return distil(inputs, targets, settings.hidden, settings.steps, settings.seed)


def _attention(model: HeadModel, landmarks: np.ndarray | None) -> np.ndarray:
    """(N,) how much more a Gaussian is looked at than one of the same importance elsewhere."""
    if landmarks is None:
        return np.ones(len(model))
    features = KDTree(np.concatenate([landmarks[BROWS], landmarks[EYES], landmarks[MOUTH]]))
    away = features.query(model.means.detach().cpu().numpy())[0]  # (N,)
    return 1 + ATTENTION * np.exp(-0.5 * (away / NEAR) ** 2)


def sample_logits(model: HeadModel, expressions: np.ndarray) -> np.ndarray:
    """(T, N, 4) float16 logits of the exact head for expressions (T, B), clipped to ±8."""
    samples = np.empty((len(expressions), len(model), 4), np.float16)
    with torch.no_grad():
        for row, expression in zip(samples, expressions, strict=True):
            logits = model.logits(torch.from_numpy(np.asarray(expression, np.float32)))
            row[:] = logits.clamp(-CLIP, CLIP).cpu().numpy()
    return samples


def megabytes_per_10k(head: BakedHead) -> float:
    """Size of `head.safetensors` in MB for 10,000 Gaussians."""
    return len(head.to_bytes()) / head.num_gaussians * 1e4 / 1e6


def _geometry(model: HeadModel, kept: np.ndarray) -> dict[str, np.ndarray]:
    means, quats, log_scales = (
        parameter.detach().cpu().numpy()[kept]
        for parameter in (model.means, model.quats, model.log_scales)
    )
    quats = quats / np.maximum(np.linalg.norm(quats, axis=1, keepdims=True), 1e-12)
    return {
        "means": np.ascontiguousarray(means, np.float32),
        "quats": quats.astype(np.float16),
        "scales": log_scales.astype(np.float16),
    }


def _displacements(model: HeadModel, kept: np.ndarray) -> dict[str, np.ndarray]:
    """Displacements in 8-bit numbers, with the size of a unit in the network's last layer."""
    if not model.shape.displacements:
        return no_displacements(len(kept), model.shape.expression_size)
    basis = model.displacement_basis.detach().cpu().numpy()[:, kept]  # (M, N, 3)
    values, units = in_units(basis)
    w1, b1, w2, b2 = (part.cpu().numpy() for part in model.move_network)
    return {
        "displacement_basis": values,
        "displacement_w1": w1,
        "displacement_b1": b1,
        "displacement_w2": (w2 * units).astype(np.float32),
        "displacement_b2": (b2 * units).astype(np.float32),
    }


def _flat(samples: np.ndarray) -> np.ndarray:
    return samples.reshape(len(samples), -1)  # (T, N·4)
