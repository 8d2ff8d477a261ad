"""The automaton that grows a robot and drives it. Source: paper section 3.

- ``channels``: what each channel and each weight stands for; the genome's order.
- ``nca``: the update rule, one genome (``NCA``) or a population at once (``NCAPopulation``).
- ``growth``: from the seed cell to a body (section 3.1).
- ``control``: from sensors to wheels, a copy of the automaton in every cell (section 3.2).
- ``transfer``: a genome of one task for the channels of another.
"""
