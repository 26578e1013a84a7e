"""Speech sounds in time, and the output of a model that tells how long they last."""

import numpy as np
import pytest

from ico3d.chat.services.voice.hibari import with_output
from ico3d.chat.services.voice.phonemes import timed
from ico3d.common.espeak.speech import Phoneme
from ico3d.common.visemes import visemes


def test_marks_belong_to_a_sound_and_punctuation_is_a_pause():
    lasting = [
        ("^", 1),
        ("ˈ", 1),
        ("p", 2),
        ("ɑ", 1),
        ("ː", 1),
        (" ", 1),
        ("m", 1),
        (".", 2),
        ("$", 1),
    ]
    assert timed(lasting) == (
        Phoneme(0, ""),
        Phoneme(1, "ˈp"),
        Phoneme(4, "ɑː"),
        Phoneme(7, "m"),
        Phoneme(8, ""),
    )
    assert [visemes(p.symbol)[0] for p in timed(lasting)] == ["sil", "PP", "aa", "PP", "sil"]


def test_nothing_said_has_no_sounds():
    assert timed([]) == ()
    assert timed([("ˈ", 1)]) == ()


def test_a_model_gives_an_inner_tensor_too():
    onnx = pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    nodes = [
        helper.make_node("Neg", ["x"], ["/inner"]),
        helper.make_node("Exp", ["/inner"], ["y"]),
    ]
    given, made = (helper.make_tensor_value_info(name, kind, [2]) for name in "xy")
    graph = helper.make_graph(nodes, "model", [given], [made])
    opset = [helper.make_opsetid("", 17)]
    model = helper.make_model(graph, opset_imports=opset, ir_version=9).SerializeToString()
    session = runtime.InferenceSession(with_output(model, "/inner"))
    x = np.array([1, -2], np.float32)
    outer, inner = session.run(None, {"x": x})
    np.testing.assert_array_equal(inner, -x)
    np.testing.assert_allclose(outer, np.exp(-x), rtol=1e-6)
