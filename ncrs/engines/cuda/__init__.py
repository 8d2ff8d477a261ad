"""The engine on GPUs, by numba-cuda: the physics of ``ncrs_envs.batched``, and kernels around it.

- ``engine``, ``devices``: the engine, and which GPUs it can use.
- ``part``: growth and rollout of part of a population on one GPU.
- ``growth``, ``rollout``, ``contacts``: the kernels.
- ``layout``: their arguments, and where numbers lie in shared memory.
- ``tiles``, ``register_tiles``, ``simulated_tiles``: small matrices in a thread's registers, and
  their twins for numba-cuda's simulator.

What is numba-cuda's own beside them is in ``ncrs_envs.cuda.gpu``.

Source: paper sections 3 to 5, as the engine ``batched``.
"""
