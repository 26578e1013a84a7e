"""Puts a head that was trained anew in place of a bundle's, on the body that it had.

    python bench/renew_head.py old.ico3d HEAD HEAD_CAPTURE BODY_CAPTURE new.ico3d

For the same person in the same light, as `make_demo.py` records them: the body was trained beside
the old head, and its Gaussians stay what they are, but for the colours of those behind the head.
BODY_CAPTURE says where the face is in the body's recording; its pictures are not looked at. It
prints what baking the head costs.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro
from demo.finishing import composed, write_person
from demo.lighting import lit_head
from make_demo import check

from ico3d.avatar.baking import head_bundle
from ico3d.avatar.baking.person_bundle import moved_head, recorded_head
from ico3d.avatar.joining.assemble import align
from ico3d.avatar.joining.cropping import cropped
from ico3d.bundle.format import SPEECH, Bundle
from ico3d.capture.capture import Capture
from ico3d.capture.face.region import HeadRegion
from ico3d.capture.formats import open_capture
from ico3d.cli import run_script
from ico3d.errors import ModelError
from ico3d.head.model_folder import TrainedHead


@dataclass(frozen=True)
class Renewal:
    """What goes where.

    Attributes:
        old: Bundle of a whole person on a skeleton.
        head: Folder of the head that was trained anew.
        head_capture: Its recording.
        body_capture: A recording of the whole person, with landmarks of the face.
        out: The bundle to write.
    """

    old: tyro.conf.Positional[Path]
    head: tyro.conf.Positional[Path]
    head_capture: tyro.conf.Positional[Path]
    body_capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]

    def run(self) -> None:
        """Bakes the head, puts it on, writes and checks the bundle."""
        bundle, trained = Bundle.open(self.old), TrainedHead.load(self.head)
        old, body, adaptor = bundle.manifest.head, bundle.skinned, trained.adaptor
        if old is None or body is None:
            raise ModelError(f"{self.old} is no whole person on a skeleton.")
        if trained.landmarks is None or adaptor is None:
            raise ModelError(f"{self.head} has no landmarks, or is not driven by speech.")
        placed = align(open_capture(self.body_capture), trained.landmarks, print)
        trained = cropped(trained, HeadRegion.around(trained.landmarks))
        result, idle = _baked(trained, open_capture(self.head_capture))
        there = moved_head(result.head, placed.canonical_from_head)
        head, gaze = head_bundle.finished(there, trained, idle, placed.canonical_from_head)
        onnx, speech = head_bundle.speech_file(adaptor, trained.encoder)
        info = head_bundle.head_info(head, trained, idle, old.fps, old.num_poses, gaze)
        manifest = replace(bundle.manifest, head=info, speech=speech, loss=result.loss)
        write_person(self.out, bundle, manifest, lit_head(composed(head)), body, {SPEECH: onnx})
        check(self.out)


def _baked(head: TrainedHead, capture: Capture) -> tuple[head_bundle.BakedResult, np.ndarray]:
    """The baked head, in the space of its model, and its (B,) expression at rest."""
    samples, views = recorded_head(head, capture)
    result = head_bundle.bake(head, views, samples, None, print)
    head_bundle.check(result)
    return result, head_bundle.idle_expression(head, samples.expressions)


if __name__ == "__main__":
    sys.exit(run_script(Renewal))
