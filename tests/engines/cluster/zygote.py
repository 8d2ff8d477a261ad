"""Run as a program: forks Dask schedulers and workers, a line of input each; prints their ids.

A new interpreter takes seconds of processor time to import what a worker needs; a fork takes none.
Each line is a JSON object with "kind", "file" (the scheduler file), and for a worker "harm": a
change to it, by the name of a function below.
"""

import asyncio
import json
import os
import signal
import sys
import time

import numba
from distributed import Scheduler, Worker

from ncrs.engines.base import make_engine
from ncrs.engines.cluster import station
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings


def version():
    numba.__version__ = "0.1"


def slowness():
    evaluate = station._Station.roll_out

    def slowly(self, shard):
        time.sleep(0.02 * len(shard.genomes))
        return evaluate(self, shard)

    station._Station.roll_out = slowly


def arithmetic():
    """Add the smallest possible error to every fitness."""
    evaluate = station._Station.roll_out

    def wrongly(self, shard):
        result = evaluate(self, shard)
        result.episode_fitness[:] += 2**-50
        return result

    station._Station.roll_out = wrongly


async def serve(kind, file):
    options = {"dashboard": False}
    if kind == "scheduler":
        server = Scheduler(
            host="127.0.0.1",
            port=0,
            scheduler_file=file,
            dashboard_address="127.0.0.1:0",
            **options,
        )
    else:
        server = Worker(
            scheduler_file=file, host="127.0.0.1", nthreads=1, memory_limit=0, death_timeout=30,
            **options,
        )  # fmt: skip
    async with server:
        await server.finished()


def main():
    settings = TaskSettings("light_chase")
    with make_engine("batched", settings, 1) as engine:  # loads the kernels
        engine.evaluate(
            [[0.0] * engine.layout.num_parameters], sample_scenarios("light_chase", 0, 2)
        )
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for what was killed
    for line in sys.stdin:
        request = json.loads(line)
        process = os.fork()
        if not process:
            os.close(0)
            for stream in (1, 2):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
            if request.get("harm"):
                globals()[request["harm"]]()
            asyncio.run(serve(request["kind"], request["file"]))
            os._exit(0)
        print(process, flush=True)


if __name__ == "__main__":
    main()
