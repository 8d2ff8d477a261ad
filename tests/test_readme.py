"""The README's Python examples run as they stand, one after the other."""

import re
from pathlib import Path

import numpy as np

README = Path(__file__).parents[1] / "README.md"


def test_the_examples_run(full_genome):
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)
    assert len(blocks) >= 6
    body = np.array([[0] * 5, [0, 2, 1, 2, 0], [0, 4, 1, 4, 0], [0, 4, 1, 4, 0], [0] * 5])
    names = {
        "grid": body[1:4, 1:4],
        "scene": None,
        "bodies": np.broadcast_to(body, (4096, 5, 5)),
        "vector": full_genome,
        "genomes": full_genome[None],
    }
    for block in blocks:
        exec(compile(block, str(README), "exec"), names)
    assert names["result"].fitness.shape == (1,)
    assert names["scene"].light == (20.0, 30.0)
    assert names["states"].shape == (10, 5, 5, 12)
    assert names["reward"] > 0.0
    assert names["observations"].shape == (4096, 5, 5)
