"""Which body somebody chose, and whose files count."""

from ico3d.avatar.embodying.look import Look
from ico3d.recording.keeping.body_choice import HEAD_ALONE, BodyChoice, read_choice, write_choice
from support.strangers.not_ours import replacements


def test_what_lies_elsewhere_is_no_choice(tmp_path):
    choice = BodyChoice(True, Look("slender", "wine"))
    write_choice(tmp_path, choice)
    for _ in replacements(tmp_path / "body.json"):
        assert read_choice(tmp_path, HEAD_ALONE) == HEAD_ALONE
    assert read_choice(tmp_path, HEAD_ALONE) == choice
