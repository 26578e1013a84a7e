"""Avatars as real servers in the test's own event loop."""

import asyncio
import contextlib
from dataclasses import replace

import httpx

from ico3d.chat.serving import server
from ico3d.chat.serving.sessions import Sessions
from ico3d.chat.settings.conversation import ChatSettings, Choice

OFFLINE = ChatSettings(language=Choice("persona-notes"))
BROWSER = Choice("browser", {"fallback": ""})
"""Recognition for visitors who type: the server starts no decoder of its own."""
TYPED = replace(OFFLINE, recognition=BROWSER)


def visiting(url="", **more):
    """An HTTP client that waits as long as a busy machine may take."""
    return httpx.AsyncClient(base_url=url, timeout=60, **more)


def free_port():
    """A port that nobody listens on."""
    with server.bind("127.0.0.1", 0) as listener:
        return listener.getsockname()[1]


@contextlib.asynccontextmanager
async def running(app, *more, port=0):
    """Yields the running server of any ASGI application, and its socket."""
    listener = server.bind("127.0.0.1", port)
    served = server.make_server(app, *more)
    task = asyncio.create_task(served.serve(sockets=[listener]))
    while not served.started:
        await asyncio.sleep(0.01)
    try:
        yield served, listener
    finally:
        served.should_exit = True
        await task


@contextlib.asynccontextmanager
async def serving(
    bundle,
    settings=None,
    resume_seconds=30.0,
    persona=None,
    adapt=lambda avatar: avatar,
    certificate=None,
    sites=None,
    proxies=(),
):
    """Yields the URL and the sessions of a running server; by default the offline one.

    `adapt` changes what its sessions share.
    """
    avatar, sessions = None, None
    if bundle.manifest.head:
        avatar = adapt(server.open_avatar(bundle, settings or OFFLINE, persona))
        sessions = Sessions(avatar, resume_seconds)
    app = server.make_app(bundle, avatar, "127.0.0.1", sessions, sites)
    async with running(app, certificate, proxies, sessions) as (_, listener):
        yield server.address(listener, "https" if certificate else "http"), sessions
