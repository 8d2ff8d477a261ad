"""Circuits in the weights of an NCA."""

import numpy as np
import pytest
import torch

import ncrs
from ncrs.automaton.channels import nca_layout
from ncrs.automaton.circuit import Circuit, CircuitError, ramp, relu, where
from ncrs_envs.body import Cell, parse_body

IO = "input/output"
BODY = "L...L/WWWWW/#####/WWWWW/#####"


def run(circuit, steps=1, body=BODY, sensed=0.0):
    """States by channel name after some actions, of two steps each."""
    layout = circuit._layout
    nca = ncrs.NCA(layout.task).set_genome(circuit.genome())
    controller = ncrs.Controller(nca, parse_body(body))
    for _ in range(steps):
        controller.act(np.broadcast_to(sensed, (5, 5)))
    states = controller.states
    return {name: states[..., index] for index, name in enumerate(layout.channel_names)}


def test_a_signal_travels_one_cell_a_step():
    circuit = Circuit()
    circuit.set("hidden 1", circuit.tap(IO, -1, 0) + 0.5 * circuit.tap("hidden 1", -1, 0))
    sensed = np.zeros((5, 5))
    sensed[0, [0, 4]] = 0.8, -0.4
    found = run(circuit, 1, sensed=sensed)["hidden 1"]
    expected = np.zeros((5, 5))
    expected[1, [0, 4]] = 0.8, -0.4
    expected[2, [0, 4]] = 0.4, -0.2
    np.testing.assert_allclose(found, expected, atol=1e-5)
    expected[3, [0, 4]] = 0.2, -0.1
    expected[4, [0, 4]] = 0.1, -0.05
    np.testing.assert_allclose(run(circuit, 2, sensed=sensed)["hidden 1"], expected, atol=1e-5)


@pytest.mark.parametrize("value", [-4.0, -0.7, 0.0, 0.25, 0.6, 3.0])
def test_signals_have_the_values_that_are_written(value):
    circuit = Circuit()
    x = circuit.tap("hidden 1")
    circuit.set("hidden 1", 0.0 * x + value)
    circuit.set("hidden 2", relu(x))
    circuit.set("hidden 3", relu(relu(2 * x - 1) - relu(-x)) - 0.25)
    circuit.set("hidden 4", ramp(x, 0.2, 0.7))
    circuit.set("hidden 5", where(circuit.is_cell(Cell.WHEEL), 1 - 3 * x))
    circuit.set("hidden 6", where(ramp(x, 0.2, 0.7), -x))
    found = run(circuit)
    cells = parse_body(BODY)
    soft = np.clip((value - 0.2) / 0.5, 0, 1)
    kept = -value if soft == 1 else 0.0
    expected = {
        "hidden 1": value,
        "hidden 2": max(value, 0),
        "hidden 3": max(max(2 * value - 1, 0) - max(-value, 0), 0) - 0.25,
        "hidden 4": soft,
        "hidden 5": np.where(cells == Cell.WHEEL, 1 - 3 * value, 0),
    }
    if soft in (0, 1):  # between, it is cut off
        expected["hidden 6"] = kept
    for name, values in expected.items():
        values = np.where(cells != 0, np.clip(values, -5, 5), 0)
        np.testing.assert_allclose(found[name], values, atol=2e-4, err_msg=name)


def test_a_large_gain_does_not_need_large_weights_elsewhere():
    circuit = Circuit()
    difference = circuit.tap(IO, 0, 1) - circuit.tap(IO, 0, -1)
    circuit.set("hidden 1", 300 * difference)
    genome = circuit.genome()
    reading, silence, *others = (
        layer[0] for layer in nca_layout("light_chase").layers(genome[None])
    )
    assert np.abs(reading).max() == pytest.approx(5 * 601 + 10, abs=1)  # the flag's weight
    assert silence.min() == pytest.approx(-5 * 601)
    assert max(np.abs(weights).max() for weights in others) == 10  # twice the limit of a state
    sensed = np.zeros((5, 5))
    sensed[0, [0, 4]] = 0.503, 0.5
    found = run(circuit, body="L#L.L/WWWWW/#####/WWWWW/#####", sensed=sensed)["hidden 1"]
    assert found[0, 1] == -5.0
    sensed[0, 2] = 0.5
    found = run(circuit, body="L#L.L/WWWWW/#####/WWWWW/#####", sensed=sensed)["hidden 1"]
    assert found[0, 1] == pytest.approx(-0.9, abs=2e-3)


