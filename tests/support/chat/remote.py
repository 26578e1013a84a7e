"""Modules as real HTTP servers in the test's own event loop."""

import contextlib

from ico3d.bundle.format import SPEECH
from ico3d.bundle.manifest import Persona
from ico3d.chat.remote.app import make_expression_app, make_service_app
from ico3d.chat.remote.limits import Limits
from ico3d.chat.services.language import persona
from ico3d.chat.services.provider import Context
from ico3d.chat.services.recognition import sphinx
from ico3d.chat.services.voice import espeak
from ico3d.chat.serving import server
from ico3d.speech.runtime import SpeechModel
from support.chat.serving import running

HOST = "127.0.0.1"
ADA = Persona("Ada", "Hello.", ("who are you => I am Ada. I live in a box. Grüße, 你好!",))
CONTEXT = Context(ADA, None, None)


@contextlib.asynccontextmanager
async def serving(app, port=0):
    """Yields the URL of a running server of any ASGI application."""
    async with running(app, port=port) as (_, listener):
        yield server.address(listener)


def service_app(kind, make, limits=None, key=""):
    """One provider as a module; `make` makes its processor."""
    return make_service_app(kind, kind, make, HOST, limits or Limits(), key)


def expression_app(bundle, limits=None, key=""):
    """The speech model of a bundle as a module."""
    model, sha256 = SpeechModel(bundle.read(SPEECH)), bundle.manifest.files[SPEECH].sha256
    return make_expression_app(model, sha256, HOST, limits or Limits(), key)


def make_voice():
    return espeak.make(espeak.Settings(), CONTEXT)


def make_language():
    return persona.make(persona.Settings(), CONTEXT)


def make_recognition():
    return sphinx.make(sphinx.Settings(), CONTEXT)
