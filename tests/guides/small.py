"""The only things in which the guides' commands differ when they are tested: their size.

Each command of a guide runs as it stands there, with these words behind it.
"""

STEPS = "steps=40 initial_gaussians=500 max_gaussians=600 densify_from=20 densify_every=20"
SMALL = {
    "capture portrait": "--no-refine",
    "train head": f"--set {STEPS} hidden=16 features=8",
    "assemble": "--set steps_per_frame=5 warmup_steps=10 finetune_steps=10 color_steps=10 "
    "initial_gaussians=300 max_gaussians=400 border_points=60 densify_from=10 grid_space=8",
    "bake": "--force",  # what has hardly been trained breaks the bounds of quality
    "render": "--size 64 --fps 5",
    "serve": "--port 0 --no-open",
    "demo": "--port 0 --no-open",
    "serve-module": "--port 0 --host 127.0.0.1",
}
