"""Makes an avatar of a video: looks at it, tracks, learns, measures, bakes."""

import json
import os
import time
from functools import partial
from pathlib import Path

from ico3d.avatar.baking.command import Bake
from ico3d.avatar.baking.telling.about import provenance_of
from ico3d.avatar.baking.telling.statement import Statement
from ico3d.avatar.embodying.command import Embody
from ico3d.avatar.embodying.embody import body_in
from ico3d.avatar.embodying.look import check_look
from ico3d.bundle.format import Bundle, give_voice
from ico3d.bundle.persona import Persona, read_persona
from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.portrait.settings import PortraitSettings
from ico3d.capture.portrait.track import track_portrait
from ico3d.common.files import full_disk, write_atomic
from ico3d.common.people.stated import NOT_STATED
from ico3d.common.typed import plain
from ico3d.creating.events import Advanced, Looked, Made, Measured, Planned, Step, Tell
from ico3d.creating.learning import learn
from ico3d.creating.looking.examine import Examination, examine
from ico3d.creating.measuring import measured
from ico3d.creating.pace import set_pace
from ico3d.creating.plan import check_room, expected, tracking_spans
from ico3d.creating.settings import QUALITIES, CreateSettings
from ico3d.creating.voice.clone import Cloned, awaits_voice, clone
from ico3d.creating.workplace import Workplace, workplace
from ico3d.errors import CaptureError
from ico3d.head.model_folder import TrainedHead

SIZE = 512
"""Upper limit of the pictures' short side in pixels."""
QUALITY, STRIP = "quality.json", "strip.png"
HEAD_ALONE = "head.ico3d"


def create(settings: CreateSettings, tell: Tell) -> Made:
    """Makes an avatar of a video; called again with the same settings it goes on where it stopped.

    What it makes on the way lies in NAME.work beside the avatar, so that a better quality begins
    with the video tracked already. The avatar appears, or replaces an earlier one, once it is
    complete.

    Args:
        settings: The video, the avatar, and how well it is to be made.
        tell: Told what happens, on the thread that calls.

    Returns:
        The avatar, and how good it is.

    Raises:
        BundleError: If the bundle of the body cannot be used.
        CaptureError: If no avatar can be made of the video; the sentence says why.
        SettingsError: If the avatar's name or the folder belongs to something else, nobody says
            that the person agreed, or a head alone is to have a build or an outfit.
        StorageError: If the disk is full, or cannot be written.
        MissingModelError: If the face model is not installed.
        Ico3dError: As for the verbs that track, train and bake.
    """
    begin = time.monotonic()
    persona, said = _persona(settings), _statement(settings)
    check_look(settings.body, settings.look)
    if settings.body is not None:
        body_in(Bundle.open(settings.body), settings.look)  # said before the work, not after it
    with workplace(settings) as place, full_disk(place.folder):
        if place.is_done(settings) and not awaits_voice(settings, place):
            return _made(settings, place, begin, tell)
        quality = QUALITIES[settings.quality]
        found = _looked(settings, tell)
        voice = clone(settings, place, tell)
        check_room(place.folder, quality, found.seconds, found.pixels)
        tell(_planned(settings, place, found))
        capture = _tracked(settings, place, found.seconds, tell)
        set_pace(settings.device)  # other programs may have come or gone
        head = learn(capture, place.head(settings.quality), settings, quality, tell)
        _measure(head, capture, place, settings, tell)
        _bake(settings, place, capture.path, (persona, said, voice), tell)
        place.note_done(settings)
        return _made(settings, place, begin, tell)


def _persona(settings: CreateSettings) -> Persona:
    """The persona that is asked for, or one that knows its name alone."""
    if settings.persona is not None:
        return read_persona(settings.persona)
    name = settings.out.stem
    return Persona(name, f"Hello, I am {name}.", (f"who are you | your name => I am {name}.",))


def _looked(settings: CreateSettings, tell: Tell) -> Examination:
    """Examines the video.

    Raises:
        CaptureError: If no avatar can be made of it.
    """
    reached = partial(_tell_share, tell, "look", "looking at the video")
    found = examine(settings.video, SIZE, reached)
    tell(Looked(settings.video, found))
    if found.refused:
        reasons = " ".join(str(one) for one in found.refused)
        raise CaptureError(f"{settings.video}: {reasons}")
    return found


