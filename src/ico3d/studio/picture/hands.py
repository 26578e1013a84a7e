"""Hands: the lines of palms and fingers, nails, and where blood shows through the skin.

Lines lie on the surface as short segments, and a spot of skin knows its distance from them: they
are as fine as a picture can show, whatever the mesh.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ico3d.splat.cpu.compile import subroutine
from ico3d.studio.person.skeleton import Skeleton
from ico3d.studio.person.subject import Material, Subject
from ico3d.studio.person.traits.beard import bump
from ico3d.studio.picture.textures import smoothstep

SIDES = ("L", "R")
HAND = ("wrist", "metacarpal", "finger")
"""Joints that carry a hand."""
REACH = 0.03
"""Largest distance in metres of the skin from a joint or the palm's middle plane."""
PALM = (
    ((1.14, 0.80), (0.88, 0.85), (0.55, 0.90), (0.26, 1.06)),
    ((-0.20, 0.84), (0.10, 0.83), (0.50, 0.72), (0.86, 0.54)),
    ((-0.22, 0.81), (0.05, 0.68), (0.20, 0.45), (0.17, 0.16)),
)
"""Lines of a palm: points across it, 0 at the index finger's knuckle and 1 at the little finger's,
and along it, 0 at the wrist and 1 at the middle finger's knuckle."""
ALONG = 14
"""Segments of a line of the palm."""
AROUND = np.radians(np.linspace(-62.0, 62.0, 8))
"""Angles about a finger at which the points of a line across it lie."""
FOLDS = ((1, 0.44, 0.5), (2, 0.0, 0.6), (3, 0.0, 0.5))
"""Lines on the inner side of a finger: phalanx, share of the way along it, and depth."""
WRINKLES = ((2, -0.0030, 0.5), (2, 0.0, 0.7), (2, 0.0030, 0.5), (3, -0.0012, 0.4), (3, 0.0012, 0.4))
"""Lines on the back of a finger: phalanx, metres past its joint, and depth."""
FINE, BROAD = 0.0009, 0.0013
"""Half the width of a line across a finger or palm, and of a wrinkle of a knuckle, metres."""
NAIL = (0.0050, 0.0080, 0.0043)
"""Distance of a nail's two ends from the tip of a finger, and half of its width, metres."""
THICK, LONG, SLICE = 0.012, 0.04, 0.0025
"""Most metres from the axis of a finger's last phalanx to its skin, from its joint to its tip, and
half of the width of a slice whose middle is the finger's."""
FLUSH = ((0.009, 0.40), (0.008, 0.38), (0.013, 0.26))
"""Radius in metres and redness of finger tips, of knuckles, and of the balls of a palm."""
BALLS = ((0.02, 0.40), (0.88, 0.42), (0.30, 0.86), (0.80, 0.80))
"""Balls of a palm, given as points of its lines are."""


@dataclass(frozen=True)
class Hands:
    """What is on the skin of a person's hands.

    Attributes:
        share: (V,) how much a vertex belongs to a hand, 0 to 1.
        redness: (V,) how much blood shows at a vertex, 0 to 1.
        lines: (2, K, 8) float32 segments of the left hand and the right one: two ends (3 + 3) at
            rest, metres; half of the width, metres; depth, 0 to 1.
        nails: (2, 5, 7) float32 nails: two ends (3 + 3) at rest and half of the width, metres.
    """

    share: np.ndarray
    redness: np.ndarray
    lines: np.ndarray
    nails: np.ndarray


def hands_of(subject: Subject) -> Hands:
    """Finds the lines and nails of a person's hands; a bust has none."""
    bones, count = subject.skeleton, len(subject.vertices)
    if bones is None:
        none = np.zeros(count, np.float32)
        return Hands(none, none, np.zeros((2, 0, 8), np.float32), np.zeros((2, 0, 7), np.float32))
    share, redness, lines, nails = np.zeros(count), np.zeros(count), [], []
    for side in SIDES:
        columns = [i for i, n in enumerate(bones.names) if n.startswith(HAND) and n.endswith(side)]
        held = bones.weights[:, columns].sum(1)  # (V,)
        share += held
        hand = _Hand(subject, bones, side, held)
        lines.append(hand.lines())
        nails.append(hand.nails())
        for points, (radius, red) in zip(hand.flushed(), FLUSH, strict=True):
            for point in points[np.isfinite(points).all(1)]:
                redness += red * held * bump(subject.vertices, point, radius)
    return Hands(
        np.clip(share, 0, 1),
        np.clip(redness, 0, 1),
        np.stack(lines).astype(np.float32),
        np.stack(nails).astype(np.float32),
    )


