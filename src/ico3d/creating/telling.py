"""Tells on a terminal how far an avatar is."""

from PIL import Image
from rich.console import Console

from ico3d.common.files import write_atomic
from ico3d.creating.events import Event, Looked, Made, Planned, Preview, Step, Voiced
from ico3d.creating.settings import CreateSettings

NAMES: dict[Step, str] = {
    "track": "tracking",
    "learn": "learning the face",
    "measure": "measuring",
}


class Terminal:
    """Prints what `create` tells; progress bars are those of the steps themselves."""

    def __init__(self, settings: CreateSettings):
        """Takes what the avatar is made of."""
        self._settings = settings
        self._console = Console(highlight=False, soft_wrap=True)
        self._face = settings.out.with_suffix(".work") / "face.jpg"

    def __call__(self, event: Event) -> None:
        """Prints an event, if it is for a terminal."""
        lines: list[str] = []
        if isinstance(event, Looked):
            lines = _of_video(event)
        elif isinstance(event, Voiced):
            lines = [_of_voice(event)]
        elif isinstance(event, Planned):
            lines = self._of_plan(event)
        elif isinstance(event, Preview):
            picture = Image.fromarray(event.picture)
            write_atomic(self._face, lambda path: picture.save(path, quality=90))
        elif isinstance(event, Made):
            lines = _of_avatar(event)
        for line in lines:
            self._console.print(line, markup=False)

    def _of_plan(self, plan: Planned) -> list[str]:
        parts = [f"{NAMES[s]} {duration(plan.seconds[s])}" for s in NAMES if plan.seconds.get(s)]
        total = duration(sum(plan.seconds.values()))
        times = ", ".join(f"{name} {duration(seconds)}" for name, seconds in plan.others.items())
        if not parts:
            return ["Everything but baking is done."]
        return [
            f"Quality {self._settings.quality} takes about {total} from here: {', '.join(parts)}; "
            "then baking.",
            f"On this machine as busy as it is now, all in all: {times} (--quality).",
            f"{self._face} shows the face as it learns: recorded | learnt.",
            "Interrupt whenever you like: the same command goes on.",
        ]


def _of_video(looked: Looked) -> list[str]:
    found = looked.found
    lines = [f"{looked.video}: {found.seconds:.0f} s, {found.rate:.0f} pictures per second."]
    better = [one for one in found.advice if one.level == "better"]
    if better:
        lines.append("What would make the avatar better:")
        lines += [f"  - {one}" for one in better]
    elif not found.refused:
        lines.append("Nothing about it needs to be better.")
    if not found.hands_sought:
        lines.append("  (hands were not looked for: ico3d weights fetch hand-landmarker)")
    return lines


def _of_voice(voiced: Voiced) -> str:
    if voiced.why:
        said = str(voiced.why)
        return said[0].upper() + said[1:]
    return f"The avatar's voice is cloned from {voiced.seconds:.0f} s of clean speech."


def _of_avatar(made: Made) -> list[str]:
    quality, lines = made.measured, []
    if quality.face is not None:
        mouth = "" if quality.mouth is None else f", {quality.mouth:.1f} dB at the mouth"
        lines.append(
            f"On {quality.pictures} pictures that it never saw: {quality.face:.1f} dB on face and "
            f"hair{mouth}."
        )
    lines += [
        f"{made.bundle} is there, after {duration(made.seconds)}. Look at {made.strip}: recorded | "
        "learnt | as browsers show it.",
        f"Talk with it: ico3d serve {made.bundle}",
    ]
    return lines


def duration(seconds: float) -> str:
    """Seconds in words, rounded as estimates are."""
    if seconds < 90:
        return f"{max(5 * round(seconds / 5), 5)} s"
    return f"{round(seconds / 60)} min"
