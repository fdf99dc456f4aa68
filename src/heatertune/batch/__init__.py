"""Many cases → one table: by a pool of processes or a Dask cluster, resumable after a kill at any moment.

The table depends on the cases alone: not on the number of workers, nor on what was stopped and resumed.
"""

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes

if TYPE_CHECKING:
    from heatertune.batch.engine import (
        CaseBatch,
        Chunk,
        Progress,
        Row,
        TableColumn,
        Workers,
        in_processes,
        on_dask,
        run,
        silent,
    )

__all__ = ["CaseBatch", "Chunk", "Progress", "Row", "TableColumn", "Workers", "in_processes", "on_dask", "run",
           "silent"]

# the help of a command that writes a table needs none of them
__getattr__, __dir__ = lazy_attributes(__name__, {
    "batch.engine": (
        "run", "CaseBatch", "Chunk", "Progress", "Row", "TableColumn", "Workers", "in_processes", "on_dask", "silent"),
})
