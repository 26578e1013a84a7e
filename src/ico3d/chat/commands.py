"""The verbs `ico3d serve` and `ico3d demo`."""

import itertools
import os
import sys
import webbrowser
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from ico3d.bundle import packaged
from ico3d.chat.observing.operator_log import set_up_log
from ico3d.errors import SettingsError, printable

if TYPE_CHECKING:
    from ico3d.chat.settings.embedding import Embedding


@dataclass(frozen=True)
class Serve:
    """Serves a bundle: a page on which visitors talk with it, or only watch a body without a head.

    Attributes:
        bundle: The avatar: NAME.ico3d or its folder; `demo` is the avatar of the package.
        host: Address to listen on; with 127.0.0.1 other machines cannot reach the server, with
            0.0.0.0 all can that are in the same networks.
        port: Port to listen on; 0 takes any free port.
        settings: TOML or JSON file that chooses services and timing.
        persona: TOML or JSON file that says who the avatar is; by default that of the bundle.
        allow_origin: Sites whose pages may embed the avatar, such as https://example.org.
        browser: Open the page in a browser.
        log: File to which a line of JSON is appended for each turn, with times and counts but no
            words.
        verbose: Print all log messages, including what visitors say.
        tls: Serve by HTTPS, as browsers demand before they give the microphone to another machine's
            page, with a certificate that this machine makes, keeps and renews.
        tls_cert: PEM file of a certificate to serve by HTTPS with, and of its chain.
        tls_key: PEM file of its private key.
        metrics_port: Port on which Prometheus gets figures, without words of visitors; 0 takes any
            free port, by default nobody gets them.
        metrics_host: Address on which it gets them.
        json_log: Write warnings and errors as lines of JSON.
        name: Host names, besides this machine's addresses, under which visitors come, such as those
            of a proxy, a tunnel or `machine.local`.
        proxy: Addresses or networks of proxies that encrypt and tell where visitors come from
            (X-Forwarded-For); nobody else is believed.
        open: Admit everybody who reaches the server; else visitors from other machines have to
            show a key: that of the settings, or one that is made anew at each start and printed.
        without_consent: Serve the avatar although its bundle does not say that the person it shows
            agreed.
    """

    bundle: Annotated[Path, tyro.conf.Positional]
    host: str = "127.0.0.1"
    port: int = 8765
    settings: Path | None = None
    persona: Path | None = None
    allow_origin: tuple[str, ...] = ()
    browser: bool = False
    log: Path | None = None
    verbose: bool = False
    tls: bool = False
    tls_cert: Path | None = None
    tls_key: Path | None = None
    metrics_port: int | None = None
    metrics_host: str = "127.0.0.1"
    json_log: bool = False
    name: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    proxy: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    open: bool = False
    without_consent: bool = False

    def run(self) -> None:
        """Serves until interrupted.

        Raises:
            Ico3dError: If the bundle, the settings or the port cannot be used, the bundle states no
                consent, or a service cannot be started.
        """
        set_up_log(self.verbose, self.json_log)
        from ico3d.bundle.format import Bundle
        from ico3d.bundle.people.provenance import check_consent
        from ico3d.bundle.persona import read_persona
        from ico3d.chat.observing.metrics import Monitor, TurnLog
        from ico3d.chat.parts import make_parts, warm_up
        from ico3d.chat.services.offers import offers
        from ico3d.chat.services.own_voice import unheard
        from ico3d.chat.serving import server
        from ico3d.chat.serving.network.reach import find_reach, fragment
        from ico3d.chat.serving.sessions import Sessions
        from ico3d.chat.serving.sites import open_sites, shown_key
        from ico3d.chat.settings.conversation import read_settings

        settings = read_settings(self.settings)
        persona = read_persona(self.persona) if self.persona else None
        monitor = Monitor(TurnLog.open(self.log) if self.log else None)
        tls = self.tls, self.tls_cert, self.tls_key
        reach = find_reach(self.host, self.name, *tls, self.proxy, self.open)
        embedding = with_origins(settings.embedding, self.allow_origin)
        key = shown_key(reach.is_public, self.open, embedding)
        sites = open_sites(embedding, key or "")
        listener = server.bind(self.host, self.port)
        port = self.metrics_port
        figures = None if port is None else monitor.publish(self.metrics_host, port)
        bundle = Bundle.open(self.bundle)
        if not self.without_consent:
            check_consent(bundle.manifest.provenance, self.bundle)
        avatar = server.open_avatar(bundle, settings, persona) if bundle.manifest.head else None
        sessions = Sessions(avatar, monitor=monitor) if avatar else None
        parts = make_parts(avatar) if avatar else None  # loads what they need, too
        if parts:
            warm_up(parts)
        app = server.make_app(bundle, avatar, self.host, sessions, sites, reach.answered)
        url = server.address(listener, reach.scheme)
        server.listen(listener)
        name = (persona or bundle.manifest.persona).name
        print(f"{printable(name)} is at {url}{fragment(key)} (Ctrl+C ends)")
        print("\n".join(reach.told(listener.getsockname()[1], key)))
        if figures:
            print(f"Prometheus finds figures at {figures}")
        if avatar and parts:
            voices = avatar.persona.voice, avatar.own_voice
            print("\n".join(described(parts.services, offers(settings, *voices))))
            if lost := unheard(settings.voice, *voices):
                print(f"  the avatar has a voice of its own, which is not heard: {lost}")
        if not os.path.isfile(server.STATIC / "index.html"):
            print("The page is not built: run `make viewer`.", file=sys.stderr)
        sys.stdout.flush()
        if self.browser:
            admission = f"?token={sites.token('')[0]}" if sites.asks_for_tokens else ""
            webbrowser.open(url + admission)
        server.make_server(app, reach.certificate, reach.proxies, sessions).run(sockets=[listener])


