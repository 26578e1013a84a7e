"""What is painted on a person once: flush, freckles, beard, and ambient occlusion."""

from dataclasses import dataclass

import numpy as np

from ico3d.studio.person.growing.skull import skull_of
from ico3d.studio.person.hair import strand_frames
from ico3d.studio.person.subject import Subject
from ico3d.studio.person.traits.beard import beard_share, bump
from ico3d.studio.picture.hands import Hands, hands_of
from ico3d.studio.picture.occlusion import Sky

OPENINGS = (0.0, 0.12, 0.25, 0.45)
"""Weights of `jawOpen` for which occlusion is computed; frames interpolate between them."""
DIRECTIONS = 64
"""Directions of the sky from which a head's occlusion is found."""
HEAD_MAP = (448, 0.24)
"""Depth map of head and neck: texels along the side, and half of the side in metres.

Everything outside of the map counts as lit.
"""
SCALP_REACH = 0.026
"""Distance in metres from the hairline over which roots come to cover the skin."""


@dataclass(frozen=True)
class Paint:
    """Values per vertex that textures and shading need.

    Attributes:
        channels: (V, 7) float32: lip, redness, freckles, beard, scalp, each 0 to 1 (redness is
            below 0 where skin is sallow), the depth behind the lips in metres, and hand, 0 to 1.
        strands: (V, 4) float32, as `strand_frames` returns them.
        openings: (O,) float32 gap of the inner lips in metres for each of `OPENINGS`, ascending.
        occlusion: (O, V) float32 visible share of the sky for each of `OPENINGS`.
        hands: The lines and nails of the hands.
    """

    channels: np.ndarray
    strands: np.ndarray
    openings: np.ndarray
    occlusion: np.ndarray
    hands: Hands

    def occlusion_at(self, gap: float) -> np.ndarray:
        """(V,) float32 visible share of the sky for a gap of the inner lips in metres."""
        at = float(np.interp(gap, self.openings, np.arange(len(self.openings))))
        low = min(int(at), len(self.openings) - 2)
        part = np.float32(at - low)
        return self.occlusion[low] * (1 - part) + self.occlusion[low + 1] * part


def paint(subject: Subject) -> Paint:
    """Computes the painted values of a person; takes about a second."""
    gaps, occlusion, head = [], [], Sky(subject, *HEAD_MAP, DIRECTIONS)
    for opening in OPENINGS:
        shape = {"jawOpen": opening}
        for side in ("Left", "Right"):
            shape[f"mouthLowerDown{side}"] = 0.6 * opening
            shape[f"mouthUpperUp{side}"] = 0.3 * opening
        vertices = subject.posed(subject.weights(shape))
        gaps.append(lip_gap(subject.landmarks(vertices)))
        occlusion.append(head.visible(vertices))
    hands = hands_of(subject)
    return Paint(
        _channels(subject, hands),
        strand_frames(subject),
        np.array(gaps, np.float32),
        np.stack(occlusion),
        hands,
    )


def lip_gap(landmarks: np.ndarray) -> float:
    """Distance in metres between the middles of the inner lips in landmarks (68, 3)."""
    return float(np.linalg.norm(landmarks[62] - landmarks[66]))


def _channels(subject: Subject, hands: Hands) -> np.ndarray:
    vertices, marks = subject.vertices, subject.landmarks(subject.vertices)
    width = float(np.linalg.norm(marks[16] - marks[0]))  # of the face, about 0.13 m
    eyes = [eye.centre for eye in subject.eyes]
    cheeks = [
        np.array([eye[0] * 1.35, 0.5 * marks[30, 1] + 0.1 * eye[1], marks[30, 2] - 0.25 * width])
        for eye in eyes
    ]
    ears = [np.array([s * 0.57 * width, marks[30, 1] / 2, -0.02]) for s in (1, -1)]
    redness = 0.8 * bump(vertices, marks[30], 0.10 * width)
    for point, strength, radius in [
        *((c, 0.75, 0.17) for c in cheeks),
        *((e, 0.7, 0.13) for e in ears),
        *((marks[i], 0.25, 0.08) for i in (39, 42, 36, 45)),
        (marks[8], 0.3, 0.12),
        # Below zero: yellowish on the forehead, cool and thin around the eyes.
        ((marks[19] + marks[24]) / 2 + np.array([0, 0.17 * width, 0]), -0.45, 0.26),
        *((eye - np.array([0, 0.08 * width, -0.08 * width]), -0.55, 0.11) for eye in eyes),
        *((eye + np.array([0, 0.05 * width, 0.08 * width]), -0.30, 0.12) for eye in eyes),
    ]:
        redness += strength * bump(vertices, point, radius * width)
    freckles = bump(vertices, marks[28], 0.2 * width)
    for cheek in cheeks:
        freckles += 0.9 * bump(vertices, cheek, 0.2 * width)
    return np.stack(
        [
            subject.lip_mask,
            np.clip(redness + hands.redness, -1, 1),
            np.clip(freckles, 0, 1),
            beard_share(vertices, marks) * (1 - subject.lip_mask),
            _scalp(subject),
            np.maximum(marks[[62, 66], 2].mean() - vertices[:, 2], 0),
            hands.share,
        ],
        axis=1,
    ).astype(np.float32)


def _scalp(subject: Subject) -> np.ndarray:
    """(V,) how much hair and its roots cover the skin: 0 on the face, 1 under the hair."""
    skull = None if subject.strands is None else skull_of(subject)
    if skull is None:
        return np.zeros(len(subject.vertices))
    depth = skull.inside_hairline(subject.vertices)
    return np.clip(0.22 + depth / SCALP_REACH, 0, 1) ** 1.5
