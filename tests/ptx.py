"""Compilation of GPU kernels for GPUs that are not here."""

import re
from unittest import mock

import numba
from cuda.bindings import nvjitlink
from numba import cuda, types
from numba.cuda import dispatcher
from numba.cuda.codegen import CUDACodeLibrary

from ncrs_envs.cuda.gpu import MAX_REGISTERS

CAPABILITIES = ((8, 0), (9, 0))


class _Device:
    """What numba-cuda asks of the current GPU while it compiles."""

    id = 0

    def __init__(self, capability):
        self.compute_capability = capability


def _link(ptx, capability):
    """Return the assembler's report on the machine code for a GPU."""
    options = [f"-arch=sm_{capability[0]}{capability[1]}", "-verbose"]
    options.append(f"-maxrregcount={MAX_REGISTERS}")
    linker = nvjitlink.create(len(options), options)
    code = ptx.encode()
    nvjitlink.add_data(linker, nvjitlink.InputType.PTX, code, len(code), "kernel")
    nvjitlink.complete(linker)
    log = bytearray(nvjitlink.get_info_log_size(linker))
    nvjitlink.get_info_log(linker, log)
    return log.decode()


def compiled(kernel, arguments):
    """Compile a kernel for every capability.

    Returns:
        For each capability its PTX, the largest number of registers that a function of it uses,
        and the largest number of bytes of them that one stores in memory.
    """
    libraries = []
    make_ptx = CUDACodeLibrary.get_asm_strs

    def recorded(library, cc=None):
        libraries.append(library)
        return make_ptx(library, cc=cc)

    device = _Device(CAPABILITIES[0])
    signature = types.void(*(numba.typeof(argument) for argument in arguments))
    with (
        mock.patch.object(CUDACodeLibrary, "get_asm_strs", recorded),
        mock.patch.object(dispatcher, "get_current_device", return_value=device),
    ):
        cuda.compile_ptx(kernel.py_func, signature, cc=CAPABILITIES[0])
    results = {}
    for capability in CAPABILITIES:  # only the last half of compilation knows the GPU
        (ptx,) = make_ptx(libraries[0], cc=capability)
        report = _link(ptx, capability)
        used = max(int(number) for number in re.findall(r"Used (\d+) registers", report))
        spilled = max(int(number) for number in re.findall(r"(\d+) bytes spill stores", report))
        results[capability] = (ptx, used, spilled)
    return results
