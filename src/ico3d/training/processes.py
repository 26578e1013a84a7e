"""Processes that begin with everything imported."""

import multiprocessing
from multiprocessing.context import ForkServerContext


def fork_server(module: str) -> ForkServerContext:
    """Starts processes as copies of one that has imported what they need and has done nothing.

    Importing takes seconds, a copy does not; and such a copy has neither the threads nor the CUDA
    context of the process that asks for it, which a plain fork would not survive.

    Args:
        module: What the processes need. The first call decides for all.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([module, "torch.utils.tensorboard"])
    return context