@dataclass(frozen=True)
class Token:
    """Prints a token that admits pages to a server whose settings name a key for tokens.

    Attributes:
        settings: The server's settings file; its [embedding] names the key's variable.
        origin: Site whose pages the token admits; by default those of the server itself.
        allow_origin: Sites that the server was started with, besides those of the settings.
    """

    settings: Annotated[Path, tyro.conf.Positional]
    origin: str = ""
    allow_origin: tuple[str, ...] = ()

    def run(self) -> None:
        """Prints the token.

        Raises:
            SettingsError: If there is no key, or the site may not embed the avatar.
        """
        from ico3d.chat.serving.sites import open_sites
        from ico3d.chat.settings.conversation import read_settings

        embedding = with_origins(read_settings(self.settings).embedding, self.allow_origin)
        token, _ = open_sites(embedding).token(self.origin)
        print(token)


@dataclass(frozen=True)
class Demo:
    """Serves the avatar that is part of the package, and opens its page.

    Attributes:
        host: Address to listen on.
        port: Port to listen on; 0 takes any free port.
        settings: TOML or JSON file that chooses services and timing.
        persona: TOML or JSON file that says who the avatar is; by default that of the bundle.
        browser: Open the page in a browser.
        verbose: Print all log messages, including what visitors say.
        natural: Listen with Whisper, think with the persona's notes and a small language model,
            and speak with a natural voice, in English; what is missing is installed first, after
            its sizes and licences have been shown and you have agreed.
        yes: Agree to that without being asked.
        open: Admit everybody who reaches the server; `ico3d serve demo` can admit by a key.
    """

    host: str = "127.0.0.1"
    port: int = 8765
    settings: Path | None = None
    persona: Path | None = None
    browser: bool = True
    verbose: bool = False
    natural: bool = False
    yes: bool = False
    open: bool = False

    def run(self) -> None:
        """Serves the packaged avatar until interrupted.

        Raises:
            BundleError: If this installation of the package has no avatar.
            SettingsError: If both a settings file and the natural conversation are asked for, or
                nobody agrees to what the latter needs.
            DownloadError: If that cannot be installed.
        """
        demo = Path(packaged.NAME)
        settings = self.settings
        if self.natural:
            from ico3d.chat.natural.needs import SETTINGS
            from ico3d.chat.natural.setup import prepare

            if settings is not None:
                raise SettingsError(f"--natural has settings of its own: copy {SETTINGS}.")
            prepare(self.yes)
            settings = SETTINGS
        where = (self.host, self.port, settings, self.persona)
        Serve(demo, *where, browser=self.browser, open=self.open, verbose=self.verbose).run()


def with_origins(embedding: "Embedding", origins: tuple[str, ...]) -> "Embedding":
    """Settings with further sites that may embed the avatar."""
    return replace(embedding, origins=(*embedding.origins, *origins))


def described(services, offers) -> list[str]:
    """The services in use, one line each, and better ones with what they still need."""
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
        lines.append("  natural, in English, for about 265 MB more: ico3d demo --natural")
    return lines
