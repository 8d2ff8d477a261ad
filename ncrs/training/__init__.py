"""Training: the loop of section 5, its logs, and its settings for Hydra.

- ``trainer``: ask, evaluate, add, tell, crown, log, save.
- ``start``: the genome that a search starts from; ``signals``: polite stopping.
- ``logs`` and ``tensorboard``: curves and pictures; ``summary``: the closing lines.
- ``hydra``: the schema and the command line of ``train.py``.
"""