class _Hand:
    """One hand at rest: its frame, and the surface about it."""

    def __init__(self, subject: Subject, bones: Skeleton, side: str, held: np.ndarray):
        skin = subject.faces[subject.materials == Material.SKIN]
        corners = subject.vertices[skin[(held[skin] > 0.5).all(1)]].astype(np.float64)
        self._corner, self._one = corners[:, 0], corners[:, 1] - corners[:, 0]
        self._two = corners[:, 2] - corners[:, 0]
        self._points = corners.reshape(-1, 3)
        self._joints = {
            (finger, n): bones.at[bones.index(f"finger{finger}-{n}.{side}")]
            for finger in range(1, 6)
            for n in (1, 2, 3)
        }
        self._wrist = bones.at[bones.index(f"wrist.{side}")]
        across = self._joints[5, 1] - self._joints[2, 1]
        along = self._joints[3, 1] - self._wrist
        inner = np.cross(across, along) * (-1.0 if side == "R" else 1.0)
        self.inner = inner / np.linalg.norm(inner)

    def lines(self) -> np.ndarray:
        """(K, 8) segments of all lines."""
        found = [self._palm_line(np.array(line)) for line in PALM]
        for finger in range(1, 6):
            for phalanx, part, depth in FOLDS[finger == 1 :]:
                start, along = self._phalanx(finger, phalanx)
                at = start + part * along
                found.append(self._across(finger, at, along, self.inner, FINE, depth))
            for phalanx, past, depth in WRINKLES:
                start, along = self._phalanx(finger, phalanx)
                at = start + past * along / np.linalg.norm(along)
                found.append(self._across(finger, at, along, -self.inner, BROAD, depth))
        return np.concatenate(found)

    def nails(self) -> np.ndarray:
        """(5, 7) the nails of all fingers; zeros where a finger has no skin."""
        found = np.zeros((5, 7))
        for finger in range(1, 6):
            start, along = self._phalanx(finger, 3)
            along = along / np.linalg.norm(along)
            past = (self._points - start) @ along  # (P,)
            beside = np.linalg.norm(self._points - start - past[:, None] * along, axis=1)
            own = (beside < THICK) & (past < LONG)
            far = past[own].max(initial=0.0) - past  # (P,) from the tip
            slices = [own & (np.abs(far - end) < SLICE) for end in NAIL[:2]]
            if not all(part.any() for part in slices):
                continue
            middles = [self._points[part].mean(0) for part in slices]
            ends = self._surface(middles, self._facing(finger, along, -self.inner))
            if np.isfinite(ends).all():
                found[finger - 1] = [*ends.ravel(), NAIL[2]]
        return found

    def flushed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(≤ 5, 3) tips, (8, 3) knuckles and (4, 3) balls of the palm, on the skin."""
        nails = self.nails()
        tips = nails[nails[:, 6] > 0, 3:6]
        knuckles = [self._joints[finger, n] for finger in range(2, 6) for n in (1, 2)]
        balls = [self._at(*place) for place in BALLS]
        return tips, self._surface(knuckles, -self.inner), self._surface(balls, self.inner)

    def _at(self, across: float, along: float) -> np.ndarray:
        """(3,) a place in the middle of the palm."""
        start, end = self._joints[2, 1], self._joints[5, 1]
        knuckles = start + across * (end - start)
        return (
            self._wrist
            + along * (knuckles - self._wrist)
            + (1 - along) * 0.35 * (knuckles - 0.5 * (start + end))
        )

    def _phalanx(self, finger: int, n: int) -> tuple[np.ndarray, np.ndarray]:
        """(3,) where a phalanx begins, and (3,) its length and direction."""
        first, last = (n, n + 1) if n < 3 else (2, 3)
        along = self._joints[finger, last] - self._joints[finger, first]
        return self._joints[finger, n], along

    def _facing(self, finger: int, along: np.ndarray, out: np.ndarray) -> np.ndarray:
        """(3,) unit vector across a finger's unit direction; thumbs face the other fingers."""
        if finger == 1:
            over = self._joints[5, 1] - self._joints[1, 2]
            out = np.sign(out @ self.inner) * (self.inner + over / np.linalg.norm(over))
        out = out - (out @ along) * along
        return out / np.linalg.norm(out)

    def _palm_line(self, places: np.ndarray) -> np.ndarray:
        """(ALONG, 8) segments of a smooth line through places (P, 2) of the palm."""
        spline = CubicSpline(np.linspace(0, 1, len(places)), places)
        points = [self._at(*place) for place in spline(np.linspace(0, 1, ALONG + 1))]
        return _segments(self._surface(points, self.inner), FINE, 0.75)

    def _across(
        self,
        finger: int,
        at: np.ndarray,
        along: np.ndarray,
        out: np.ndarray,
        width: float,
        depth: float,
    ) -> np.ndarray:
        """Segments of a line over one side of a finger at a place (3,) within it."""
        along = along / np.linalg.norm(along)
        out = self._facing(finger, along, out)
        aside = np.cross(along, out)
        rays = [np.cos(a) * out + np.sin(a) * aside for a in AROUND]
        points = np.concatenate([self._surface([at], ray) for ray in rays])
        return _segments(points, width, depth)

    def _surface(self, points: list[np.ndarray], out: np.ndarray) -> np.ndarray:
        """(P, 3) where the skin lies, seen from points within the hand; NaN where it does not."""
        # Möller and Trumbore, "Fast, minimum storage ray/triangle intersection" (1997).
        h = np.cross(out, self._two)  # (F, 3)
        slope = (self._one * h).sum(1)
        slope = np.where(np.abs(slope) < 1e-15, np.inf, slope)
        found = []
        for point in points:
            s = point - self._corner  # (F, 3)
            q = np.cross(s, self._one)
            u, v = (s * h).sum(1) / slope, (q @ out) / slope
            away = (q * self._two).sum(1) / slope
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (away > 0) & (away < REACH)
            nearest = away[hit].min() if hit.any() else np.nan
            found.append(point + nearest * out)
        return np.array(found)


