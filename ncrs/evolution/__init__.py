"""The search. Source: paper section 5.

- ``archive``: one elite for each triple of measures.
- ``objective``: the number that an optimizer maximises.
- ``standstill``: the fitness of a robot that never moves.
- ``reestimation``: new estimates of all elites on fresh scenarios.
- ``space``: the points that an optimizer moves among, and the genomes they stand for.
- ``optimizers``: CMA-ES, CMA-ME, CMA-MAE and MAP-Elites behind one ask-and-tell interface.
"""
