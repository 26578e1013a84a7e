"""The verbs `ico3d bench chat` and `ico3d bench sessions`; heavy imports happen when they run."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import tyro

from ico3d.measure.talking.kinds import Kind


@dataclass(frozen=True)
class BenchChat:
    """Talks with a served bundle in real time and measures its answers and interruptions.

    Questions are timed from their end to the first sample of the answer that a page would play,
    with the services that the settings name. Interruptions are timed from the visitor's first
    audible sample; "uh-huh" must not stop an answer. The server's own share is measured on a second
    server, whose services have set delays, with questions that break off amid a sound.

    Attributes:
        bundle: The avatar to serve; servers run as separate processes.
        speech: Folder of recorded questions (WAV, PCM16 mono 16 kHz); by default synthetic voices
            ask.
        turns: Number of trials of each kind.
        kinds: Kinds of trials.
        settings: TOML or JSON file that chooses services and timing.
        json: File for the figures.
    """

    bundle: tyro.conf.Positional[Path] = Path("demo")
    speech: Path | None = None
    turns: int = 50
    kinds: tuple[Kind, ...] = ("questions", "interruptions", "assent", "share")
    settings: Path | None = None
    json: Path | None = None

    def run(self) -> None:
        """Prints median and 95th percentile and writes the file.

        Raises:
            SettingsError: If the number of trials is 0.
        """
        import json

        from rich.console import Console
        from rich.progress import Progress

        from ico3d.chat.observing.operator_log import set_up_log
        from ico3d.common.files import write_atomic
        from ico3d.errors import SettingsError

        set_up_log(verbose=False)
        from ico3d.measure.talking import bench, host
        from ico3d.measure.talking.questions import sayings

        if self.turns < 1:
            raise SettingsError("--turns must be at least 1.")
        said = sayings(self.speech)
        with host.watched() as stolen, Progress() as progress:
            bars = {kind: progress.add_task(kind, total=self.turns) for kind in self.kinds}
            results = bench.measure(
                self.bundle,
                self.settings,
                said,
                self.kinds,
                self.turns,
                lambda kind: progress.advance(bars[kind]),
            )
        figures = bench.figures(results)
        if self.json is not None:
            told = figures | {"stolen_cores": stolen.cores}
            write_atomic(self.json, json.dumps(told, indent=1).encode())
        for table in bench.tables(figures):
            Console().print(table)
        Console().print(stolen.sentence())


@dataclass(frozen=True)
class BenchSessions:
    """Finds out how many visitors can talk with one server at once, and checks what each hears.

    All visitors come within two seconds, and ask within two seconds, twice. Voices are synthesised
    in advance, one tone for each visitor; faces are computed as always. Nobody may hear another
    visitor's tone, and each piece of speech has to arrive 150 ms before it is to be played. The
    number of visitors is doubled until they are too many; the answer lies within a tenth.

    Attributes:
        bundle: The avatar to serve, by a separate process.
        visitors: Number of visitors who talk at once, instead of a search.
        microphones: Number of visitors with an open microphone in a silent room, to which the
            server listens.
        json: File for the figures.
    """

    bundle: tyro.conf.Positional[Path] = Path("demo")
    visitors: int | None = None
    microphones: int = 0
    json: Path | None = None

    def run(self) -> None:
        """Prints what was heard and how early, and writes the file.

        Raises:
            SettingsError: If there are no visitors, or more visitors than tones.
        """
        import json

        from rich.console import Console

        from ico3d.chat.observing.operator_log import set_up_log
        from ico3d.common.files import write_atomic

        set_up_log(verbose=False)
        from ico3d.measure.talking import host

        with host.watched() as stolen:
            figures = self._search() if self.visitors is None else self._measure(self.visitors)
        if self.json is not None:
            told = figures | {"stolen_cores": stolen.cores}
            write_atomic(self.json, json.dumps(told, indent=1).encode())
        Console().print(stolen.sentence())

    def _measure(self, visitors: int) -> dict[str, Any]:
        """Prints and returns what so many visitors heard."""
        from rich.console import Console

        from ico3d.measure.talking import crowd

        figures = crowd.figures(crowd.measure(self.bundle, visitors, self.microphones))
        Console().print(crowd.table(figures))
        return figures

    def _search(self) -> dict[str, Any]:
        """Prints and returns how many visitors can talk at once."""
        from rich.console import Console

        from ico3d.measure.talking import crowd_search as searching

        def trial(visitors: int) -> searching.Trial:
            found = searching.tried(self.bundle, visitors, self.microphones)
            Console().print(f"{visitors} visitors at once: {found.told}")
            return found

        trials = searching.search(trial)
        found = searching.most_borne(trials)
        Console().print(f"{found} visitors can talk at once.")
        return {"visitors": found, "trials": [asdict(one) for one in trials]}
