"""The verb `ico3d create`."""

from dataclasses import dataclass

from ico3d.creating.settings import CreateSettings


@dataclass(frozen=True)
class Create(CreateSettings):
    """Makes an avatar of a video of somebody who talks. The same command goes on after a stop.

    The video is looked at first: what would make the avatar better is said with the second where
    it happens, and how long it takes.

    Attributes:
        serve: Talk with the avatar in the browser as soon as it is made.
    """

    serve: bool = False

    def run(self) -> None:
        """Makes the avatar; serves it if that is asked for.

        Raises:
            Ico3dError: As for `create`.
        """
        from ico3d.creating.create import create
        from ico3d.creating.telling import Terminal

        create(self, Terminal(self))
        if self.serve:
            from ico3d.chat.commands import Serve

            Serve(self.out, browser=True).run()
