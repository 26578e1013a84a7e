"""What each rank of a baked head costs and keeps, on the test frames of its capture.

    python bench/bake.py MODEL CAPTURE --json bake.json

`psnr_*` are means over views in dB, whole pictures; `uniform` rows weigh all logits alike where
the others weigh them by what the picture shows of them.
"""

import json
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import tyro

from ico3d.avatar import staging
from ico3d.avatar.baking import head_bundle, head_cost
from ico3d.avatar.baking.samples import recorded_samples
from ico3d.avatar.baking.shader_head import BakeSettings, HeadBaker, megabytes_per_10k
from ico3d.capture.formats import open_capture
from ico3d.cli import run_script
from ico3d.head.model_folder import TrainedHead


@dataclass(frozen=True)
class Bench:
    """What to bake.

    Attributes:
        model: A model folder of ico3d train head.
        capture: The capture it was trained on.
        ranks: Ranks to try.
        json: Where to write the table.
    """

    model: tyro.conf.Positional[Path]
    capture: tyro.conf.Positional[Path]
    ranks: tuple[int, ...] = (4, 8, 12, 16, 24, 32, 48)
    json: Path | None = None

    def run(self) -> None:
        """Prints, and writes, one row per weighting and rank."""
        head, capture = TrainedHead.load(self.model), open_capture(self.capture)
        neutral = staging.background_colour(capture, 0)
        views = head_cost.references(head, capture, neutral, head_bundle.MEASURED_VIEWS)
        samples = recorded_samples(head, capture)
        expressions, importance = samples.expressions, samples.importance
        rows = []
        for name, weights in (("image", importance), ("uniform", np.ones_like(importance))):
            start = time.perf_counter()
            baker = HeadBaker(head.model, expressions, weights, max(self.ranks), BakeSettings())
            seconds = time.perf_counter() - start
            for rank in self.ranks:
                baked = baker.baked(rank)
                loss = asdict(head_cost.measure(baked, views))
                row = {"weights": name, "rank": rank, **loss, "fit_seconds": round(seconds, 1)}
                rows.append(row | {"mb_per_10k": round(megabytes_per_10k(baked), 3)})
                print(" ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
        if self.json:
            self.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    sys.exit(run_script(Bench))
