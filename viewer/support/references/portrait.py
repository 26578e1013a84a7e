"""From a video of a person to an avatar that can be talked with: track, train, bake.

Run: python portrait.py VIDEO FOLDER MODELS

Writes FOLDER/portrait.ico3d, of the video's first two seconds, tracked by the models in MODELS.
"""

import os
import sys
from pathlib import Path

import av

from ico3d.cli import main as ico3d

SECONDS = 2.0
STEPS, BEGIN, UNTIL = 100, 40, 80
"""Of the training, and between which Gaussians are added."""
MOST = 1200
"""Gaussians."""
PERSONA = Path(__file__).with_name("persona.json")
TERMS = ("--likeness", "a test", "--consent", "none needed", "--licence", "tests")


def shorten(video: str, out: Path) -> None:
    """Writes the beginning of a video, its packets as they are."""
    with av.open(video) as source, av.open(str(out), "w") as target:
        streams = {s.index: target.add_stream_from_template(s) for s in source.streams}
        for packet in source.demux():
            if packet.dts is not None and packet.dts * packet.time_base < SECONDS:
                packet.stream = streams[packet.stream_index]
                target.mux(packet)


def main() -> int:
    """Does what the file's docstring says; the exit status."""
    video, folder, os.environ["ICO3D_MODELS"] = sys.argv[1:]
    clip, capture, model, bundle = (
        Path(folder, name) for name in ("clip.mp4", "capture", "model", "portrait.ico3d")
    )
    shorten(video, clip)
    quick = f"--initial.gaussians 1000 --density.max-gaussians {MOST} --steps {STEPS}"
    dense = f"--density.begin {BEGIN} --density.until {UNTIL}"
    learnt = ["--preset", "cpu", *quick.split(), *dense.split()]
    # Forced: half a minute of training need not reach what avatars for people must.
    baked = ["--persona", str(PERSONA), "--force", *TERMS, "--made-by", "a test"]
    return (
        ico3d(["capture", "portrait", str(clip), str(capture), "--size", "128", "--no-refine"])
        or ico3d(["train", "head", str(capture), str(model), *learnt])
        or ico3d(["bake", str(model), str(capture), str(bundle), *baked])
    )


if __name__ == "__main__":
    sys.exit(main())
