"""The automaton that grows a robot and drives it. Source: paper section 3.

- ``channels``: meaning of each channel and weight, and their order in the genome.
- ``device_genomes``: genomes in the memory of a GPU.
- ``nca``: the update rule, for one genome (``NCA``) or a population (``NCAPopulation``).
- ``growth``: from the seed cell to a body (section 3.1).
- ``grow_to``: from a body to a genome that grows it.
- ``control``: from sensors to wheels, with a copy of the automaton in every cell (section 3.2).
- ``circuit``: from signals between cells to weights that drive a robot, for genomes by hand.
- ``carrier``: a robot by hand that carries the ball.
- ``transfer``: from a genome of one task to one for the channels of another.
"""
