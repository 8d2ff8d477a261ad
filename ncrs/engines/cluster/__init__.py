"""Engines that spread one population over many machines.

- ``records``: what travels: shards of genomes with the seed of their scenarios, and results.
- ``station``: what a worker does with a shard.
- ``crew``: interface of the workers of a cluster, and their admission by version.
- ``dispatch``: the evaluation of one population: sending, taking over, gathering by index.
- ``audit``: genomes that are evaluated on a second worker.
- ``sharded``: the engine on top of these.
- ``dask``, ``dask_crew``, ``local``: on a Dask cluster, or on processes of this computer.
- ``futures``: on any executor of the shape of ``concurrent.futures``.
"""
