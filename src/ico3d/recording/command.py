"""The verb `ico3d studio`."""

import os
import sys
import webbrowser
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ico3d.avatar.embodying.builds.names import MEDIUM, BuildName
from ico3d.avatar.embodying.look import AS_RECORDED, Look, OutfitName, check_look
from ico3d.bundle.packaged import NAME
from ico3d.errors import printable

OWN = 0o077
"""Umask of the server and of all that it starts: faces are for who records them, not for all users
of the machine."""


@dataclass(frozen=True)
class Studio:
    """Opens a page on which somebody records themselves and gets their avatar.

    Everything that is recorded and made lies below the folder, and the page deletes it, too.

    Attributes:
        folder: Where recordings and avatars are, a folder for each person.
        host: Address to listen on; with 127.0.0.1 other machines cannot reach the page.
        port: Port to listen on; 0 takes any free port.
        tls: Serve by HTTPS, as browsers demand before they give the camera to another machine's
            page, with a certificate that this machine makes, keeps and renews.
        browser: Open the page in a browser.
        body: A whole person on a skeleton, whose body stands in for that of everybody who does not
            choose otherwise on the page; `demo` is the avatar of the package. By default avatars
            are heads alone for those, and who chooses a body gets that of the packaged avatar.
        build: Build of that body, unless somebody chooses another; `medium` is the recorded one.
        outfit: Colours of its clothes, likewise; `recorded` are those that were.
        voice: Ask people, too, whether the avatar may speak with their voice: a tick of its own,
            off unless they set it. Their voice is then cloned where OpenVoice is installed.
    """

    folder: Annotated[Path, tyro.conf.Positional] = Path("recordings")
    host: str = "127.0.0.1"
    port: int = 8766
    tls: bool = False
    browser: bool = True
    body: Path | None = None
    build: BuildName = MEDIUM
    outfit: OutfitName = AS_RECORDED
    voice: bool = False

    def run(self) -> None:
        """Serves until interrupted.

        Raises:
            BundleError: If the body cannot be used.
            SettingsError: If others could come without HTTPS, the port is taken, the folder cannot
                be made or another studio serves it, or heads alone are to have a build or an
                outfit.
        """
        from ico3d.chat.observing.operator_log import set_up_log

        set_up_log(verbose=False)  # before what logs as soon as it is imported
        from ico3d.avatar.embodying.embody import body_in
        from ico3d.bundle.format import Bundle
        from ico3d.chat.serving import server
        from ico3d.chat.serving.guard import LOOPBACK
        from ico3d.chat.serving.network.reach import find_reach, fragment
        from ico3d.chat.serving.sites import open_sites, shown_key
        from ico3d.chat.settings.embedding import Embedding
        from ico3d.creating.voice.clone import hindrance
        from ico3d.errors import SettingsError
        from ico3d.recording.app import make_app, open_room
        from ico3d.recording.keeping.body_choice import BodyChoice
        from ico3d.recording.keeping.people import held
        from ico3d.recording.making.makers import Bodies

        look = Look(self.build, self.outfit)
        check_look(self.body, look)
        if self.body is not None:
            body_in(Bundle.open(self.body), look)  # said before somebody records themselves
        if self.host not in LOOPBACK and not self.tls:
            raise SettingsError(
                f"--host {self.host}: browsers give their camera only to HTTPS pages, and the key "
                "must not travel unencrypted. Add --tls."
            )
        reach = find_reach(self.host, (), self.tls, None, None)
        key = shown_key(reach.is_public, False, Embedding())
        sites = open_sites(Embedding(), key or "")
        os.umask(OWN)
        listener = server.bind(self.host, self.port)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = held(self.folder)  # until this process ends
            where = (self.folder.absolute(), self.host, self.tls)
            bodies = Bodies(self.body or Path(NAME), BodyChoice(self.body is not None, look))
            room = open_room(*where, bodies, self.voice)
        except OSError as error:
            raise SettingsError(f"{self.folder} cannot be written ({error.strerror}).") from error
        app = make_app(room, self.host, sites, reach.answered)
        url = server.address(listener, reach.scheme)
        server.listen(listener)
        print(f"The studio is at {url}{fragment(key)} (Ctrl+C ends)", flush=True)
        print("\n".join(reach.told(listener.getsockname()[1], key)))
        print(printable(f"Recordings and avatars are in {self.folder}"))
        if room.eye.lacking:
            print(f"Without guidance by the face: {room.eye.lacking}", file=sys.stderr)
        if self.voice and (lacking := hindrance()):
            print(f"Avatars are made without a voice of their own: {lacking}", file=sys.stderr)
        if not os.path.isfile(server.STATIC / "studio.html"):
            print("The page is not built: run `make viewer`.", file=sys.stderr)
        sys.stdout.flush()
        if self.browser:
            webbrowser.open(f"{url}{fragment(key)}")
        with lock:
            server.make_server(app, reach.certificate).run(sockets=[listener])