def _segments(points: np.ndarray, width: float, depth: float) -> np.ndarray:
    """(K, 8) segments between neighbours of points (P, 3), shallow towards the ends of the line."""
    ends = np.concatenate([points[:-1], points[1:]], 1)  # (P - 1, 6)
    middle = (np.arange(len(ends)) + 0.5) / len(ends)
    fading = np.minimum(1, 4 * np.minimum(middle, 1 - middle))
    rows = np.column_stack([ends, np.full(len(ends), width), depth * fading])
    return np.where(np.isfinite(rows).all(1, keepdims=True), rows, 0.0)


@subroutine()
def line_depth(lines, x, y, z, pixel):
    """Depth, 0 to 1, of the deepest of lines (K, 8) at a place; wider ones where pixels are."""
    deepest = 0.0
    for k in range(lines.shape[0]):
        if lines[k, 7] <= deepest:
            continue
        width = max(lines[k, 6], 0.6 * pixel)
        away = _square_from(lines, k, x, y, z) / (width * width)
        if away < 9.0:
            depth = lines[k, 7] * lines[k, 6] / width * math.exp(-0.5 * away)
            deepest = max(deepest, depth)
    return deepest


@subroutine()
def nail_share(nails, x, y, z, pixel):
    """How much a place is of one of the nails (5, 7), 0 to 1, and how far it is from the middle."""
    for k in range(nails.shape[0]):
        if nails[k, 6] == 0.0:
            continue
        away = math.sqrt(_square_from(nails, k, x, y, z)) / nails[k, 6]
        edge = min(0.3, 0.5 * pixel / nails[k, 6])
        if away < 1.0 + edge:
            return 1.0 - smoothstep(1.0 - edge, 1.0 + edge, away), away
    return 0.0, 1.0


@subroutine()
def _square_from(rows, k, x, y, z):
    """Square of the distance in metres from the segment that row k begins with."""
    ax, ay, az = rows[k, 0], rows[k, 1], rows[k, 2]
    dx, dy, dz = rows[k, 3] - ax, rows[k, 4] - ay, rows[k, 5] - az
    px, py, pz = x - ax, y - ay, z - az
    part = (px * dx + py * dy + pz * dz) / max(1e-12, dx * dx + dy * dy + dz * dz)
    part = min(1.0, max(0.0, part))
    px, py, pz = px - part * dx, py - part * dy, pz - part * dz
    return px * px + py * py + pz * pz
