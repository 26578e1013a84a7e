"""A Qwen2 of some thousand weights in the real format, that has learnt one answer by heart."""

import torch
from tokenizers import Tokenizer, decoders, models, pre_tokenizers, trainers
from transformers import GenerationConfig, PreTrainedTokenizerFast, Qwen2Config, Qwen2ForCausalLM

START, END, TEXT_END = "<|im_start|>", "<|im_end|>", "<|endoftext|>"
TEMPLATE = (  # Qwen2's
    "{% for message in messages %}{{'<|im_start|>' + message['role'] + '\n' + message['content'] +"
    " '<|im_end|>' + '\n'}}{% endfor %}{% if add_generation_prompt %}{{ '<|im_start|>assistant\n'"
    " }}{% endif %}"
)


def make_tokenizer(text):
    """Byte-level BPE whose merges make a token of every word of `text`."""
    tokenizer = Tokenizer(models.BPE())
    tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    tokenizer.decoder = decoders.ByteLevel()
    trainer = trainers.BpeTrainer(
        special_tokens=[TEXT_END, START, END],
        initial_alphabet=pre_tokenizers.ByteLevel.alphabet(),
        min_frequency=1,
        show_progress=False,
    )
    tokenizer.train_from_iterator([text, "system user assistant"] * 2, trainer)
    return PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, eos_token=END, pad_token=TEXT_END, chat_template=TEMPLATE
    )


def write_tiny_qwen(folder, answer, for_ever=False):
    """Saves weights and tokenizer of a model that says `answer`, whatever it is asked.

    Args:
        folder: Where to.
        answer: Its words must differ from each other.
        for_ever: Whether it says it over and over.
    """
    torch.manual_seed(0)
    tokenizer = make_tokenizer(answer)
    config = Qwen2Config(
        vocab_size=len(tokenizer),
        hidden_size=32,
        intermediate_size=64,
        num_hidden_layers=2,
        num_attention_heads=4,
        num_key_value_heads=2,
        max_position_embeddings=4096,
        eos_token_id=tokenizer.eos_token_id,
        pad_token_id=tokenizer.pad_token_id,
        bos_token_id=None,
    )
    model = Qwen2ForCausalLM(config)
    said = tokenizer(answer)["input_ids"]
    assert len(set(said)) == len(said)
    following = said * 4 if for_ever else [*said, tokenizer.eos_token_id]
    learn(model, tokenizer, following)
    model.generation_config = GenerationConfig(
        do_sample=False, eos_token_id=config.eos_token_id, pad_token_id=config.pad_token_id
    )
    model.save_pretrained(folder)
    tokenizer.save_pretrained(folder)


def learn(model, tokenizer, following):
    """Teaches what follows the prompt, however long that is and whatever it says."""
    optimizer = torch.optim.AdamW(model.parameters(), 1e-2)
    opening = tokenizer(f"{START}assistant\n")["input_ids"]
    for _ in range(80):
        asked = torch.randint(0, len(tokenizer), (4, int(torch.randint(5, 60, ()))))
        learnt = torch.tensor([opening + following]).expand(4, -1)
        ids = torch.cat([asked, learnt], 1)
        labels = ids.clone()
        labels[:, : -len(following)] = -100
        loss = model(input_ids=ids, labels=labels).loss
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss < 0.05, "it has not learnt its answer"
