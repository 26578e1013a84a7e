"""The file `animation.json`: what is written is read again, and nonsense is refused."""

import json

import pytest

from ico3d.bundle.animation import Action, Animation, Rest
from ico3d.errors import BundleError
from support.bundles.random_body import body_manifest, random_windows

VALID = {
    "version": 1,
    "fps": 15.0,
    "num_frames": 41,
    "rest": {"start": 0, "end": 13},
    "actions": [{"frame": 20, "score": 0.8}, {"frame": 31, "score": 1}],
    "min_speed": 0.6,
    "max_speed": 1.2,
}


def test_it_is_read_as_written():
    animation = Animation.from_bytes(json.dumps(VALID).encode())
    assert animation == Animation(15.0, 41, Rest(0, 13), (Action(20, 0.8), Action(31, 1.0)))
    assert json.loads(animation.to_bytes()) == VALID
    assert Animation.from_bytes(animation.to_bytes()) == animation
    assert animation.seconds == 40 / 15


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"version": 2}, "version must be 1."),
        ({"fps": 0}, "fps must lie between 0.1 and 1000."),
        ({"fps": 1e-7}, "fps must lie between 0.1 and 1000."),
        ({"fps": 1, "num_frames": 7202}, "num_frames must last 7200 s at most."),
        ({"min_speed": 1e-7}, "min_speed must lie between 0.05 and 4."),
        ({"num_frames": 1}, "num_frames must lie between 2 and 1000000."),
        ({"num_frames": 41.5}, "animation.json.num_frames must be a whole number, not a number."),
        ({"rest": {"start": 0, "end": 41}}, "rest.end must lie between 1 and 40."),
        ({"rest": {"start": 13, "end": 13}}, "rest.end must lie between 14 and 40."),
        ({"rest": {"start": -1, "end": 13}}, "rest.start must lie between 0 and 39."),
        ({"rest": {"start": 1}}, "animation.json.rest lacks 'end'."),
        ({"actions": [{"frame": 41, "score": 1}]}, "actions[0].frame must lie between 0 and 40."),
        ({"actions": [{"frame": 4, "score": 2}]}, "actions[0].score must lie between 0 and 1."),
        ({"actions": 2 * [{"frame": 4, "score": 1}]}, "actions[1].frame must be there only once."),
        (
            {"actions": [{"frame": 0, "score": 0}] * 1001},
            "actions must be at most 1000.",
        ),
        ({"actions": {}}, "animation.json.actions must be a list, not an object."),
        ({"min_speed": 0}, "min_speed must lie between 0.05 and 4."),
        ({"max_speed": 0.5}, "max_speed must lie between min_speed and 4."),
        ({"max_speed": 5}, "max_speed must lie between min_speed and 4."),
        ({"speed": 1}, "animation.json has the unknown key 'speed'."),
    ],
)
def test_nonsense_is_one_sentence(change, sentence):
    with pytest.raises(BundleError) as error:
        Animation.from_bytes(json.dumps(VALID | change).encode())
    text = str(error.value)
    assert text in (sentence, f"animation.json: {sentence}")


@pytest.mark.parametrize("data", [b"", b"{", b"[]", b'{"a": NaN}', b"\xff", b" " * (1 << 21)])
def test_what_is_no_animation_is_refused(data):
    with pytest.raises(BundleError, match=r"animation\.json") as error:
        Animation.from_bytes(data)
    assert "\n" not in str(error.value)


def test_it_must_belong_to_the_body():
    body = body_manifest(random_windows()).body
    fitting = Animation(15.0, 7, Rest(0, 2), ())
    fitting.check_body(body)
    for other, what in (
        (Animation(15.0, 8, Rest(0, 2), ()), "frames"),
        (Animation(25.0, 7, Rest(0, 2), ()), "fps"),
    ):
        with pytest.raises(BundleError, match=what):
            other.check_body(body)
