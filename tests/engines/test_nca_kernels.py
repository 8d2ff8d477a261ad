"""The NCA's kernels against recordings of the published runs and against the torch module."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

pytest.importorskip("numba")

from ncrs.automaton.channels import STEPS_PER_ACTION, growth_steps, nca_layout
from ncrs.automaton.control import Controller
from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCA
from ncrs.engines.nca_kernels import (
    CHANGING_CHANNELS,
    CONTROL_LANES,
    EPISODE_TILE,
    GROWTH_LANES,
    IO_LANE,
    control_constants,
    control_step,
    grow_body,
    growth_step,
    link_cells,
    network_of,
    pack_genomes,
    seed_lanes,
)
from ncrs_envs.body import sensor_mask, wheel_mask

DATA = Path(__file__).parents[1] / "data"
LAYERS = ("conv1_weight", "conv1_bias", "conv2_weight", "conv2_bias", "conv3_weight", "conv3_bias")
GENOMES = 16


class Recording(NamedTuple):
    layout: object
    genomes: np.ndarray
    records: list


@pytest.fixture(scope="module", params=[("nca_light", "light_chase"), ("nca_carry", "carry_ball")])
def recording(request) -> Recording:
    name, task = request.param
    with np.load(DATA / f"{name}.npz") as data:
        records = [
            {key[4:]: data[key] for key in data.files if key.startswith(f"g{i:02d}_")}
            for i in range(GENOMES)
        ]
    genomes = np.stack([np.concatenate([r[k].ravel() for k in LAYERS]) for r in records])
    layout = nca_layout(task)
    return Recording(layout, layout.check_genomes(genomes), records)


def _grown_states(network, channels: int, grid_size: int) -> np.ndarray:
    graph = link_cells(np.ones((grid_size, grid_size), dtype=np.int8), channels, 0)
    state = seed_lanes(grid_size)
    states = []
    for _ in range(growth_steps(grid_size)):
        updated = np.empty_like(state)
        assert growth_step(network, graph, channels, state, updated)
        states.append(updated)
        state = updated
    grids = np.stack(states).reshape(-1, grid_size, grid_size, GROWTH_LANES)
    np.testing.assert_array_equal(grids[..., channels:], 0.0)
    return grids[..., :channels]


def _body(network, layout, grid_size: int) -> np.ndarray:
    body = np.full((grid_size, grid_size), 9, dtype=np.int8)
    codes = np.array(layout.part_codes, dtype=np.int8)
    assert grow_body(network, codes, growth_steps(grid_size), body)
    return body


class KernelController:
    """Drives ``episodes`` robots of one body with the kernels; they sense different things."""

    def __init__(self, network, layout, body: np.ndarray, episodes: int) -> None:
        codes = np.array(layout.part_codes, dtype=np.int8)
        self._network = network
        self._constants = control_constants(network, codes, body)
        self._graph = link_cells(body, layout.channels, layout.changing_channels.start)
        self._occupied = body != 0
        self._sensors = sensor_mask(body)[self._occupied]
        self.states = np.zeros((self._occupied.sum(), episodes, CONTROL_LANES), dtype=np.float32)

    def act(self, sensed: np.ndarray) -> np.ndarray:
        """Sensor values ``(episodes, n, n)`` to the gas of cells ``(cells, episodes)``."""
        for _ in range(STEPS_PER_ACTION):
            values = sensed[:, self._occupied].T
            self.states[self._sensors, :, IO_LANE] = values[self._sensors]
            updated = np.empty_like(self.states)
            control_step(
                self._network,
                self._constants,
                self._graph,
                self.states,
                updated,
            )
            self.states = updated
        return self.states[:, :, IO_LANE]


def test_growth_follows_the_published_runs(recording):
    growth, _ = pack_genomes(recording.genomes, recording.layout)
    occupied = 0
    for genome, record in enumerate(recording.records):
        network = network_of(growth, genome)
        states = _grown_states(network, recording.layout.channels, 5)
        np.testing.assert_allclose(states, record["dev_states"], atol=5e-4)
        body = _body(network, recording.layout, 5)
        np.testing.assert_array_equal(body, record["body"])
        occupied += np.count_nonzero(body)
    assert occupied > 5 * GENOMES


def test_control_follows_the_published_runs(recording):
    _, control = pack_genomes(recording.genomes, recording.layout)
    changing = recording.layout.changing_channels
    valid = [g for g, record in enumerate(recording.records) if record["valid"]]
    assert len(valid) >= 8
    for genome in valid:
        record = recording.records[genome]
        body = record["body"].astype(np.int8)
        controller = KernelController(
            network_of(control, genome), recording.layout, body, EPISODE_TILE
        )
        wheels = wheel_mask(body)[body != 0]
        for step, values in enumerate(record["sensor_inputs"]):
            sensed = np.zeros((EPISODE_TILE, *body.shape), dtype=np.float32)
            sensed[:, sensor_mask(body)] = values
            gas = controller.act(sensed)
            expected = record["control_states"][step][body != 0][:, None, changing]
            states = controller.states[..., :CHANGING_CHANNELS]
            np.testing.assert_allclose(states, np.repeat(expected, EPISODE_TILE, 1), atol=5e-3)
            np.testing.assert_allclose(gas[wheels, 0], record["wheel_outputs"][step], atol=5e-3)


@pytest.mark.parametrize("task", ["light_chase", "carry_ball"])
@pytest.mark.parametrize("grid_size", [3, 4, 7])
def test_growth_equals_the_torch_module_on_other_grids(task, grid_size):
    layout = nca_layout(task)
    rng = np.random.default_rng(grid_size)
    genomes = (0.1 * rng.standard_normal((6, layout.num_parameters))).astype(np.float32)
    growth, _ = pack_genomes(genomes, layout)
    cells = 0
    for index, genome in enumerate(genomes):
        body, states = grow(NCA(task).set_genome(genome), grid_size, history=True)
        network = network_of(growth, index)
        kernel_states = _grown_states(network, layout.channels, grid_size)
        np.testing.assert_allclose(kernel_states, states, atol=2e-3)
        np.testing.assert_array_equal(_body(network, layout, grid_size), body)
        cells += np.count_nonzero(body)
    assert cells > grid_size


@pytest.mark.parametrize("task", ["light_chase", "carry_ball"])
def test_control_equals_the_torch_module_episode_by_episode(task):
    """A body with holes and a disconnected cell, on a grid that is not 5 x 5; episodes differ."""
    layout = nca_layout(task)
    rng = np.random.default_rng(7)
    body = rng.choice((0, *layout.part_codes), size=(6, 6)).astype(np.int8)
    body[:, 4] = 0
    genomes = (0.1 * rng.standard_normal((3, layout.num_parameters))).astype(np.float32)
    _, control = pack_genomes(genomes, layout)
    episodes = 2 * EPISODE_TILE
    reference = Controller(
        NCA(task).set_genome(genomes[1]), np.broadcast_to(body, (episodes, 6, 6))
    )
    controller = KernelController(network_of(control, 1), layout, body, episodes)
    for _ in range(8):
        sensed = rng.random((episodes, 6, 6), dtype=np.float32) * sensor_mask(body)
        expected = reference.act(sensed)
        gas = controller.act(sensed)[wheel_mask(body)[body != 0]]
        np.testing.assert_allclose(gas.T, expected[:, wheel_mask(body)], atol=2e-3)
        states = reference.states[:, body != 0][..., layout.changing_channels]
        np.testing.assert_allclose(
            controller.states[..., :CHANGING_CHANNELS].swapaxes(0, 1), states, atol=2e-3
        )
    assert np.ptp(gas, axis=1).max() > 0.01


def test_an_episode_does_not_depend_on_its_place_among_the_others():
    layout = nca_layout("light_chase")
    rng = np.random.default_rng(3)
    body = rng.choice((0, *layout.part_codes), size=(5, 5)).astype(np.int8)
    genome = (0.1 * rng.standard_normal((1, layout.num_parameters))).astype(np.float32)
    network = network_of(pack_genomes(genome, layout)[1], 0)
    episodes = 2 * EPISODE_TILE
    order = rng.permutation(episodes)
    plain = KernelController(network, layout, body, episodes)
    shuffled = KernelController(network, layout, body, episodes)
    for _ in range(5):
        sensed = rng.random((episodes, 5, 5), dtype=np.float32)
        np.testing.assert_array_equal(shuffled.act(sensed[order]), plain.act(sensed)[:, order])


def test_growth_reports_a_state_that_is_not_finite_and_leaves_no_body():
    layout = nca_layout("light_chase")
    rng = np.random.default_rng(0)
    genome = (1e20 * rng.standard_normal((1, layout.num_parameters))).astype(np.float32)
    network = network_of(pack_genomes(genome, layout)[0], 0)
    body = np.full((5, 5), 4, dtype=np.int8)
    assert not grow_body(network, np.array(layout.part_codes, dtype=np.int8), 10, body)
    np.testing.assert_array_equal(body, 0)
