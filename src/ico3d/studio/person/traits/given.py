"""Gives a synthetic person traits that are asked for."""

from collections.abc import Sequence
from dataclasses import replace

from ico3d.studio.person.subject import Subject
from ico3d.studio.person.traits.beard import bearded
from ico3d.studio.person.traits.glasses import with_glasses
from ico3d.studio.person.traits.names import TraitName

DARK = {
    "skin": (0.072, 0.036, 0.022),
    "lips": (0.105, 0.045, 0.040),
    "hair": (0.006, 0.005, 0.004),
    "iris": (0.030, 0.014, 0.008),
    "freckles": 0.0,
}
"""Colours of dark skin, and what goes with it, in linear RGB."""


def with_traits(subject: Subject, traits: Sequence[TraitName]) -> Subject:
    """The person with dark skin, a beard or glasses, where asked for.

    Long hair and a child's head are part of how the person is loaded.
    """
    if "dark-skin" in traits:
        subject = replace(subject, look=replace(subject.look, **DARK))
    if "beard" in traits:
        subject = bearded(subject)
    if "glasses" in traits:
        subject = with_glasses(subject)
    return subject
