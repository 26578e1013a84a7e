"""The paper's settings with all that they switch on: killed, gone on with, and compared.

    python bench/paper.py OUT [--steps 300] [--size 32] [--json F]

Records a synthetic person and trains head, body and scene on it by the command line, with
--preset paper, SGD and VGG from the first step for the head, harmonics of degree 3, colour maps for
the body's cameras, and a density control that is squeezed into so few steps. Each is trained
twice (and once before, which compiles kernels): once at a stretch, once killed by SIGKILL as soon
as it has a checkpoint, and then gone on with. Both must hold the same tensors, bit for bit. VGG's
weights are those that are installed; without, random ones of its shape are written to OUT.
"""

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro
from full_size.interrupting import paper_options, run_verb, train_twice
from full_size.recordings import write_random_vgg
from rich.console import Console

from ico3d.cli import run_script
from ico3d.common.weights import find_model
from ico3d.errors import ModelError
from ico3d.head.perceptual import WEIGHTS


@dataclass(frozen=True)
class Paper:
    """The bench.

    Attributes:
        out: Where recordings and models lie; must be empty.
        steps: Optimisation steps; of bodies, of each window and of fine-tuning each.
        size: Side of the head's pictures, in pixels; VGG looks at each of them.
        subject: Who is recorded: anny, or an NPZ file.
        device: Where to compute.
        json: Also write figures here.
    """

    out: tyro.conf.Positional[Path]
    steps: int = 300
    size: int = 32
    subject: str = "anny"
    device: Annotated[str, tyro.conf.arg(metavar="auto|cpu|cuda")] = "cpu"
    json: Path | None = None

    def run(self) -> None:
        """Trains, compares, prints and writes the figures.

        Raises:
            ModelError: If a model that was killed and gone on with differs from the other.
        """
        self.out.mkdir(parents=True, exist_ok=True)
        models = None
        if find_model(WEIGHTS) is None:
            models = str(self.out)
            write_random_vgg(self.out)
        head, body = self.out / "head-capture", self.out / "body-capture"
        record = ["capture", "synthetic", "--subject", self.subject]
        small = ["--cameras", "2", "--frames", "22", "--size", str(self.size)]
        around = ["--rig", "body", "--cameras", "6", "--frames", "9", "--size", "64"]
        run_verb([*record, str(head), *small], {})
        run_verb([*record, str(body), *around], {})
        found = {}
        for verb, capture in (("head", head), ("body", body), ("static", body)):
            options = paper_options(verb, self.steps, self.device)
            trained = train_twice(verb, capture, self.out, options, models)
            if trained.alike < trained.tensors:
                raise ModelError(f"{verb}: tensors differ after the run was killed: {trained}.")
            Console().print(f"{verb}: {trained}")
            found[verb] = asdict(trained)
        if self.json:
            self.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    sys.exit(run_script(Paper))
