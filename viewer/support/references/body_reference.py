"""A body that swings its arms, as a bundle, and what Python makes of it: truth for the page.

Run: python body_reference.py OUT [--gaussians N] [--times S,S,…] [--pictures WxH]

Writes OUT/body.ico3d, OUT/bundle/ (its files), OUT/reference.json (per time: window, τ,
coefficients), OUT/splats.f32 (per time: N of the window × (x, y, z, r, g, b, opacity)) and, if
asked, OUT/pictures.u8 (T, H, W, 3).
"""

import argparse
import json
from pathlib import Path

import numpy as np

from ico3d.avatar.baking import body_bundle
from ico3d.avatar.baking.body_bundle import WindowResult
from ico3d.avatar.baking.shader_body import Shape, WindowBaker
from ico3d.avatar.render_bundle import body_gaussians, render_body, visitor_camera
from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import Loss, Persona
from ico3d.bundle.windows.info import window_file
from support.avatars.moving_body import FPS, MovingPerson
from support.avatars.origins import about, origin

BORDERS, SHAPE = (0, 15, 30, 45), Shape(8, (7, 5, 2))


def write_body(path: Path, count: int) -> None:
    """Three windows of a second, each with its own order and number of Gaussians."""
    person = MovingPerson(count, BORDERS)
    # Some barely seen: neighbours must be alike at the shared frame, but not in size.
    person.orders = [order[: len(order) - 10 * i] for i, order in enumerate(person.orders)]
    person.opacities[np.concatenate([person.orders[0][len(o) :] for o in person.orders])] = 0.02
    results = []
    for i, span in enumerate(person.windows):
        window = WindowBaker(person, i).baked(SHAPE)
        seconds = (span.last - span.first) / FPS
        data = window.to_bytes(window_file(i))
        results.append(WindowResult(window, data, seconds, Loss(None, None, None)))
    parts = body_bundle.parts_of(results, person)
    body_bundle.write(path, parts, None, about(Persona("Swinger"), origin("computed")))


def reference_of(bundle: Bundle, seconds: float) -> dict:
    """The window of a time and its coefficients."""
    body = bundle.manifest.body
    assert body is not None
    frame = seconds * body.fps
    index = next(i for i, window in enumerate(body.windows) if frame <= window.last + 1e-9)
    window = body.windows[index]
    tau = (frame - window.first) / (window.last - window.first)
    coefficients = bundle.window(index).coefficients_at(tau).ravel().tolist()
    return {"time": seconds, "window": index, "tau": tau, "coefficients": coefficients}


def main() -> None:
    """Does what the file's docstring says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--gaussians", type=int, default=1500)
    parser.add_argument("--times", default="")
    parser.add_argument("--pictures", help="WxH")
    arguments = parser.parse_args()
    out = arguments.out
    write_body(out / "body.ico3d", arguments.gaussians)
    bundle = Bundle.open(out / "body.ico3d")
    for name in bundle.names:
        (out / "bundle" / name).parent.mkdir(parents=True, exist_ok=True)
        (out / "bundle" / name).write_bytes(bundle.read(name))
    times = [float(time) for time in arguments.times.split(",") if time]
    references = [reference_of(bundle, time) for time in times]
    (out / "reference.json").write_text(json.dumps(references))
    with (out / "splats.f32").open("wb") as file:
        for time in times:
            g = body_gaussians(bundle, time)
            rows = np.hstack([g.means, g.colors, g.opacities[:, None]])  # (N, 7)
            rows.astype(np.float32).tofile(file)
    if arguments.pictures:
        width, height = map(int, arguments.pictures.split("x"))
        camera = visitor_camera(bundle.manifest.camera, width, height)
        pictures = np.stack([render_body(bundle, time, camera) for time in times])
        np.uint8(np.round(pictures.clip(0, 1) * 255)).tofile(out / "pictures.u8")


if __name__ == "__main__":
    main()
