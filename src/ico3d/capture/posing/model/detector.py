"""Where MediaPipe's points lie beside the template's landmarks, on a person of any shape.

A detector has its own idea of a hip. How far that is from the template's joint depends on the
person more than on the picture: on the broad, shoulders lie further in. Like the template's own
places, these are linear in the shape. `scripts/measure_detector.py` measures them.
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
    """What a detector sees of the template.

    Attributes:
        beside: (1 + K, P, 3) metres at rest by which it sees landmarks beside the template's: mean,
            then by one of each shape coefficient.
        spread: (P, 3) metres at rest by which a person's points may lie elsewhere still, always
            by the same way.
    """

    beside: np.ndarray
    spread: np.ndarray

    def seen(self, template: Template) -> Template:
        """The template with landmarks where the detector sees them."""
        return replace(template, places=template.places + self.beside)


@cache
def mediapipe_detector(num_shapes: int) -> Detector:
    """MediaPipe's body model; hands are where the template has them.

    Args:
        num_shapes: K of the template.
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
