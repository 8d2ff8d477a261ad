"""Training: the loop of section 5, its logs, and its settings for Hydra.

- ``trainer``: ask, evaluate, add, tell, crown, log, save.
- ``search``: the optimizer with its archive and scenarios; ``start``: the genome it starts from.
- ``selection``: the champion; ``generation`` and ``state``: the records of one and of the run.
- ``files``: saving and resuming; ``versions``: the libraries that determine a run's numbers.
- ``signals``: stopping at SIGINT and SIGTERM; ``timing``: seconds of each phase.
- ``logs`` and ``tensorboard``: curves and pictures; ``summary``: the closing lines.
- ``hydra``: the schema and the command line of ``train.py``.
"""
