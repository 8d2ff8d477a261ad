"""The engine on GPUs, by numba-cuda: the physics of ``ncrs_envs.batched``, and kernels around it.

- ``engine``, ``devices``: the engine, and which GPUs it can use.
- ``part``: growth and rollout of part of a population on one GPU.
- ``growth``, ``rollout``, ``contacts``: the kernels.
- ``layout``: their arguments, and where numbers lie in shared memory.
- ``gpu``, ``register_tiles``, ``simulated_tiles``: all that is numba-cuda's own, and its twins for
  numba-cuda's simulator.

Source: paper sections 3 to 5, as the engine ``batched``.
"""
