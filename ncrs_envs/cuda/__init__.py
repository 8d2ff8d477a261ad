"""Environments on GPUs, by numba-cuda, and what the engine on GPUs shares with them.

- ``vector_env``: the environments, which take and return tensors of torch.
- ``fleet``: their memory on a GPU, and the launches of ``kernels``.
- ``gpu``, ``devices``: what is numba-cuda's own, and which GPUs can be used.
- ``tensors``: what is torch's own.
"""
