import importlib.util

import pytest

from ncrs.engines import base
from ncrs.engines.base import EngineSettingError, has_gpu, make_engine, resolve_engine
from ncrs.runs.engine_settings import ConfigError, EngineSettings
from ncrs.runs.settings import TrainConfig
from ncrs.training.api import train
from ncrs_envs.tasks import TaskSettings

without_gpu = pytest.mark.skipif(has_gpu(), reason="there is a GPU")


def test_a_missing_package_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(EngineSettingError, match=r"pip install 'ncrs\[cuda\]'"):
        make_engine("cuda", TaskSettings())


@without_gpu
def test_a_missing_gpu_is_one_sentence_and_leaves_no_run(tmp_path):
    pytest.importorskip("numba_cuda", reason="needs the extra cuda")
    with pytest.raises(EngineSettingError, match=r"No NVIDIA GPU can be used here .*batched"):
        train(tmp_path / "run", engine="cuda", generations=1, progress=False)
    assert not (tmp_path / "run" / "config.json").exists()


@without_gpu
def test_auto_stays_on_the_cpu():
    assert resolve_engine("auto") == "batched"


def test_auto_chooses_a_gpu_where_there_is_one(monkeypatch):
    monkeypatch.setattr(base, "has_gpu", lambda: True)
    assert resolve_engine("auto") == "cuda"


@pytest.mark.parametrize("given", [{"construction": "jointed"}, {"hull_density": 0.1}])
def test_what_only_box2d_simulates_is_box2ds(given):
    settings = TaskSettings("carry_ball", **given)
    (name, value), *_ = given.items()
    assert resolve_engine("auto", settings) == "box2d"
    assert TrainConfig(task=settings).resolved().engine.name == "box2d"
    with pytest.raises(EngineSettingError, match=rf"carry_ball has {name}={value}, which only Box"):
        make_engine("batched", settings)


def test_devices_are_refused_by_engines_on_the_cpu():
    with pytest.raises(EngineSettingError, match=r"engine\.devices names GPUs"):
        make_engine("batched", TaskSettings(), devices=[0])


@pytest.mark.parametrize("devices", [[], [-1], [0, 0], [True], [0.5]])
def test_devices_must_be_different_indices(devices):
    pytest.importorskip("numba_cuda", reason="needs the extra cuda")
    from ncrs.engines.cuda.devices import check_devices

    with pytest.raises(EngineSettingError, match="different GPUs by their indices"):
        check_devices(devices)


def test_devices_are_a_list_of_integers_in_the_settings():
    assert EngineSettings("batched", devices=(0, 1)).devices == [0, 1]
    for devices in ([0.5], "0", 0):
        with pytest.raises(ConfigError, match="devices must be a list of integers"):
            EngineSettings("batched", devices=devices)
