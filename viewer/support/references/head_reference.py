"""What Python makes of a bundle: the truth that the page is tested against.

Run: python head_reference.py OUT [--bundle FILE] [--gaussians N] [--pictures WxH] [--shoulders]

Writes OUT/bundle/ (the bundle's files), OUT/reference.json (expressions and coefficients),
OUT/attributes.f32 (E, N, 4: r, g, b, opacity) and, if asked, OUT/pictures.u8 (E, H, W, 3).
"""

import argparse
import json
from pathlib import Path

import numpy as np

from ico3d.bundle import evaluate
from ico3d.bundle.format import Bundle, add_files
from ico3d.bundle.head import SHOULDERS
from support.bundles.random_bundle import still_shoulders, write_random_bundle

NUM_EXPRESSIONS = 5


def expressions_of(bundle: Bundle) -> np.ndarray:
    """(E, B): the idle face, closed eyes, and random ones."""
    info = bundle.manifest.head
    rows = np.tile(np.float32(info.idle_expression), (NUM_EXPRESSIONS, 1))  # (E, B)
    if info.eye_offset is not None:
        rows[1, info.eye_offset + 5 : info.eye_offset + 7] = 1
    rows[2:] += np.random.default_rng(1).normal(0, 0.5, rows[2:].shape).astype(np.float32)
    return rows


def pictures_of(bundle: Bundle, rows: np.ndarray, width: int, height: int) -> np.ndarray:
    """(E, H, W, 3) uint8 seen from the bundle's camera, with the head in its first pose."""
    from ico3d.avatar.render_bundle import render_bundle, visitor_camera

    camera = visitor_camera(bundle.manifest.camera, width, height)
    pictures = np.stack([render_bundle(bundle, row, camera) for row in rows])
    return np.uint8(np.round(pictures.clip(0, 1) * 255))


def main() -> None:
    """Does what the file's docstring says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--bundle", type=Path)
    parser.add_argument("--gaussians", type=int, default=4000)
    parser.add_argument("--pictures", help="WxH")
    parser.add_argument("--shoulders", action="store_true", help="which stay behind")
    arguments = parser.parse_args()
    out = arguments.out
    path = arguments.bundle or out / "random.ico3d"
    (out / "bundle").mkdir(parents=True, exist_ok=True)
    if arguments.bundle is None:
        manifest = write_random_bundle(path, arguments.gaussians)
        if arguments.shoulders:
            head = Bundle.open(path).require_head()[0]
            still = still_shoulders(head, manifest.head.num_poses)
            add_files(path, {SHOULDERS: still.to_bytes()})
    bundle = Bundle.open(path)
    for name in bundle.names:
        (out / "bundle" / name).write_bytes(bundle.read(name))
    rows = expressions_of(bundle)
    attributes = [np.column_stack(evaluate.attributes(bundle.head, e)) for e in rows]  # E × (N, 4)
    np.float32(attributes).tofile(out / "attributes.f32")
    coefficients = evaluate.coefficients(bundle.head, rows)
    reference = {"expressions": rows.tolist(), "coefficients": coefficients.tolist()}
    (out / "reference.json").write_text(json.dumps(reference))
    if arguments.pictures:
        width, height = map(int, arguments.pictures.split("x"))
        pictures_of(bundle, rows, width, height).tofile(out / "pictures.u8")


if __name__ == "__main__":
    main()
