"""Whether this machine can serve an avatar."""

import os
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from ico3d.chat.doctor.finding import Finding, bad, good, weak
from ico3d.errors import Ico3dError

PACKAGES = (
    "pipecat",
    "fastapi",
    "uvicorn",
    "onnxruntime",
    "aiohttp",
    "httpx",
    "websockets",
    "soxr",
)
"""Some of the extra `chat`, by which one sees whether it is there."""
NEEDED = 300e6
"""Bytes of memory that a server takes with the offline services (docs/benchmarks.md)."""


def findings(bundle: Path, settings: Path | None, port: int) -> Iterator[Finding]:
    """Looks at this machine, and makes everything that a conversation needs once.

    Args:
        bundle: The avatar that it is to serve.
        settings: The settings file of the conversation.
        port: The port of the server.
    """
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if missing:
        yield bad(f"{', '.join(missing)} cannot be imported", "pip install 'ico3d[chat,voice]'.")
        return
    yield good("the packages for serving are installed")
    yield of_page()
    yield from of_size()
    yield of_port(port)
    yield from of_avatar(bundle, settings)


def of_page() -> Finding:
    """Whether there is a page to serve."""
    from ico3d.chat.serving.server import STATIC

    if os.path.isfile(STATIC / "index.html"):
        return good("the page is built")
    return bad("the page is not built", "run `make viewer`.")


def of_size() -> Iterator[Finding]:
    """Whether the machine is large enough."""
    import psutil

    cores, free = len(os.sched_getaffinity(0)), psutil.virtual_memory().available
    found = f"{cores} cores, {free / 1e9:.1f} GB of memory free"
    if free < NEEDED:
        yield bad(found, f"a server takes {NEEDED / 1e9:g} GB and more; end something else.")
    elif cores < 2:
        yield weak(found, "speech stutters when a second visitor talks; take two cores or more.")
    else:
        yield good(found)


def of_port(port: int) -> Finding:
    """Whether the port is free."""
    from ico3d.chat.serving.server import bind
    from ico3d.errors import SettingsError

    try:
        bind("127.0.0.1", port).close()
    except SettingsError as error:
        return weak(f"port {port} is taken", f"by a server that runs already, or: {error}")
    return good(f"port {port} is free")


def of_avatar(bundle: Path, settings: Path | None) -> Iterator[Finding]:
    """Whether the avatar can be read and its services start."""
    from ico3d.bundle.format import Bundle
    from ico3d.chat.parts import make_parts
    from ico3d.chat.services.offers import offers
    from ico3d.chat.services.own_voice import unheard
    from ico3d.chat.serving.server import open_avatar
    from ico3d.chat.settings.conversation import read_settings

    try:
        opened = Bundle.open(bundle)
        yield good(f"{bundle} is a whole bundle of {opened.manifest.persona.name}")
        if not opened.manifest.head:
            yield good("it is a body without a head, and nobody talks with it")
            return
        read = read_settings(settings)
        began = time.monotonic()
        avatar = open_avatar(opened, read)
        services = make_parts(avatar).services
    except Ico3dError as error:
        yield bad("no conversation can begin", str(error))
        return
    yield good(f"a conversation's services started in {time.monotonic() - began:.1f} s")
    voices = avatar.persona.voice, avatar.own_voice
    if lost := unheard(read.voice, *voices):
        yield weak("the avatar has a voice of its own, which is not heard", lost)
    better = {o.kind: o for o in reversed(offers(read, *voices)) if o.hindrance}
    for kind in ("recognition", "language", "voice"):
        service = getattr(services, kind)
        told = f"{kind} is {service.name}"
        if not service.stand_in:
            yield good(told)
        elif kind in better:
            yield weak(
                f"{told}, a stand-in", f"{better[kind].name} needs this: " + better[kind].hindrance
            )
        else:
            yield weak(f"{told}, a stand-in", "a better one works here; name it in the settings.")