def test_a_switch_lets_values_of_both_signs_pass():
    for sign in (-1, 1):
        circuit = Circuit()
        circuit.set("hidden 1", where(circuit.is_cell(Cell.TISSUE, 1, 0), sign * circuit.tap(IO)))
        found = run(circuit, sensed=0.5)["hidden 1"]
        assert not found.any()  # below the sensors there are wheels
        found = run(circuit, body="L...L/#...#/WWWWW/#####/WWWWW", sensed=0.5)["hidden 1"]
        np.testing.assert_allclose(found[0], [0.5 * sign, 0, 0, 0, 0.5 * sign], atol=1e-5)


def test_the_sum_with_a_body_grows_it_and_drives_it():
    rows = "...../LWWWL/WWWWW/WWWWW/L...L"
    circuit = Circuit()
    circuit.set(IO, where(circuit.is_cell(Cell.WHEEL), 0.0 * circuit.tap(IO) + 0.75))
    genome = circuit.genome() + ncrs.grow_to(rows)
    nca = ncrs.NCA().set_genome(genome)
    body = ncrs.grow(nca)
    np.testing.assert_array_equal(body, parse_body(rows))
    gas = ncrs.Controller(nca, body).act(np.full((5, 5), 0.9))
    np.testing.assert_allclose(gas, np.where(body == Cell.WHEEL, 0.75, 0), atol=1e-4)


def test_nothing_of_a_circuit_is_active_in_growth():
    circuit = Circuit()
    circuit.set(
        "hidden 1", 5 - 2 * relu(circuit.tap("hidden 2", 1, 1)) + ramp(circuit.tap(IO), 0, 1)
    )
    nca = ncrs.NCA().set_genome(circuit.genome())
    states = np.random.default_rng(0).uniform(-5, 5, (20, 12, 5, 5)).astype(np.float32)
    states[:, 1] = 0
    with torch.no_grad():
        assert not nca.delta(torch.from_numpy(states)).any()


def test_equal_signals_share_a_unit_and_the_order_is_fixed():
    circuit = Circuit()
    x, y = circuit.tap("hidden 1"), circuit.tap("hidden 2")
    circuit.set("hidden 3", relu(x + y))
    circuit.set("hidden 4", 2 * relu(y + x))
    reading = nca_layout("light_chase").layers(circuit.genome()[None])[0][0]
    used = reading.reshape(30, -1).any(axis=1)
    assert used.tolist() == [True] * 4 + [False] * 26  # the sum, two old values, the constant
    np.testing.assert_array_equal(circuit.genome(), circuit.genome())


def test_what_does_not_fit_is_refused():
    circuit = Circuit()
    x = circuit.tap("hidden 1")
    with pytest.raises(CircuitError, match=r"no channel 'hidden 7'; there are .*'hidden 6'"):
        circuit.tap("hidden 7")
    with pytest.raises(CircuitError, match="must be -1, 0 or 1, got 2"):
        circuit.tap(IO, 2)
    with pytest.raises(CircuitError, match="light_chase has no target sensor cells"):
        circuit.is_cell(Cell.TARGET_SENSOR)
    with pytest.raises(CircuitError, match="body does not change during control"):
        circuit.set("body", x)
    with pytest.raises(CircuitError, match="can pass 2 rectifiers"):
        relu(relu(relu(x)))
    with pytest.raises(CircuitError, match="must end above its start, got 1 to 1"):
        ramp(x, 1, 1)
    circuit.set("hidden 2", x)
    with pytest.raises(CircuitError, match="set already"):
        circuit.set("hidden 2", x)
    circuit.set("hidden 3", sum((relu(x - level) for level in range(20)), start=x))
    with pytest.raises(
        CircuitError, match="needs 24 units of the first layer, which has 20 beside"
    ):
        circuit.genome()
    assert circuit.genome(spared=(0, 0)).any()
