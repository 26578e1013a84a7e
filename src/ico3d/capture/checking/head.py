"""Checks a capture's data of the head: poses, landmarks, expressions, points."""

from collections.abc import Iterator

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.finding import Finding

STEADY = (27, 28, 29, 30, 36, 39, 42, 45)
"""Landmarks that hardly move with the expression: bridge of the nose and corners of the eyes."""

MATTERS = 0.1
"""Pixels by which poses of another frame must fit better: a smaller shift in time blurs nothing."""
USUAL_FPS = 25.0
"""Usual frame rate; at lower rates, heads move farther from frame to frame."""


def _all_poses(capture: Capture) -> Iterator[tuple[int, np.ndarray]]:
    """Frames that have a head pose."""
    for frame in range(capture.num_frames):
        pose = capture.world_from_head(frame)
        if pose is not None:
            yield frame, pose


def poses(capture: Capture) -> Finding:
    """Checks that every head pose is rigid and lies in front of a camera."""
    number = 0
    for frame, pose in _all_poses(capture):
        number += 1
        if pose.shape != (4, 4) or not np.isfinite(pose).all():
            return Finding("poses", "error", f"frame {frame}: not a finite 4x4 matrix")
        turn = pose[:3, :3]
        if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-3 or np.linalg.det(turn) < 0:
            return Finding("poses", "error", f"frame {frame}: not a rotation")
        if len(capture.cameras) == 1 and capture.cameras[0].project(pose[:3, 3])[1] <= 0:
            return Finding("poses", "error", f"frame {frame}: the head is behind the camera")
    if not number:
        return Finding("poses", "warn", "no head poses")
    return Finding("poses", "ok", f"{number} of {capture.num_frames} frames")


def motion(capture: Capture) -> Finding:
    """Checks how abruptly the head moves, by second differences of neighbouring frames."""
    poses = dict(_all_poses(capture))
    turns, moves = [], []
    for frame, pose in poses.items():
        before, after = poses.get(frame - 1), poses.get(frame + 1)
        if before is None or after is None:
            continue
        moves.append(np.linalg.norm(before[:3, 3] - 2 * pose[:3, 3] + after[:3, 3]))
        turns.append(np.linalg.norm(before[:3, :3] - 2 * pose[:3, :3] + after[:3, :3]) / 2**0.5)
    if not turns:
        return Finding("motion", "warn", "no three neighbouring frames have a pose")
    text = (
        f"second differences: median {np.degrees(np.median(turns)):.2f}°, "
        f"{1e3 * np.median(moves):.2f} mm; largest {np.degrees(max(turns)):.1f}°, "
        f"{1e3 * max(moves):.1f} mm"
    )
    slower = max(1.0, (USUAL_FPS / capture.fps) ** 2)
    wild = np.median(turns) > np.radians(2) * slower or max(moves) > 0.1 * slower
    return Finding("motion", "warn" if wild else "ok", text)


def landmarks(capture: Capture) -> Finding:
    """Checks that steady landmarks are fixed to the head and poses not shifted in time."""
    errors = {shift: _rigid_errors(capture, shift) for shift in (0, -1, 1)}
    if not len(errors[0]):
        return Finding("landmarks", "warn", "no landmarks")
    medians = {s: float(np.median(e)) for s, e in errors.items() if len(e)}
    text = f"eye corners and nose bridge stay within {medians[0]:.2f} px of the pose (median)"
    best = min(medians, key=lambda shift: medians[shift])
    if best != 0 and medians[best] < min(0.6 * medians[0], medians[0] - MATTERS):
        text = f"poses fit the landmarks {best:+d} frame away ({medians[best]:.2f} px) better "
        return Finding("landmarks", "error", f"{text}than their own ({medians[0]:.2f} px)")
    size = _face_width(capture)
    if medians[0] > 0.05 * size:
        return Finding("landmarks", "error", f"{text}: they do not belong together")
    return Finding("landmarks", "warn" if medians[0] > 0.02 * size else "ok", text)


