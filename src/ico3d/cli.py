"""The command line: one verb per step; each room is imported only when its verb is used."""

import importlib
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import tyro

from ico3d import __version__
from ico3d.common.terminal import guard_terminal
from ico3d.common.unpacking.limits import limit_to_free_memory
from ico3d.common.unpacking.memory import ran_out
from ico3d.errors import Ico3dError
from ico3d.failures import FAILURES
from ico3d.training.notes.state import carried_out


@dataclass(frozen=True)
class Verb:
    """Where a verb's settings class lives; calling the settings runs the verb."""

    module: str
    name: str
    help: str


VERBS: dict[str, Verb] = {
    "demo": Verb("ico3d.chat.commands", "Demo", "talk with the avatar that comes in the package"),
    "create": Verb("ico3d.creating.command", "Create", "make an avatar of a video of somebody"),
    "studio": Verb("ico3d.recording.command", "Studio", "record yourself on a page, get an avatar"),
    "capture portrait": Verb("ico3d.capture.commands", "Portrait", "track a talking-head video"),
    "capture synthetic": Verb("ico3d.studio.command", "Synthetic", "record a synthetic person"),
    "capture import": Verb(
        "ico3d.capture.importing.commands", "Import", "take over COLMAP or nerfstudio"
    ),
    "capture masks": Verb(
        "ico3d.capture.importing.commands", "Masks", "cut people out by clean plates"
    ),
    "capture track": Verb(
        "ico3d.capture.headtrack.command", "Track", "find the head in many cameras"
    ),
    "capture pose": Verb("ico3d.capture.posing.command", "Pose", "fit a skeleton to the person"),
    "capture resize": Verb(
        "ico3d.capture.importing.commands", "Resize", "write it with smaller pictures"
    ),
    "capture check": Verb("ico3d.capture.commands", "Check", "check it, draw a contact sheet"),
    "train head": Verb("ico3d.head.commands", "TrainHead", "train HeadGaS++ on a capture"),
    "train static": Verb("ico3d.scene.commands", "TrainStatic", "train a scene that stands still"),
    "train body": Verb("ico3d.body.commands", "TrainBody", "train SWinGS++ on a body in motion"),
    "train speech": Verb("ico3d.speech.commands", "TrainSpeech", "train the speech encoder"),
    "runs": Verb("ico3d.training.listing.command", "Runs", "list trainings, and how they go on"),
    "assemble": Verb("ico3d.avatar.joining.command", "Assemble", "put a head on a person's body"),
    "evaluate": Verb("ico3d.measure.commands", "Evaluate", "measure a model on held-out frames"),
    "animate": Verb("ico3d.avatar.animation.command", "Animate", "find a body's rest and gestures"),
    "measure portrait": Verb(
        "ico3d.protocols.commands", "MeasurePortrait", "talking heads: a report"
    ),
    "measure renders": Verb(
        "ico3d.protocols.commands", "MeasureRenders", "anybody's pictures: a report"
    ),
    "measure body": Verb("ico3d.protocols.commands", "MeasureBody", "methods for bodies: a report"),
    "measure ablations": Verb(
        "ico3d.protocols.commands", "MeasureAblations", "what each part is worth: a report"
    ),
    "measure all": Verb("ico3d.protocols.commands", "MeasureAll", "every protocol, one report"),
    "measure viewer": Verb("ico3d.protocols.commands", "MeasureViewer", "frame rates: a report"),
    "bake": Verb("ico3d.avatar.baking.command", "Bake", "make the bundle that browsers play"),
    "embody": Verb("ico3d.avatar.embodying.command", "Embody", "give a head alone a whole body"),
    "bundle info": Verb("ico3d.bundle.commands", "Info", "check a bundle, say what is in it"),
    "render": Verb("ico3d.avatar.film.command", "Render", "film a person who talks or moves"),
    "forget": Verb("ico3d.avatar.forgetting.command", "Forget", "remove what is here of a person"),
    "convert": Verb("ico3d.splat.commands", "Convert", "convert files of 3D Gaussians"),
    "serve": Verb("ico3d.chat.commands", "Serve", "serve a bundle and talk with it"),
    "token": Verb("ico3d.chat.commands", "Token", "make a token for pages that embed an avatar"),
    "doctor": Verb("ico3d.chat.doctor.command", "Doctor", "check a machine or a deployment"),
    "weights list": Verb(
        "ico3d.common.downloads.commands", "ListWeights", "weights that can be used"
    ),
    "weights fetch": Verb(
        "ico3d.common.downloads.commands", "FetchWeights", "download some of them"
    ),
    "weights onnx": Verb("ico3d.speech.commands", "ExportEncoder", "make an encoder servable"),
    "serve-module": Verb(
        "ico3d.chat.remote.commands", "ServeModule", "serve one part of the conversation"
    ),
    "bench expression": Verb("ico3d.measure.commands", "BenchExpression", "measure the mouth"),
    "bench raster": Verb("ico3d.measure.commands", "BenchRaster", "time the rasteriser"),
    "bench chat": Verb(
        "ico3d.measure.talking.commands", "BenchChat", "time answers and interruptions"
    ),
    "bench sessions": Verb(
        "ico3d.measure.talking.commands", "BenchSessions", "let many visitors talk at once"
    ),
}

