"""The only things in which the guides' commands differ when they are tested: their size.

Each command of a guide runs as it stands there, with these words behind it.
"""

HEAD = (
    "--steps 12 --initial.gaussians 300 --density.max-gaussians 400 --density.begin 6 "
    "--density.every 6 --network.hidden 16 --network.features 8"
)
BODY = (
    "--steps-per-frame 5 --warmup-steps 6 --finetune.steps 6 "
    "--initial.gaussians 300 --density.max-gaussians 400 --joining.border-points 60 "
    "--density.begin 10 --encoder.space 8"
)
SMALL = {
    "capture portrait": "--no-refine",
    "train head": HEAD,
    "assemble": BODY,
    "bake": "--force",  # what has hardly been trained breaks the bounds of quality
    "render": "--size 64 --fps 5",
    "serve": "--port 0 --no-browser",
    "demo": "--port 0 --no-browser",
    "serve-module": "--port 0 --host 127.0.0.1",
}
