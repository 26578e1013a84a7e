"""Folders of models that somebody else made: templates without an end, claims without weights."""

import json
import shutil
import time
from pathlib import Path

import pytest
from safetensors.torch import load_file, save_file

from ico3d.chat.services.language.hub import qwen
from ico3d.errors import ModelError
from support.needs import needs

pytestmark = [needs("transformers"), pytest.mark.slow]
ENDLESS = "{% for a in range(99999) %}{% for b in range(99999) %}{% endfor %}{% endfor %}"
DOUBLING = (
    "{% set n = namespace(x='ab') %}{% for a in range(60) %}{% set n.x = n.x ~ n.x %}{% endfor %}"
)


@pytest.fixture
def copy(folder, tmp_path):
    """The folder of a good model, to be spoilt."""
    return Path(shutil.copytree(folder, tmp_path / "copy"))


def told(folder, name="config.json", **claims):
    """A folder whose settings claim something else."""
    settings = json.loads((folder / name).read_text()) | claims
    (folder / name).write_text(json.dumps(settings))
    return folder


def load(folder):
    from ico3d.chat.services.language.hub.in_process import load

    return load(folder)


@pytest.mark.parametrize("template", [ENDLESS, DOUBLING])
def test_a_template_without_an_end_is_refused_before_anybody_talks(copy, template, monkeypatch):
    from ico3d.chat.services.language.hub import prompts

    monkeypatch.setattr(prompts, "SECONDS", 3.0)
    (copy / "chat_template.jinja").write_text(template)
    with pytest.raises(ModelError, match="takes too much time or memory"):
        load(copy)


def test_a_template_that_waits_for_a_word_costs_one_question(copy):
    with (copy / "chat_template.jinja").open("a") as template:
        template.write("{% if messages[0].content == 'now' %}" + ENDLESS + "{% endif %}")
    made = load(copy).prompts
    assert made.of([{"role": "user", "content": "later"}]).endswith("assistant\n")
    made._writer.longest = 1.0
    for least, most in ((1.0, 30.0), (0.0, 1.0)):
        begun = time.monotonic()
        with pytest.raises(ModelError, match="takes too much time or memory"):
            made.of([{"role": "user", "content": "now"}])
        assert least <= time.monotonic() - begun <= most


@pytest.mark.parametrize(
    ("claims", "sentence"),
    [
        ({"vocab_size": 40_000_000}, "claims a larger model than its weights are"),
        ({"intermediate_size": 1 << 30}, "claims a larger model than its weights are"),
        ({"num_hidden_layers": 10**9}, "num_hidden_layers is 1000000000, 1024 at most"),
        ({"num_hidden_layers": 1000, "layer_types": None}, "claims a larger model than its"),
        ({"model_type": "nothing"}, "does not hold a language model"),
    ],
)
def test_what_a_folder_claims_is_held_by_its_weights(copy, claims, sentence):
    with pytest.raises(ModelError, match=sentence):
        load(told(copy, **claims))


def test_nothing_that_is_missing_is_made_up(copy):
    tensors = load_file(copy / "model.safetensors")
    del tensors["model.layers.1.mlp.up_proj.weight"]
    save_file(tensors, copy / "model.safetensors", {"format": "pt"})
    with pytest.raises(ModelError, match=r"lacks model.layers.1.mlp.up_proj.weight"):
        load(copy)


def test_a_model_says_how_it_is_sampled_and_nothing_that_costs_memory(copy):
    how = {"num_beams": 4096, "num_return_sequences": 4096, "do_sample": True, "temperature": 0.5}
    chosen = load(told(copy, "generation_config.json", **how)).model.generation_config
    assert (chosen.num_beams or 1, chosen.num_return_sequences or 1) == (1, 1)
    assert (chosen.do_sample, chosen.temperature) == (True, 0.5)
    assert chosen.eos_token_id is not None


def test_rules_of_a_tokenizer_make_no_text_much_longer(copy):
    usual = [{"type": "Prepend", "prepend": "▁"}, {"type": "Replace", "content": "▁"}]
    doubling = {"type": "Replace", "pattern": {"String": "zq"}, "content": "zqzq"}
    for rules in ([doubling] * 40, [doubling | {"content": "zq" * 9}]):
        told(copy, "tokenizer.json", normalizer={"type": "Sequence", "normalizers": rules})
        with pytest.raises(ModelError, match="could make a text longer without an end"):
            load(copy)
    told(copy, "tokenizer.json", normalizer={"type": "Sequence", "normalizers": usual})
    from ico3d.chat.services.language.hub import loading

    loading._check_tokenizer(copy / "tokenizer.json")


def test_a_name_on_the_hub_is_no_folder_where_a_server_is_started(copy, tmp_path, monkeypatch):
    import huggingface_hub.constants

    monkeypatch.setattr(huggingface_hub.constants, "HF_HUB_CACHE", str(tmp_path / "hub"))
    (tmp_path / "Qwen").mkdir()
    copy.rename(tmp_path / "Qwen" / "Qwen2-0.5B-Instruct")
    monkeypatch.chdir(tmp_path)
    name = "Qwen/Qwen2-0.5B-Instruct"
    assert qwen.source(qwen.Settings(name), False) is None
    assert qwen.source(qwen.Settings(f"./{name}"), False) == tmp_path / name
    assert qwen.detail(qwen.Settings(f"./{name}")) == "Qwen2-0.5B-Instruct"
