"""Offsets of MediaPipe's points from the template's landmarks, for a person of any shape.

A detector places a hip differently than the template does. The offset depends on the person more
than on the picture: on broad people, for example, shoulders are seen further inside. Offsets are
linear in the shape, as the template's landmarks are. `scripts/measure_detector.py` measures them.
"""

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.capture.posing.model.landmarks import LANDMARKS
from ico3d.capture.posing.model.naming import opposite
from ico3d.capture.posing.model.template import Template

FILE = Path(__file__).parents[1] / "data" / "mediapipe.json"
MILLIMETRE = 1e-3


@dataclass(frozen=True, eq=False)
class Detector:
    """Offsets of a detector's points from the template's landmarks.

    Attributes:
        beside: (1 + K, P, 3) offsets at rest in metres: for the mean shape, then the change per
            shape coefficient.
        spread: (P, 3) standard deviation in metres between people of the remaining offset at rest,
            which is constant for one person.
    """

    beside: np.ndarray
    spread: np.ndarray

    def seen(self, template: Template) -> Template:
        """The template with its landmarks moved to where the detector sees them."""
        return replace(template, places=template.places + self.beside)


@cache
def mediapipe_detector(num_shapes: int) -> Detector:
    """Offsets of MediaPipe's body model; landmarks of hands have none.

    Args:
        num_shapes: Number K of the template's shape coefficients.
    """
    told: dict[str, Any] = json.loads(FILE.read_text())["landmarks"]
    beside = np.zeros((1 + num_shapes, len(LANDMARKS), 3))
    spread = np.array([[landmark.sigma] * 3 for landmark in LANDMARKS.values()])
    for number, name in enumerate(LANDMARKS):
        known, mirror = told.get(name), np.ones(3)
        if known is None and opposite(name) in told:
            known, mirror = told[opposite(name)], np.array([-1.0, 1.0, 1.0])
        if known is not None:
            beside[:, number] = MILLIMETRE * mirror * np.array(known["beside"])
            spread[number] = MILLIMETRE * np.array(known["spread"])
    return Detector(beside, spread)
