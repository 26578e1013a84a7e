"""The verbs `serve` and `demo`."""

import itertools
import sys
import webbrowser
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ico3d.bundle import packaged
from ico3d.chat.observing.operator_log import set_up_log


@dataclass(frozen=True)
class Serve:
    """Serves a bundle: a page where anyone can talk with it, or watch it if it is a body alone.

    Attributes:
        bundle: The avatar: NAME.ico3d or its folder; `demo` is the one of the package.
        host: Address to listen on; other machines reach it only if it is not 127.0.0.1.
        port: Port to listen on; 0 takes any that is free.
        settings: TOML or JSON file that chooses services and timing.
        persona: TOML or JSON file that says who the avatar is; by default as its bundle says.
        open: Open the page in a browser.
        log: File that gets a line of JSON for each turn: times and counts, no words.
        verbose: Print what happens inside.
    """

    bundle: Annotated[Path, tyro.conf.Positional]
    host: str = "127.0.0.1"
    port: int = 8765
    settings: Path | None = None
    persona: Path | None = None
    open: bool = False
    log: Path | None = None
    verbose: bool = False

    def run(self) -> None:
        """Serves until it is interrupted.

        Raises:
            Ico3dError: If the bundle, the settings or the port cannot be used, or a service
                cannot be made.
        """
        set_up_log(self.verbose)
        from ico3d.bundle.format import Bundle
        from ico3d.bundle.persona import read_persona
        from ico3d.chat.observing.monitor import Monitor, TurnLog
        from ico3d.chat.parts import make_parts, warm_up
        from ico3d.chat.services.offers import offers
        from ico3d.chat.serving import server
        from ico3d.chat.serving.sessions import Sessions
        from ico3d.chat.settings.conversation import read_settings

        settings = read_settings(self.settings)
        persona = read_persona(self.persona) if self.persona else None
        monitor = Monitor(TurnLog.open(self.log) if self.log else None)
        listener = server.bind(self.host, self.port)
        bundle = Bundle.open(self.bundle)
        avatar = server.open_avatar(bundle, settings, persona) if bundle.manifest.head else None
        sessions = Sessions(avatar, monitor=monitor) if avatar else None
        parts = make_parts(avatar) if avatar else None  # loads what they need, too
        app = server.make_app(bundle, avatar, self.host, sessions)
        url = server.address(listener)
        listener.listen()  # whoever reads the address and comes at once is served in a moment
        print(f"{(persona or bundle.manifest.persona).name} is at {url} (Ctrl+C ends)")
        if avatar and parts:
            warm_up(parts)
            offered = offers(settings, avatar.persona.voice)
            print("\n".join(described(parts.services, offered)))
        if not (server.STATIC / "index.html").is_file():
            print("The page is not built: run `make viewer`.", file=sys.stderr)
        sys.stdout.flush()
        if self.open:
            webbrowser.open(url)
        server.make_server(app).run(sockets=[listener])


@dataclass(frozen=True)
class Demo:
    """Talks with the avatar that comes in the package.

    Attributes:
        host: Address to listen on.
        port: Port to listen on; 0 takes any that is free.
        settings: TOML or JSON file that chooses services and timing.
        persona: TOML or JSON file that says who the avatar is; by default as its bundle says.
        open: Open the page in a browser.
        verbose: Print what happens inside.
    """

    host: str = "127.0.0.1"
    port: int = 8765
    settings: Path | None = None
    persona: Path | None = None
    open: bool = True
    verbose: bool = False

    def run(self) -> None:
        """Serves the packaged avatar until it is interrupted.

        Raises:
            BundleError: If the package came without it.
        """
        demo = Path(packaged.NAME)
        where = (self.host, self.port, self.settings, self.persona)
        Serve(demo, *where, open=self.open, verbose=self.verbose).run()


def described(services, offers) -> list[str]:
    """What serves, one line each; and what would be better, with what it needs."""
    verbs = {"recognition": "listens", "language": "thinks", "voice": "speaks"}
    lines, stand_ins = [], False
    for kind, verb in verbs.items():
        service = getattr(services, kind)
        lines.append(f"  {verb} with {service.name}")
        stand_ins = stand_ins or service.stand_in
        better = itertools.takewhile(
            lambda offer, name=service.name: offer.name != name,
            (offer for offer in offers if offer.kind == kind),
        )
        lines += [f"    better: {o.name}; {o.hindrance}" for o in better if o.hindrance]
    if stand_ins:
        lines.append("  (small offline stand-ins; choose others with --settings)")
    return lines