def _tell_share(tell: Tell, step: Step, doing: str, share: float) -> None:
    tell(Advanced(step, share, doing))


def _planned(settings: CreateSettings, place: Workplace, found: Examination) -> Planned:
    """How long everything takes at each quality, and what is left of the one that is wanted."""
    step = set_pace(settings.device)
    plans = {name: expected(one, found.seconds, step) for name, one in QUALITIES.items()}
    left = dict(plans[settings.quality])
    if os.path.exists(place.capture(QUALITIES[settings.quality].tracking)):
        left["track"] = 0.0
    if os.path.exists(place.head(settings.quality) / "finished.json"):
        left["learn"] = 0.0
    return Planned(left, {name: sum(plan.values()) for name, plan in plans.items()})


def _tracked(settings: CreateSettings, place: Workplace, seconds: float, tell: Tell) -> Capture:
    """The tracked video, which has so many seconds."""
    quality = QUALITIES[settings.quality]
    folder = place.capture(quality.tracking)
    if not os.path.exists(folder):
        spans = tracking_spans(quality, seconds)

        def reached(doing: str, share: float) -> None:
            begin, end = spans[doing]
            tell(Advanced("track", begin + share * (end - begin), doing))

        stated = (settings.out.stem, settings.consent, settings.licence)
        about = (*stated, settings.device, quality.pictures)
        how = PortraitSettings(SIZE, None, quality.refine, *about)
        track_portrait(settings.video, folder, how, reached)
    tell(Advanced("track", 1.0, "tracked"))
    return open_capture(folder)


def _measure(
    head: TrainedHead, capture: Capture, place: Workplace, settings: CreateSettings, tell: Tell
) -> None:
    """Measures the head and notes the result."""
    reached = partial(_tell_share, tell, "measure", "comparing with pictures it never saw")
    place.write(f"{settings.quality}-{QUALITY}", plain(measured(head, capture, reached)))


def _bake(
    settings: CreateSettings,
    place: Workplace,
    capture: Path,
    told: tuple[Persona, Statement, Cloned | None],
    tell: Tell,
) -> None:
    """Writes the avatar, of which is `told` who it is, who agreed, and with which voice it speaks.

    It is written even where baking costs more than `ico3d bake` allows, since that is told and
    there is nothing else to have of a short video.
    """
    tell(Advanced("bake", 0.0, "making the avatar's file"))
    persona, said, voice = told
    about = place.file("persona.json")
    write_atomic(about, json.dumps(plain(persona), indent=1).encode())
    alone = settings.body is None and voice is None
    baked = settings.out if alone else place.file(HEAD_ALONE)
    Bake(
        place.head(settings.quality),
        (capture, baked),
        persona=about,
        strip=place.file(STRIP),
        force=True,
        device=settings.device,
        statement=said,
    ).run()
    if voice is not None:
        give_voice(baked, voice.about, voice.tone, settings.out if settings.body is None else baked)
    if settings.body is not None:
        tell(Advanced("bake", 0.7, "putting the head on a body"))
        Embody(baked, settings.out, settings.body, settings.build, settings.outfit).run()
    tell(Advanced("bake", 1.0, "made"))


def _statement(settings: CreateSettings) -> Statement:
    """What is said of the person; refused at once where nobody says that they agreed.

    Raises:
        SettingsError: If nobody does.
    """
    name = settings.out.stem
    said = Statement(name, settings.consent, settings.licence, settings.made_by or name)
    recorded = {"kind": "portrait", "sources": (settings.video.name,)}
    unsaid = {"consent": NOT_STATED, "licence": NOT_STATED}
    provenance_of({str(settings.video): recorded | unsaid}, said, settings.out)
    return said


def _made(settings: CreateSettings, place: Workplace, begin: float, tell: Tell) -> Made:
    """Tells that the avatar is there."""
    known = place.read(f"{settings.quality}-{QUALITY}") or {}
    quality = Measured(known.get("face"), known.get("mouth"), known.get("pictures", 0))
    made = Made(settings.out, place.file(STRIP), quality, time.monotonic() - begin)
    tell(made)
    return made
