from benchmarks import generation
from benchmarks.workload import nearly_full_genomes


def test_the_phases_of_a_generation_are_read_from_a_run(monkeypatch):
    monkeypatch.setattr(generation, "CHECKPOINT_SECONDS", 0.1)
    result = generation.measure("sep_cma_es", nearly_full_genomes("light_chase"), 2)
    assert result["rollout_s"] > result["checkpoint_s"] > 0.0
    phases = (result[name] for name in result if name.endswith("_s") and name != "total_s")
    assert abs(sum(phases) - result["total_s"]) < 1e-9
