"""Why the studio page's server refuses something, as sentences that the page translates."""

from collections.abc import Sequence

from ico3d.creating.looking.advice import Advice
from ico3d.errors import Ico3dError


class Refused(Ico3dError):
    """A request of the studio page that is not done; what was recorded before is kept.

    Attributes:
        code: Name of the sentence; the page's own words for it are those of `studio.refused.CODE`.
        status: Status of the HTTP answer.
        advice: What is wrong with a video, where that is why.
    """

    def __init__(self, code: str, text: str, status: int = 400, advice: Sequence[Advice] = ()):
        """Takes the sentence in English, for pages that have none of their own."""
        super().__init__(text)
        self.code, self.status, self.advice = code, status, tuple(advice)


def bad_name() -> Refused:
    """A name that is none."""
    return Refused(
        "name", "a name has 1 to 40 letters, digits, spaces and hyphens, and begins with a letter."
    )


def full_disk() -> Refused:
    """A disk without room."""
    return Refused(
        "full", "the disk is full: free some space and go on; what was recorded is kept.", 507
    )


def no_video() -> Refused:
    """A file of another kind."""
    return Refused("no-video", "this file is no video: choose an MP4, MOV, WebM or AVI.", 415)


def nothing_arrived() -> Refused:
    """A take of which there is nothing, or nothing any more."""
    text = "nothing of this part has arrived: record it again."
    return Refused("unknown", text, 404)


def costly() -> Refused:
    """A video that would hold up the server."""
    text = "looking at this video takes more time or memory than is given to it: convert it to MP4."
    return Refused("costly", text, 422)


def unusable(refused: Sequence[Advice]) -> Refused:
    """A video of which no avatar can be made, with the sentences of `ico3d create`."""
    return Refused("unusable", " ".join(map(str, refused)), 422, refused)
