"""Qwen2 models that are made once."""

import pytest

ANSWER = "My name is Ada. Nice to meet you, dear visitor!"


def made(folder, answer, **options):
    """A model's folder; transformers takes seconds to be imported."""
    from support.chat.tiny_qwen import write_tiny_qwen

    write_tiny_qwen(folder, answer, **options)
    return folder


@pytest.fixture(scope="session")
def answer():
    """What `folder` says."""
    return ANSWER


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A model that introduces itself, whatever it is asked."""
    return made(tmp_path_factory.mktemp("tiny"), ANSWER)


@pytest.fixture(scope="session")
def endless(tmp_path_factory):
    """A model that counts and does not stop."""
    return made(tmp_path_factory.mktemp("endless"), " one, two; three. Then", for_ever=True)


@pytest.fixture(scope="session", params=[False, True])
def thinker(request, tmp_path_factory):
    """A model that thinks aloud, whose thoughts the template may open; gives both facts."""
    thought = "Hmm who asks ◁/think▷"  # all words of a tiny model must differ, marks too
    opening = "" if request.param else "<reasoning>"
    folder = made(tmp_path_factory.mktemp("thinker"), opening + thought + ANSWER)
    if request.param:  # as that of some families does
        with (folder / "chat_template.jinja").open("a") as template:
            template.write("{% if add_generation_prompt %}<reasoning>\n{% endif %}")
    return folder, request.param
