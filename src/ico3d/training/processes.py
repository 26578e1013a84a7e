"""Starts worker processes that have already imported what they need."""

import multiprocessing
from multiprocessing.context import ForkServerContext


def fork_server(module: str) -> ForkServerContext:
    """A multiprocessing context whose processes are forked from one clean, prepared process.

    The prepared process has imported `module` and done nothing else. Forking avoids seconds of
    imports, and the copy has neither the threads nor the CUDA context of the calling process, which
    a plain fork would not survive.

    Args:
        module: The module that the processes need; only the first call in a process has an effect.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([module, "torch.utils.tensorboard"])
    return context
