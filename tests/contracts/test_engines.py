"""Requirements on every engine."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from ncrs import load_champion
from ncrs.automaton.channels import CONTROL_CHANNEL, GenomeError, nca_layout
from ncrs.engines.base import (
    CUDA_ENGINE,
    DASK_ENGINE,
    ENGINES,
    FUTURES_ENGINE,
    EvaluationInterrupted,
    NonFiniteStateWarning,
    has_gpu,
    make_engine,
)
from ncrs.engines.cluster import futures
from ncrs.engines.evaluate import evaluate
from ncrs_envs.body import BodyError, body_measures
from ncrs_envs.scenario import Scenario, ScenarioError, sample_scenarios
from ncrs_envs.tasks import PAPER_TASKS, TASKS, TaskError, TaskSettings


@pytest.fixture(scope="module")
def cluster():
    """Two Dask workers in this process, which starts at once; messages go over TCP all the same."""
    distributed = pytest.importorskip("distributed", reason="needs the extra cluster")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as made:
        yield made.scheduler_address


# What travels and is gathered is the same code for both engines of a cluster.
ENGINE_PARAMETERS = [
    pytest.param(name, marks=pytest.mark.slow) if name == FUTURES_ENGINE else name
    for name in sorted(ENGINES)
]


@pytest.fixture(params=ENGINE_PARAMETERS)
def engine(request, monkeypatch):
    if request.param == CUDA_ENGINE and not has_gpu():
        pytest.skip("needs a GPU and numba-cuda; tests/engines/cuda runs the kernels without one")
    if request.param == FUTURES_ENGINE:  # tests/engines/cluster/test_futures.py starts processes
        monkeypatch.setattr(futures, "process_pool", ThreadPoolExecutor)
    if request.param == DASK_ENGINE:
        import dask

        address = request.getfixturevalue("cluster")
        with dask.config.set({"scheduler-address": address}):
            yield request.param
    else:
        yield request.param


def _result_arrays(evaluation):
    return {name: getattr(evaluation, name) for name in vars(evaluation)}


def _assert_equal(first, second, rows=slice(None)):
    for name, value in _result_arrays(first).items():
        np.testing.assert_array_equal(value[rows], getattr(second, name)[rows], err_msg=name)


@pytest.mark.parametrize("task", [task.name for task in PAPER_TASKS])
def test_shapes_dtypes_and_invalid_bodies(engine, task, genomes):
    length = nca_layout(task).num_parameters
    # The last genome is so small that its seed cell grows tissue only, if anything.
    vectors = np.concatenate([genomes(10, length), genomes(1, length, sigma=1e-6)])
    result = evaluate(vectors, task, engine=engine, episodes=3, seed=5)
    assert result.fitness.shape == (11,)
    assert result.episode_fitness.shape == result.success.shape == result.crossed.shape == (11, 3)
    assert result.bodies.shape == (11, 5, 5)
    assert result.measures.shape == (11, 3)
    assert result.fitness.dtype == np.float64
    assert result.success.dtype == result.valid.dtype == np.bool_
    assert result.bodies.dtype == np.int8
    invalid = ~result.valid
    assert invalid[-1]
    np.testing.assert_array_equal(result.measures[invalid], -1)
    np.testing.assert_array_equal(
        result.measures[result.valid], body_measures(result.bodies[result.valid])
    )
    credit = TASKS[task].partial_credit(result.bodies[invalid])
    np.testing.assert_allclose(result.fitness[invalid], credit, rtol=0, atol=1e-15)
    np.testing.assert_allclose(result.fitness, result.episode_fitness.mean(axis=1), rtol=1e-12)
    assert result.env_steps == result.valid.sum() * 3 * 100
    assert result.closest.shape == (11, 3, TASKS[task].distances)
    assert np.isinf(result.closest[invalid]).all()
    reached = result.closest[..., -1] <= TASKS[task].success_radius
    np.testing.assert_array_equal(result.success, reached)


@pytest.mark.parametrize("record_name", ["closed_loop_light_chase", "closed_loop_carry_ball"])
def test_closed_loop_fitness_of_the_published_implementation(
    engine, record_name, golden, golden_genome
):
    record = golden(record_name)
    task = record_name.removeprefix("closed_loop_")
    for prefix in (f"c{index:02d}" for index in range(5)):
        if task == "light_chase":
            scenarios = [Scenario((0.0, 0.0), light=light) for light in record[f"{prefix}_light"]]
        else:
            placements = (record[f"{prefix}_{key}"] for key in ("start", "ball_start", "target"))
            scenarios = [
                Scenario(start, ball=ball, target=target)
                for start, ball, target in zip(*placements, strict=True)
            ]
        score = "exponential" if task == "light_chase" else "inverse_square"
        result = evaluate(
            golden_genome(record, prefix),
            task,
            engine=engine,
            scenarios=scenarios,
            distance_score=score,
        )
        np.testing.assert_array_equal(result.bodies[0], record[f"{prefix}_body"])
        assert result.fitness[0] == pytest.approx(float(record[f"{prefix}_fitness"]), abs=1e-3)
        runs = record[f"{prefix}_rewards"].mean(axis=0)
        assert np.abs(result.episode_fitness[0] - runs).mean() <= 1e-3


def test_results_do_not_depend_on_workers_or_place(engine, genomes, full_genome):
    vectors = np.concatenate([genomes(9), full_genome[None]])
    scenarios = sample_scenarios("light_chase", 1, 4)
    first = evaluate(vectors, "light_chase", engine=engine, scenarios=scenarios, workers=1)
    second = evaluate(vectors, "light_chase", engine=engine, scenarios=scenarios, workers=2)
    _assert_equal(first, second)
    backwards = evaluate(
        vectors[::-1], "light_chase", engine=engine, scenarios=scenarios, workers=2
    )
    for name, value in _result_arrays(first).items():
        np.testing.assert_array_equal(value[::-1], getattr(backwards, name), err_msg=name)


@pytest.mark.parametrize("task", [task.name for task in PAPER_TASKS])
def test_an_episodes_score_does_not_depend_on_its_company(engine, task):
    genome = load_champion(f"{task}/best").genome
    scenarios = sample_scenarios(task, 4, 15)
    together = evaluate(genome, task, engine=engine, scenarios=scenarios)
    turned = evaluate(genome, task, engine=engine, scenarios=scenarios[::-1])
    alone = evaluate(genome, task, engine=engine, scenarios=[scenarios[13]])
    np.testing.assert_array_equal(turned.episode_fitness[0, ::-1], together.episode_fitness[0])
    assert alone.episode_fitness[0, 0] == together.episode_fitness[0, 13]


def test_the_seed_decides_the_scenarios(engine, full_genome):
    def run(seed, scenarios=None):
        return evaluate(
            full_genome, "light_chase", engine=engine, episodes=4, seed=seed, scenarios=scenarios
        )

    _assert_equal(run(3), run(3))
    _assert_equal(run(3), run(0, sample_scenarios("light_chase", 3, 4)))
    assert np.abs(run(3).episode_fitness - run(4).episode_fitness).max() > 1e-6


def test_scenarios_per_genome(engine, full_genome):
    rows = [sample_scenarios("light_chase", seed, 2) for seed in range(3)]
    together = evaluate(np.stack([full_genome] * 3), "light_chase", engine=engine, scenarios=rows)
    for index, row in enumerate(rows):
        alone = evaluate(full_genome, "light_chase", engine=engine, scenarios=row)
        np.testing.assert_array_equal(together.episode_fitness[index], alone.episode_fitness[0])


def test_other_grids_scores_and_radii(engine, genomes):
    vectors = genomes(6, seed=2)
    plain = evaluate(vectors, "light_chase", engine=engine, episodes=2)
    assert plain.valid.any()
    wide = evaluate(vectors, "light_chase", engine=engine, episodes=2, success_radius=500.0)
    assert wide.success[wide.valid].all()
    np.testing.assert_array_equal(wide.episode_fitness, plain.episode_fitness)
    inverse = evaluate(
        vectors, "light_chase", engine=engine, episodes=2, distance_score="inverse_square"
    )
    # (d + 1)^-2 lies below exp(-d) for all d > 0.
    assert (inverse.fitness[inverse.valid] < plain.fitness[plain.valid]).all()
    large = evaluate(vectors, "light_chase", engine=engine, episodes=2, grid_size=7)
    assert large.bodies.shape == (6, 7, 7)
    assert large.valid.any()


def test_obstacle_reports_crossing(engine, full_genome):
    # A passage 2 units wide, for a robot of 10.
    walls = (((-66.0, -66.0), (-1.0, 6.0)), ((66.0, -66.0), (1.0, 6.0)))
    near = Scenario((0.0, 15.0), light=(0.0, 36.0), walls=walls)
    far = Scenario((0.0, -51.0), light=(0.0, 36.0), walls=walls)
    result = evaluate(full_genome, "obstacle", engine=engine, scenarios=[near, far])
    np.testing.assert_array_equal(result.crossed[0], [True, False])


def test_the_closest_approach(engine, full_genome):
    """Its mean score bounds the fitness from above, and a robot that starts at the light is there
    at once."""
    scenarios = [Scenario((0.0, 0.0), light=(x, 36.0)) for x in (-30.0, 30.0)]
    result = evaluate(full_genome, "light_chase", engine=engine, scenarios=scenarios)
    best = np.exp(-result.closest[0, :, 0] / 60.0)
    assert (best >= result.episode_fitness[0]).all()
    assert (result.closest[0] <= np.hypot(30.0, 36.0) + 1e-9).all()
    here = Scenario((0.0, 0.0), light=(0.0, 30.0))
    nearer = Scenario((0.0, 0.0), light=(0.0, 20.0))
    distances = evaluate(
        full_genome, "light_chase", engine=engine, scenarios=[here, nearer]
    ).closest[0, :, 0]
    assert distances[1] <= 20.1
    assert distances[0] <= 30.1


def test_given_bodies_are_driven_as_grown_ones(engine, genomes, full_genome):
    """A genome with its own body drives as it does with that body grown."""
    vectors = np.concatenate([genomes(3), full_genome[None]])
    grown = evaluate(full_genome, "light_chase", engine=engine, episodes=2)
    full, other = grown.bodies[0], "L...L/WWWWW/WWWWW/..#../....."
    result = evaluate(
        vectors, "light_chase", engine=engine, episodes=2, bodies=[full, other, other, full]
    )
    assert result.valid.all()
    np.testing.assert_array_equal(result.bodies[[0, 3]], np.stack([full, full]))
    assert result.measures[1].tolist() == [2, 10, 13]
    np.testing.assert_array_equal(result.episode_fitness[3], grown.episode_fitness[0])
    one = evaluate(vectors, "light_chase", engine=engine, episodes=2, bodies=full)
    np.testing.assert_array_equal(one.episode_fitness[[0, 3]], result.episode_fitness[[0, 3]])
    with pytest.raises(BodyError, match=r"Genome 2: A body .* 1 light sensor"):
        evaluate(
            vectors,
            "light_chase",
            engine=engine,
            bodies=[full, other, other.replace("L", "#"), full],
        )
    with pytest.raises(BodyError, match="each of 4 genomes"):
        evaluate(vectors, "light_chase", engine=engine, bodies=[full, other])


def test_bad_input_is_refused_before_anything_runs(engine, genomes, full_genome):
    vectors = genomes(3)
    vectors[1, 0] = np.nan
    with pytest.raises(GenomeError, match="Genome 1"):
        evaluate(vectors, "light_chase", engine=engine)
    with pytest.raises(GenomeError, match=r"4572.*4873"):
        evaluate(np.zeros((2, 4873)), "light_chase", engine=engine)
    with pytest.raises(TaskError, match="obstacle"):
        evaluate(full_genome, "chess", engine=engine)
    with pytest.raises(ScenarioError, match="must be a sequence"):
        evaluate(full_genome, "light_chase", engine=engine, scenarios=[])
    with pytest.raises(ScenarioError, match="must have light"):
        evaluate(full_genome, "light_chase", engine=engine, scenarios=[Scenario((0.0, 0.0))])
    rows = [sample_scenarios("light_chase", 0, n) for n in (2, 3)]
    with pytest.raises(ScenarioError, match=r"\[2, 3\]"):
        evaluate(np.stack([full_genome] * 2), "light_chase", engine=engine, scenarios=rows)
    with pytest.raises(ScenarioError, match="each of the 3"):
        evaluate(np.stack([full_genome] * 3), "light_chase", engine=engine, scenarios=rows[:1] * 2)
    with pytest.raises(ScenarioError, match="positive integer"):
        evaluate(full_genome, "light_chase", engine=engine, episodes=0)
    with pytest.raises(ValueError, match="workers"):
        evaluate(full_genome, "light_chase", engine=engine, workers=0)


def test_unknown_engine(full_genome):
    with pytest.raises(ValueError, match="box2d"):
        evaluate(full_genome, "light_chase", engine="bullet")


def test_a_state_that_turns_non_finite_is_named_and_ranks_as_nan(engine, full_genome):
    # What the first layer reads of the control flag is 0 in growth, so that the body is the same,
    # and overflows in control.
    wild = full_genome.copy()
    wild[: 30 * 12 * 9].reshape(30, 12, 9)[:, CONTROL_CHANNEL] = 3e38
    vectors = np.stack([full_genome, wild])
    with pytest.warns(NonFiniteStateWarning, match="genome 1 .* episode 0"):
        result = evaluate(vectors, "light_chase", engine=engine, episodes=2)
    assert np.isnan(result.fitness[1])
    assert np.isfinite(result.fitness[0])


def test_evaluation_can_be_interrupted(engine, genomes):
    settings = TaskSettings("light_chase")
    with (
        make_engine(engine, settings, workers=2) as running,
        pytest.raises(EvaluationInterrupted),
    ):
        running.evaluate(genomes(4), sample_scenarios("light_chase", 0, 2), lambda: True)
