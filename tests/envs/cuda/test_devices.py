import pytest

pytest.importorskip("numba_cuda", reason="needs the extra cuda")

from numba import cuda

from ncrs.engines.base import EngineError, EngineSettingError
from ncrs.engines.cuda import devices as engine_devices
from ncrs_envs.cuda import devices
from ncrs_envs.cuda.devices import FailedGPUError, UnusableGPUError, check_device, on_device

needs_no_gpu = pytest.mark.skipif(cuda.is_available(), reason="there is a GPU")


@needs_no_gpu
def test_a_missing_gpu_is_said_with_the_reason():
    with pytest.raises(UnusableGPUError, match=r"No NVIDIA GPU can be used here \(.+\)"):
        check_device(0)


@needs_no_gpu
def test_engines_say_what_to_choose_instead():
    with pytest.raises(EngineSettingError, match=r"No NVIDIA GPU .*choose engine=batched"):
        engine_devices.check_devices([0])


class _GPU:
    def __init__(self, error=None, capability=(9, 0)):
        self.error = error
        self.compute_capability = capability
        self.name = b"A card"

    def __enter__(self):
        if self.error is not None:
            raise self.error
        return self

    def __exit__(self, *_):
        return None


def _error(text):
    from numba.cuda.cudadrv.driver import CudaAPIError

    return CudaAPIError(2, text)


@pytest.fixture
def gpu(monkeypatch):
    """Puts a GPU of our own in the place of the machine's."""

    def put(made):
        monkeypatch.setattr(devices.cuda, "is_available", lambda: True)
        monkeypatch.setattr(devices.cuda, "gpus", [made])
        monkeypatch.setattr(devices.cuda, "get_current_device", lambda: made)

    return put


def test_gpus_that_are_not_there_too_old_or_taken_are_refused(gpu):
    gpu(_GPU())
    check_device(0)
    with pytest.raises(UnusableGPUError, match="no GPU 1: this machine has 1, numbered from 0"):
        check_device(1)
    gpu(_GPU(capability=(7, 5)))
    with pytest.raises(UnusableGPUError, match=r"A card\) has compute capability 7\.5; at least"):
        check_device(0)
    gpu(_GPU(_error("CUDA_ERROR_DEVICE_UNAVAILABLE")))
    with pytest.raises(UnusableGPUError, match="another process may have it to itself"):
        check_device(0)
    with (
        pytest.raises(EngineSettingError, match=r"engine\.devices, or choose engine=batched"),
        engine_devices.on_device(0),
    ):
        pass


def test_what_fails_on_a_gpu_is_told_from_what_cannot_be_used(gpu):
    gpu(_GPU())
    with pytest.raises(FailedGPUError, match="too little free memory"), on_device(0):
        raise _error("CUDA_ERROR_OUT_OF_MEMORY")
    with pytest.raises(EngineError, match="GPU 0 failed"), engine_devices.on_device(0):
        raise _error("CUDA_ERROR_ILLEGAL_ADDRESS")
