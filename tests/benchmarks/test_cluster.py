"""The model of a cluster's costs, and a small run of the benchmark."""

import dataclasses
import json

import pytest

pytest.importorskip("distributed", reason="needs the extra cluster")

from benchmarks.cluster import Costs, efficiency, main, report, shards

COSTS = Costs(genome=0.004, shard=0.002, transfer=0.0001, message=0.01)


def test_one_worker_sends_little_and_waits_for_two_messages():
    assert shards(112, 1, 1) == 9
    ideal = 112 * 0.004
    assert efficiency(COSTS, 112, 1, 1) == pytest.approx(ideal / (ideal + 0.02))


def test_the_sender_is_the_limit_of_many_workers():
    # 512 workers of one thread get 16 genomes each, in one shard.
    assert shards(8192, 512, 1) == 512
    ideal, sending = 8192 * 0.004 / 512, 512 * 0.002 + 8192 * 0.0001
    assert efficiency(COSTS, 8192, 512, 1) == pytest.approx(ideal / (sending + 0.01))


def test_free_messages_lose_nothing():
    free = dataclasses.replace(COSTS, shard=0.0, transfer=0.0, message=0.0)
    assert efficiency(free, 1024, 64, 4) == pytest.approx(1.0)


def test_the_table_has_measured_and_predicted_efficiencies():
    row = {
        "population": 1024, "batched_s": 2.0, "dask_s": 2.5, "efficiency": 0.8, "shards": 32,
    }  # fmt: skip
    lines = report({"workers": 2, "rows": [row], "costs": dataclasses.asdict(COSTS)})
    expected = efficiency(COSTS, 1024, 2, 1)
    (line,) = [line for line in lines if line.split()[:1] == ["1,024"] and "2.500" in line]
    assert line.split() == ["1,024", "2.000", "2.500", "32", "80%", f"{expected:.0%}"]
    assert "  genome       4.000" in lines
    assert lines[-1].split()[0] == "100,000"


@pytest.mark.slow
def test_a_small_run(capsys):
    main(["--json", "--populations", "8", "--workers", "1", "--repeats", "1"])
    result = json.loads(capsys.readouterr().out)
    (row,) = result["rows"]
    assert row["efficiency"] == pytest.approx(row["batched_s"] / row["dask_s"])
    assert all(value > 0.0 for name, value in result["costs"].items() if name != "transfer")
