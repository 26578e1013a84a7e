"""What the meter shows: seconds, sounds and turns of the parts that were kept."""

from pathlib import Path

from ico3d.recording.guiding.coverage import ENOUGH, covered
from ico3d.recording.keeping.person import Part
from ico3d.recording.keeping.plan import scripts


def _part(id, seconds, turn=None):
    return Part(id, Path(f"{id}.webm"), "", {"seconds": seconds, "turn": turn, "advice": []})


def test_texts_give_sounds_and_parts_give_time():
    broken = Part("text-2", Path("x"), "a1", None)
    parts = [_part("consent", 5.0), _part("text-1", 9.25), _part("upload", 70.0), broken]
    found = covered(parts, "en")
    english = scripts()["en"]
    assert (found.seconds, found.enough) == (9.2, ENOUGH)
    assert (found.sounds, found.of_sounds) == (len(english.heard[0]), len(english.sounds))
    everything = [_part(f"text-{n}", 10.0) for n in range(1, 7)]
    assert covered(everything, "en").sounds == len(english.sounds)


def test_turns_count_as_far_as_they_were_seen():
    found = covered([_part("text-1", 5, [-5.0, 10.0, -9.0, 4.5])], "de")
    assert found.turns == {"left": 0.5, "right": 0.25, "up": 0.5, "down": 1.0}
    more = [_part("text-1", 5, [-5.0, 10.0, 0.0, 0.0]), _part("left", 4, [0.0, 30.0, 1.0, 2.0])]
    assert covered(more, "de").turns["left"] == 1.0


def test_without_a_tracker_a_turn_counts_once_it_was_recorded():
    found = covered([_part("up", 4.0), _part("text-1", 4.0)], "de")
    assert found.turns == {"left": 0.0, "right": 0.0, "up": 1.0, "down": 0.0}