def _rigid_errors(capture: Capture, shift: int) -> np.ndarray:
    """Reprojection errors in pixels of steady landmarks, taken `shift` frames after the pose."""
    lenses, pixels = [], []
    for frame, pose in _all_poses(capture):
        if not 0 <= frame + shift < capture.num_frames:
            continue
        points = capture.landmarks(0, frame + shift)
        if points is not None:
            lens = capture.cameras[0].moved(pose)
            lenses.append(lens.intrinsics @ lens.world_to_camera[:3])
            pixels.append(points[list(STEADY)])
    if not lenses:
        return np.empty(0)
    matrices, seen = np.stack(lenses), np.stack(pixels)  # (F, 3, 4), (F, S, 2)
    found = [
        np.linalg.norm(_fixed_point_errors(matrices, p), axis=1) for p in np.moveaxis(seen, 1, 0)
    ]
    return np.concatenate(found)


def _fixed_point_errors(matrices: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(F, 2) pixels by which the best fixed point of the head misses where it is seen.

    Args:
        matrices: (F, 3, 4) pixels from canonical head space, homogeneous.
        pixels: (F, 2) where the point is seen.
    """
    # (m_01 - pixel * m_2) . (X, 1) = 0, divided by the depth of the head: pixels again.
    rows = (matrices[:, :2] - pixels[..., None] * matrices[:, 2:]) / matrices[
        :, 2:, 3:
    ]  # (F, 2, 4)
    system = rows.reshape(-1, 4)
    # Heads that hardly turn leave the depth open: 10 cm from the head's centre cost a pixel.
    tied = np.concatenate([system[:, :3], 10 * np.eye(3)])
    point = np.linalg.lstsq(tied, np.concatenate([-system[:, 3], np.zeros(3)]), rcond=None)[0]
    image = matrices @ np.append(point, 1.0)  # (F, 3)
    return image[:, :2] / image[:, 2:] - pixels


def _face_width(capture: Capture) -> float:
    """Pixels between the ends of the jaw line in the first frame that has landmarks."""
    for frame in range(capture.num_frames):
        points = capture.landmarks(0, frame)
        if points is not None:
            return float(np.linalg.norm(points[16] - points[0]))
    return 1.0


def expressions(capture: Capture) -> Finding:
    """Checks that blendshapes and eye values are finite, in range, and not constant."""
    shapes = [capture.blendshapes(f) for f in range(capture.num_frames)]
    eyes = [capture.eyes(f) for f in range(capture.num_frames)]
    parts = []
    for name, values in (("blendshapes", shapes), ("eyes", eyes)):
        known = [v for v in values if v is not None]
        if not known:
            continue
        table = np.stack(known)
        if not np.isfinite(table).all():
            return Finding("expressions", "error", f"{name} hold NaN")
        if table.min() < -0.01 or table.max() > 1.5:
            return Finding(
                "expressions", "warn", f"{name} reach {table.min():.2f} … {table.max():.2f}"
            )
        parts.append(f"{table.shape[1]} {name} in {len(known)} frames")
        if table.std(0).max() < 1e-3:
            return Finding("expressions", "warn", f"{name} never change")
    if not parts:
        return Finding("expressions", "warn", "neither blendshapes nor eyes")
    return Finding("expressions", "ok", ", ".join(parts))


def points(capture: Capture) -> Finding:
    """Checks the surface points from which Gaussians start."""
    found = capture.head_points() if capture.shows == "head" else capture.world_points()
    if found is None:
        return Finding("points", "warn", "no surface points")
    if found.ndim != 2 or found.shape[1] != 3 or not np.isfinite(found).all():
        return Finding("points", "error", f"expected finite (P, 3), got {found.shape}")
    size = np.ptp(found, axis=0)
    text = f"{len(found)} points in {size[0]:.2f} x {size[1]:.2f} x {size[2]:.2f} m"
    return Finding("points", "warn" if not 0.1 < size.max() < 4 else "ok", text)
