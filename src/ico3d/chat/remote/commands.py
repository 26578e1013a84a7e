"""The verb `ico3d serve-module`."""

import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ico3d.bundle import packaged
from ico3d.chat.observing.operator_log import set_up_log
from ico3d.chat.remote.limits import Limits
from ico3d.errors import BundleError, SettingsError

LOOPBACK = ("127.0.0.1", "::1", "localhost")


@dataclass(frozen=True)
class ServeModule:
    """Serves one part of the conversation to other machines (docs/conversation/modules.md).

    Recognition, language and voice use the OpenAI-compatible API; expression has an API of its own.

    Attributes:
        kind: Part to serve: recognition, language, voice or expression.
        settings: TOML or JSON file that chooses the provider, as for `serve`.
        bundle: Avatar whose persona is given to language, and whose speech model runs for
            expression.
        host: Address to listen on; with 127.0.0.1 other machines cannot reach the server.
        port: Port to listen on; 0 takes any free port.
        key_variable: Environment variable with a key that clients must send; by default no key is
            needed.
        limits: Limits of requests.
        verbose: Print all log messages, including what visitors say.
    """

    kind: Annotated[Literal["recognition", "language", "voice", "expression"], tyro.conf.Positional]
    settings: Path | None = None
    bundle: Path = Path(packaged.NAME)
    host: str = "127.0.0.1"
    port: int = 8766
    key_variable: str = ""
    limits: Limits = field(default_factory=Limits)
    verbose: bool = False

    def run(self) -> None:
        """Serves until interrupted.

        Raises:
            Ico3dError: If the bundle, the settings, the key or the port cannot be used.
        """
        set_up_log(self.verbose)
        from ico3d.chat.serving import server

        key = self._key()
        listener = server.bind(self.host, self.port)
        name, app = self._app(key)
        url = server.address(listener)
        server.listen(listener)
        print(f"{self.kind} with {name} is at {url}v1 (Ctrl+C ends)")
        if self.host not in LOOPBACK and not key:
            print("Anybody who reaches this address may use it: set --key-variable.")
        sys.stdout.flush()
        server.make_server(app).run(sockets=[listener])

    def _app(self, key: str):
        """Title and application."""
        from ico3d.bundle.format import SPEECH, Bundle
        from ico3d.chat.performing.face import open_face
        from ico3d.chat.remote.app import make_expression_app, make_service_app
        from ico3d.chat.services import TABLES, chosen
        from ico3d.chat.services.provider import Context
        from ico3d.chat.settings.conversation import read_settings
        from ico3d.motion.composing.takes import Takes

        bundle = Bundle.open(self.bundle)
        head, model = open_face(bundle)
        if self.kind == "expression":
            if model is None:
                raise BundleError(f"{self.bundle}: this avatar's face is not driven by sound.")
            sha256 = bundle.manifest.files[SPEECH].sha256
            return self.bundle, make_expression_app(model, sha256, self.host, self.limits, key)
        choice = getattr(read_settings(self.settings), self.kind)
        service = chosen(TABLES[self.kind], choice, self.kind)
        shown = tuple(Takes(bundle.gestures or {}).meanings)
        context = Context(bundle.manifest.persona, head, bundle.animation, shown)
        service.make(context)  # fails now rather than at the first request
        title = service.provider.title
        app = make_service_app(
            self.kind, title, lambda: service.make(context), self.host, self.limits, key
        )
        return title, app

    def _key(self) -> str:
        key = os.environ.get(self.key_variable, "") if self.key_variable else ""
        if self.key_variable and not key:
            raise SettingsError(f"the environment variable {self.key_variable} holds no key.")
        return key
