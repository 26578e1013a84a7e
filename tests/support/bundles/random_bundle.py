"""A small bundle in the real format: an ellipsoid of random look, for tests and first trials.

Run: python tests/bundle/random_bundle.py OUT.ico3d --gaussians 4000
"""

import argparse
import io
from pathlib import Path

import numpy as np
from PIL import Image

from ico3d.bundle.format import write_bundle
from ico3d.bundle.head import BakedHead, BakedShoulders, poses_to_bytes
from ico3d.bundle.manifest import (
    CameraInfo,
    HeadInfo,
    Loss,
    Manifest,
    Persona,
    Provenance,
    SpeechInfo,
)
from ico3d.common.expression import MOVE_HIDDEN

EXPRESSION_SIZE, EYE_OFFSET, FPS, NUM_POSES = 39, 32, 25.0, 50


def random_head(num_gaussians: int, rank: int = 16, hidden: int = 128, seed: int = 0) -> BakedHead:
    """A head-sized ellipsoid around the origin that looks along +z; basis vector 0 darkens a
    mouth, basis vector 1 the eyes, the others tint at random. Its lower half moves up and down,
    its front to the sides."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(num_gaussians, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    means = (directions * (0.08, 0.11, 0.09)).astype(np.float32)
    quats = rng.normal(size=(num_gaussians, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    size = 0.11 * np.sqrt(4 / num_gaussians)
    scales = np.log(rng.uniform(0.5, 1.0, (num_gaussians, 3)) * size)
    mean_logits = rng.normal((1.0, 0.3, 0.0, 3.0), 0.3, (num_gaussians, 4))
    basis = rng.integers(-12, 13, (rank, num_gaussians, 4)).astype(np.int8)
    basis[:, :, 3] = 0
    basis[:2, :, :] = 0
    basis[0, near(directions, (0, -0.35, 0.93), 0.25), :3] = -120
    for side in (-0.35, 0.35):
        basis[min(1, rank - 1), near(directions, (side, 0.2, 0.91), 0.18), :3] = -120
    moves = np.zeros((2, num_gaussians, 3), np.int8)
    moves[0, :, 1] = 127 * np.clip(-directions[:, 1], 0, 1)
    moves[1, :, 0] = 127 * np.clip(directions[:, 2], 0, 1)
    return BakedHead(
        means=means,
        quats=quats.astype(np.float16),
        scales=scales.astype(np.float16),
        mean_logits=mean_logits.astype(np.float16),
        basis=basis,
        basis_scale=np.full(num_gaussians, 0.02, np.float32),
        displacement_basis=moves,
        **_move_network(np.random.default_rng([seed, 1])),
        w1=rng.normal(0, 0.5, (EXPRESSION_SIZE, hidden)).astype(np.float32),
        b1=rng.normal(0, 0.5, hidden).astype(np.float32),
        w2=rng.normal(0, 0.3, (hidden, rank)).astype(np.float32),
        b2=np.zeros(rank, np.float32),
    )


def _move_network(rng: np.random.Generator) -> dict[str, np.ndarray]:
    layers = {
        "displacement_w1": rng.normal(0, 0.2, (EXPRESSION_SIZE, MOVE_HIDDEN)),
        "displacement_b1": rng.normal(0, 0.2, MOVE_HIDDEN),
        "displacement_w2": rng.normal(0, 8e-6, (MOVE_HIDDEN, 2)),
        "displacement_b2": rng.normal(0, 8e-6, 2),
    }
    return {name: values.astype(np.float32) for name, values in layers.items()}


def near(directions: np.ndarray, centre: tuple[float, float, float], radius: float) -> np.ndarray:
    return np.linalg.norm(directions - np.array(centre), axis=1) < radius


def swaying_poses(count: int) -> np.ndarray:
    """(count, 4, 4): the head turns by up to 5 degrees."""
    poses = np.tile(np.eye(4, dtype=np.float32), (count, 1, 1))
    angles = np.deg2rad(5) * np.sin(np.linspace(0, np.pi, count))
    poses[:, 0, 0] = poses[:, 2, 2] = np.cos(angles)
    poses[:, 0, 2], poses[:, 2, 0] = np.sin(angles), -np.sin(angles)
    return poses


def still_shoulders(head: BakedHead, count: int) -> BakedShoulders:
    """The lower half of the head stays behind, turned and moved, in each of `count` poses."""
    share = np.clip(-head.means[:, 1] / 0.06, 0, 1)  # (N,)
    places = np.tile(np.eye(4, dtype=np.float32), (count, 1, 1))
    places[:, :3, :3] = [[0.96, -0.28, 0], [0.28, 0.96, 0], [0, 0, 1]]
    places[:, :3, 3] = 0.02, -0.01, 0.01
    return BakedShoulders(np.uint8(255 * share), places)


def speech_graph(seed: int = 0) -> bytes:
    """mel (T, 80, 16) → expression (T, 32) by one random linear layer over each window."""
    from onnx import TensorProto, checker, helper, numpy_helper

    rng = np.random.default_rng(seed)
    weights = rng.normal(0, 1e-2, (80 * 16, 32)).astype(np.float32)
    graph = helper.make_graph(
        [
            helper.make_node("Flatten", ["mel"], ["flat"], axis=1),
            helper.make_node("MatMul", ["flat", "weights"], ["linear"]),
            helper.make_node("Tanh", ["linear"], ["expression"]),
        ],
        "speech",
        [helper.make_tensor_value_info("mel", TensorProto.FLOAT, ["T", 80, 16])],
        [helper.make_tensor_value_info("expression", TensorProto.FLOAT, ["T", 32])],
        [numpy_helper.from_array(weights, "weights")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    checker.check_model(model)
    return model.SerializeToString()


def thumbnail() -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (32, 32), (150, 120, 110)).save(buffer, "PNG")
    return buffer.getvalue()


def random_manifest(head: BakedHead) -> Manifest:
    return Manifest(
        name="random",
        head=HeadInfo(
            num_gaussians=head.num_gaussians,
            rank=head.rank,
            hidden=head.hidden,
            inputs="speech",
            expression_size=EXPRESSION_SIZE,
            eye_offset=EYE_OFFSET,
            expression_names=(),
            fps=FPS,
            num_poses=NUM_POSES,
            idle_expression=(0.0,) * EXPRESSION_SIZE,
            num_displacements=head.num_displacements,
        ),
        body=None,
        speech=SpeechInfo(encoder="builtin", sha256="0" * 64, fps=25.0, input="mel"),
        camera=CameraInfo((0.0, 0.0, 0.8), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 24.0),
        background=(0.85, 0.87, 0.9),
        persona=Persona(
            "Random", "Hello, I am a random ellipsoid.", ("who are you | name => I am Random.",)
        ),
        loss=Loss(None, None, None),
        provenance=Provenance("random", ("random numbers",), "none needed", "CC0-1.0"),
    )


def random_files(head: BakedHead) -> dict[str, bytes]:
    return {
        "head.safetensors": head.to_bytes(),
        "head_poses.safetensors": poses_to_bytes(swaying_poses(NUM_POSES)),
        "speech.onnx": speech_graph(),
        "thumbnail.png": thumbnail(),
        "LICENSES.txt": b"Random numbers need no licence.\n",
    }


def write_random_bundle(path: Path | str, num_gaussians: int = 400, seed: int = 0) -> Manifest:
    """Writes the bundle; returns its manifest."""
    head = random_head(num_gaussians, seed=seed)
    return write_bundle(path, random_manifest(head), random_files(head))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--gaussians", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    write_random_bundle(arguments.out, arguments.gaussians, arguments.seed)
    print(f"wrote {arguments.out}")
