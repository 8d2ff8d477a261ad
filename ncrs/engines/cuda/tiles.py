"""Tiles and the barrier of a warp: in registers on a GPU, in numpy in numba-cuda's simulator."""

from __future__ import annotations

from numba import cuda

from ncrs_envs.cuda.gpu import IS_SIMULATED, device_function

if IS_SIMULATED:
    from ncrs.engines.cuda.simulated_tiles import (
        add_outer_products,
        add_units,
        rectified,
        repeat_row,
        store_clipped_sum,
        sync_warp,
    )
else:
    from ncrs.engines.cuda.register_tiles import (
        add_outer_products,
        add_units,
        rectified,
        repeat_row,
        store_clipped_sum,
    )

    @device_function
    def sync_warp() -> None:
        """Wait for the other threads of the warp, and see what they wrote."""
        cuda.syncwarp()


__all__ = [
    "add_outer_products",
    "add_units",
    "rectified",
    "repeat_row",
    "store_clipped_sum",
    "sync_warp",
]
