"""Weights as users have them, small or random, in the published formats."""

from pathlib import Path

import torch

from ico3d.speech.network import AudioEncoder


def write_ave(folder: Path, prefix: str = "audio_encoder.") -> AudioEncoder:
    """SyncTalk's file with random weights."""
    torch.manual_seed(1)
    network = AudioEncoder().eval()
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            torch.nn.init.uniform_(module.running_var, 0.2, 0.6)
            torch.nn.init.normal_(module.running_mean, std=0.1)
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
            torch.nn.init.normal_(module.bias, std=0.1)
    state = {prefix + name: value for name, value in network.state_dict().items()}
    torch.save(state, folder / "audio_visual_encoder.pth")
    return network


def write_hubert(models: Path):
    """A small random HuBERT as the published folder: CTC head, old names of the weight norm."""
    import transformers

    torch.manual_seed(0)
    config = transformers.HubertConfig(
        hidden_size=32,
        num_hidden_layers=2,
        num_attention_heads=2,
        intermediate_size=64,
        conv_dim=(16,) * 7,
        conv_bias=True,
        feat_extract_norm="layer",
        do_stable_layer_norm=True,
        num_conv_pos_embeddings=16,
        num_conv_pos_embedding_groups=4,
        initializer_range=0.3,
    )
    folder = models / "hubert-large-ls960-ft"
    folder.mkdir()
    model = transformers.HubertForCTC(config)
    old = {"parametrizations.weight.original0": "weight_g"}
    old |= {"parametrizations.weight.original1": "weight_v"}
    state = {}
    for name, value in model.state_dict().items():
        for new, former in old.items():
            name = name.replace(new, former)
        state[name] = value
    assert "hubert.encoder.pos_conv_embed.conv.weight_g" in state
    torch.save(state, folder / "pytorch_model.bin")
    config.save_pretrained(folder)
    return folder, model.eval()
