"""How the shoulders of a head alone stand while it sways (docs/bundle.md)."""

from dataclasses import dataclass

import numpy as np

from ico3d.bundle.head import check_rigid
from ico3d.bundle.manifest import HeadInfo
from ico3d.bundle.tensors import Spec, decode_tensors, encode_tensors

SHOULDERS = "head_shoulders.safetensors"


@dataclass(frozen=True)
class BakedShoulders:
    """Where the shoulders are, and which Gaussians are theirs.

    Attributes:
        share: (N,) uint8 how much of the shoulders' movement each Gaussian of the head makes, 255
            for all of it.
        world_from_shoulders: (F, 4, 4) float32 rigid: where canonical head space is in each head
            pose for whatever moves with the shoulders.
    """

    share: np.ndarray
    world_from_shoulders: np.ndarray

    def to_bytes(self) -> bytes:
        """The content of `head_shoulders.safetensors`.

        Raises:
            BundleError: If shapes or dtypes do not fit, or a transform is not rigid.
        """
        check_rigid(self.world_from_shoulders, SHOULDERS)
        return encode_tensors(
            vars(self), _spec(len(self.share), len(self.world_from_shoulders)), SHOULDERS
        )

    @staticmethod
    def from_bytes(data: bytes, info: HeadInfo) -> "BakedShoulders":
        """Reads the file, and checks it against the manifest's counts.

        Raises:
            BundleError: If the file is malformed, or a transform is not rigid.
        """
        tensors = decode_tensors(data, _spec(info.num_gaussians, info.num_poses), SHOULDERS)
        check_rigid(tensors["world_from_shoulders"], SHOULDERS)
        return BakedShoulders(**tensors)


def _spec(n: int, f: int) -> Spec:
    return {"share": ("U8", (n,)), "world_from_shoulders": ("F32", (f, 4, 4))}