SERVERS = {"demo", "studio", "serve", "serve-module"}
"""Verbs that run for weeks, in which others' programs end and leave room: what they take is bounded
by what they serve."""


STYLE = (tyro.conf.PositionalMetavarFromFieldName, tyro.conf.DisallowNone)
"""How options are made of settings."""


def usage(group: str | None = None) -> str:
    """The list of verbs that `ico3d --help` prints, or `ico3d GROUP` those of a group."""
    verbs = [verb for verb in VERBS if group in (None, verb.split()[0])]
    width = max(map(len, verbs))
    lines = [f"  {verb:<{width}}  {VERBS[verb].help}" for verb in verbs]
    head = "usage: ico3d VERB ... (ico3d VERB --help tells the rest; ico3d --version)\n\n"
    return head + "\n".join(lines)


def verb_of(words: Sequence[str]) -> str | None:
    """The verb that words begin with, if they do."""
    return next((v for v in VERBS if list(words[: len(v.split())]) == v.split()), None)


def parsed(verb: str, words: Sequence[str]) -> Any:
    """The settings that the words behind a verb mean; nothing is run.

    A verb whose defaults depend on what words choose (a preset) has a method `defaults`.
    """
    entry = VERBS[verb]
    kind = getattr(importlib.import_module(entry.module), entry.name)
    default = kind.defaults(words) if hasattr(kind, "defaults") else tyro.MISSING_NONPROP
    return tyro.cli(
        kind,
        prog=f"ico3d {verb}",
        args=list(words),
        default=default,
        config=STYLE,
    )


def main(arguments: list[str] | None = None) -> int:
    """Runs one verb.

    Args:
        arguments: The words after `ico3d`; those of the process by default.

    Returns:
        The exit status: 0, 1 for an error the user can mend, 2 for an unknown verb.
    """
    if arguments is None:  # what is started imports nothing from the folder that we are in
        os.environ.setdefault("PYTHONSAFEPATH", "1")
    guard_terminal()
    words = sys.argv[1:] if arguments is None else arguments
    if words == ["--version"]:
        print(f"ico3d {__version__}")
        return 0
    verb = verb_of(words)
    if verb is None:
        return _list_verbs(words)
    if arguments is None and verb not in SERVERS:
        limit_to_free_memory()

    def run() -> int | None:
        settings = parsed(verb, words[len(verb.split()) :])
        with carried_out(("ico3d", *words)):
            return settings.run()

    return ended(run)


def run_script(settings: type) -> int:
    """Runs a script of its own (`bench/`), whose options are the fields of a settings class.

    Its `--help` shows the script's docstring.

    Args:
        settings: The class; it has a method `run`, which may return an exit status.

    Returns:
        The exit status, as of `ended`.
    """
    about = sys.modules[settings.__module__].__doc__
    return ended(tyro.cli(settings, description=about, config=STYLE).run)


def ended(run: Callable[[], int | None]) -> int:
    """The exit status of what runs: its own, or 1 for an error the user can mend, which is said."""
    try:
        return run() or 0
    except Ico3dError as error:
        print(f"ico3d: {error}", file=sys.stderr)
        return 1
    except (MemoryError, RuntimeError) as error:
        if not ran_out(error):
            raise
        print(f"ico3d: {FAILURES['memory']}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def _list_verbs(words: Sequence[str]) -> int:
    """Prints the verbs there are, all of them or those of a group; the exit status."""
    groups = {verb.split()[0] for verb in VERBS}
    group = words[0] if words and words[0] in groups else None
    asked = words[1:] if group else words
    if not asked or asked[0] in ("-h", "--help"):
        print(usage(group))
        return 0
    print(f"ico3d: no such verb: {' '.join(words[:2])}\n\n{usage(group)}")
    return 2


if __name__ == "__main__":
    sys.exit(main())
