"""Training: the loop of section 5, its logs, and its settings for Hydra.

- ``trainer``: ask, evaluate, add, tell, crown, log, save.
- ``search``: the optimizer with its archive and scenarios; ``start``: the genome it starts from.
- ``selection``: the champion; ``generation`` and ``state``: what one generation and the run count.
- ``files``: saving and resuming; ``versions``: of what decides a run's numbers.
- ``signals``: polite stopping; ``timing``: seconds of each phase.
- ``logs`` and ``tensorboard``: curves and pictures; ``summary``: the closing lines.
- ``hydra``: the schema and the command line of ``train.py``.
"""
