"""What a bundle says of somebody whose head and body come from different people."""

from ico3d.avatar.embodying.look import UNCHANGED, Look
from ico3d.bundle.people.provenance import Part, Provenance
from ico3d.common.people.stated import BETWEEN, NOT_STATED, is_stated


def told_together(head: Provenance, body: Provenance, look: Look = UNCHANGED) -> Provenance:
    """The provenance of the head of one person on the body of another.

    Only people who exist can agree: where one part is synthetic, consent and likeness are those of
    the other.

    Args:
        head: Of the head's bundle.
        body: Of the body's bundle.
        look: How the body was changed.
    """
    both = (head, body)
    shown = [one for one in both if not one.is_synthetic] or [head]
    agreed = [one.consent for one in shown]
    makers = [one.made_by for one in both if is_stated(one.made_by)]
    return Provenance(
        kind=_once([one.kind for one in both], ", "),
        sources=tuple(dict.fromkeys(source for one in both for source in one.sources)),
        consent=_once(agreed) if all(map(is_stated, agreed)) else NOT_STATED,
        licence=_once([one.licence for one in both]),
        likeness=_once([one.likeness for one in shown]),
        made_by=_once(makers) or NOT_STATED,
        made_on=head.made_on,
        parts=(
            Part("head", head.kind, head.likeness),
            look.told(body.kind, body.likeness),
        ),
        voice=head.voice,
    )


def _once(values: list[str], between: str = BETWEEN) -> str:
    """What is said, each of it once."""
    return between.join(dict.fromkeys(values))
