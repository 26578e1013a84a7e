"""The verb `ico3d bake`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import tyro

if TYPE_CHECKING:
    from ico3d.bundle.manifest import Persona


@dataclass(frozen=True)
class Bake:
    """Makes the bundle that browsers play, and measures what baking costs on test pictures.

    Attributes:
        model: A model folder of ico3d train head or ico3d train body.
        files: The capture it was trained on, and the bundle to write, NAME.ico3d. Bodies can do
            without the capture; then they are measured against the exact model only.
        rank: Number of basis vectors of a head, 1 to 64; by default the smallest from 16 on that
            keeps the bounds: at most 0.3 dB lost against ground truth, at least 45 dB against the
            exact model, at most 1.7 MB per 10,000 Gaussians. Bodies: at most 0.1 dB lost, at most
            110 bytes per Gaussian and window.
        name: The avatar's name; by default the persona's, of bodies the bundle's.
        persona: JSON file with name, greeting and notes; for heads, by default that of the package.
        licences: Text files with notices that the sources ask for; they go into LICENSES.txt.
        strip: Also write a picture here: recorded | exact | baked.
        force: Write the bundle although it breaks a bound.
    """

    model: tyro.conf.Positional[Path]
    files: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="[CAPTURE] OUT")]
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
            SettingsError: If what was given does not fit the model.
        """
        from rich.console import Console

        from ico3d.body.trained import ABOUT
        from ico3d.bundle.format import Bundle

        console = Console()
        is_body = (self.model / ABOUT).is_file()
        least, most = (1, 2) if is_body else (2, 2)
        if not least <= len(self.files) <= most:
            self._refuse("ico3d bake needs MODEL CAPTURE OUT; only bodies can do without CAPTURE.")
        bake = self._bake_body if is_body else self._bake_head
        bake(console.print)
        Bundle.open(self._out)
        console.print(f"{self._out}: {self._out.stat().st_size / 1e6:.2f} MB.")

    @property
    def _out(self) -> Path:
        return self.files[-1]

    def _bake_head(self, report) -> None:
        from ico3d.avatar import baking, comparison, staging
        from ico3d.avatar.persona import load_persona
        from ico3d.avatar.samples import recorded_samples
        from ico3d.bundle.limits import MAX_RANK
        from ico3d.capture.capture import Capture
        from ico3d.head.trained import TrainedHead

        if self.rank is not None and not 1 <= self.rank <= MAX_RANK:
            self._refuse(f"--rank must lie between 1 and {MAX_RANK}, not {self.rank}.")
        persona, notices = load_persona(self.persona), self._notices()
        head, capture = TrainedHead.load(self.model), Capture.open(self.files[0])
        neutral = staging.background_colour(capture, 0)
        views = comparison.references(head, capture, neutral, baking.MEASURED_VIEWS)
        samples = recorded_samples(head, capture)
        result = baking.bake(head, views, samples, self.rank, report)
        if self.strip:
            _save_picture(comparison.strip(result.head, views), self.strip)
        if not self.force:
            baking.check(result)
        name = self.name or persona.name
        baking.write(self._out, name, result, head, capture, persona, notices)

    def _bake_body(self, report) -> None:
        from rich.progress import track

        from ico3d.avatar import body_bundle
        from ico3d.body.trained import TrainedBody
        from ico3d.capture.capture import Capture

        if self.rank is not None:
            self._refuse("--rank is for heads: what a body keeps is chosen window by window.")
        persona, notices = self._body_persona(), self._notices()
        body = TrainedBody.load(self.model)
        capture = Capture.open(self.files[0]) if len(self.files) > 1 else None
        results = []
        for result in track(body_bundle.bake(body, capture), "baking", len(body.windows)):
            report(f"window {len(results)}: {result}")
            results.append(result)
        rate = body_bundle.megabits_per_second(results)
        report(f"{rate:.2f} Mbit/s while it plays.")
        if self.strip:
            _save_picture(body_bundle.strip(body, results, capture), self.strip)
        if not self.force:
            body_bundle.check(results)
        body_bundle.write(self._out, persona, results, body, capture, notices)

    def _body_persona(self) -> "Persona":
        """The one that was given; bodies alone do not talk and need but a name."""
        from dataclasses import replace

        from ico3d.avatar.persona import load_persona
        from ico3d.bundle.manifest import Persona

        persona = load_persona(self.persona) if self.persona else Persona(self._out.stem, "", ())
        return replace(persona, name=self.name or persona.name)

    def _notices(self) -> str:
        try:
            return "\n\n".join(path.read_text("utf-8").strip() for path in self.licences)
        except (OSError, UnicodeDecodeError) as error:
            self._refuse(f"a notice of --licences cannot be read: {error}.")

    @staticmethod
    def _refuse(sentence: str) -> NoReturn:
        from ico3d.errors import SettingsError

        raise SettingsError(sentence)


def _save_picture(picture, path: Path) -> None:
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(path)
