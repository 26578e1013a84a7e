"""The verb `ico3d bake`."""

from dataclasses import dataclass
from pathlib import Path

import tyro


@dataclass(frozen=True)
class Bake:
    """Makes the bundle that browsers play, and measures what baking costs on test frames.

    Attributes:
        model: A model folder of ico3d train head.
        capture: The capture it was trained on.
        out: The bundle to write, NAME.ico3d.
        rank: Number of basis vectors, 1 to 64; by default the smallest from 16 on that keeps
            the bounds: at most 0.3 dB lost against ground truth, at least 45 dB against the exact
            model, at most 1.7 MB per 10,000 Gaussians.
        name: The avatar's name; by default the persona's.
        persona: JSON file with name, greeting and notes; by default that of the package.
        licences: Text files with notices that the sources ask for; they go into LICENSES.txt.
        strip: Also write a picture here: recorded | exact | baked.
        force: Write the bundle although it breaks a bound.
    """

    model: tyro.conf.Positional[Path]
    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    rank: int | None = None
    name: str | None = None
    persona: Path | None = None
    licences: tuple[Path, ...] = ()
    strip: Path | None = None
    force: bool = False

    def run(self) -> None:
        """Bakes, measures, writes and checks the bundle.

        Raises:
            BundleError: If the loss breaks a bound and `force` is not set.
        """
        from rich.console import Console

        from ico3d.avatar import baking, comparison, staging
        from ico3d.avatar.persona import load_persona
        from ico3d.bundle.format import Bundle
        from ico3d.bundle.limits import MAX_RANK
        from ico3d.capture.capture import Capture
        from ico3d.errors import SettingsError
        from ico3d.head.trained import TrainedHead

        if self.rank is not None and not 1 <= self.rank <= MAX_RANK:
            raise SettingsError(f"--rank must lie between 1 and {MAX_RANK}, not {self.rank}.")
        console = Console()
        persona, notices = load_persona(self.persona), self._notices()
        head, capture = TrainedHead.load(self.model), Capture.open(self.capture)
        neutral = staging.background_colour(capture, 0)
        views = comparison.references(head, capture, neutral, baking.MEASURED_VIEWS)
        result = baking.bake(head, views, capture, self.rank, console.print)
        if self.strip:
            _save_picture(comparison.strip(result.head, views), self.strip)
        if not self.force:
            baking.check(result)
        baking.write(self.out, self.name or persona.name, result, head, capture, persona, notices)
        Bundle.open(self.out)
        console.print(f"{self.out}: {self.out.stat().st_size / 1e6:.2f} MB.")

    def _notices(self) -> str:
        from ico3d.errors import SettingsError

        try:
            return "\n\n".join(path.read_text("utf-8").strip() for path in self.licences)
        except (OSError, UnicodeDecodeError) as error:
            raise SettingsError(f"a notice of --licences cannot be read: {error}.") from error


def _save_picture(picture, path: Path) -> None:
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(path)
