"""Runs of a study on Dask: a local cluster, or any scheduler by its address.

Batches go to the workers as these ask for more; results come back one by one and are written at once, so neither the
number of runs nor that of workers decides how much memory is used. A worker that dies costs the batches it had, which
the scheduler gives to another. Every worker of the local cluster has one thread: two workers take a batch each, which
is faster than a batch in two halves, and the bits of a batch do not depend on how many there are.
"""

import contextlib
import itertools
import logging
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from faintrack.errors import InputError
from faintrack.numerics.compiled import cache_folder
from faintrack.studies.folder import Folder
from faintrack.studies.study import Setting, run_batch

if TYPE_CHECKING:
    from distributed import Client

WAITING = 2
"""Batches for each worker that are computed or wait for it."""

Batch = tuple[Setting, int]
"""Setting, and number of the first run."""

PATIENCE = "15s"
"""How long a scheduler may take to answer."""


@contextlib.contextmanager
def connect(workers: int | None = None, scheduler: str | None = None) -> Iterator["Client"]:
    """Client of a Dask scheduler.

    Parameters
    ----------
    workers : processes of a local cluster; one for each core, or for each GPU that JAX sees, where not given.
    scheduler : address of a scheduler to use instead, such as "tcp://10.0.0.1:8786".

    Raises
    ------
    InputError : the scheduler does not answer, or has no worker.
    """
    from distributed import Client, LocalCluster

    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    # A scheduler that is ended in the middle says so for everything it had begun.
    warnings.filterwarnings("ignore", "coroutine .* was never awaited", RuntimeWarning)
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=PATIENCE)
        except (OSError, TimeoutError, ValueError, ImportError) as error:
            raise InputError(f"scheduler {scheduler} cannot be reached ({error}).") from error
        with client:
            if not client.scheduler_info()["workers"]:
                raise InputError(f"scheduler {scheduler} has no worker; start some with `dask worker {scheduler}`.")
            yield client
        return
    if workers is None:
        workers = (os.cpu_count() or 1) if jax.default_backend() == "cpu" else jax.local_device_count()
    with tempfile.TemporaryDirectory(prefix="faintrack-") as scratch:
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            memory_limit=None,
            dashboard_address="127.0.0.1:0",
            local_directory=scratch,
            silence_logs=logging.CRITICAL,
            env=_worker_environment(),
        )
        with cluster, Client(cluster) as client:
            yield client


def run_missing(client: "Client | None", where: str, folder: Folder) -> Iterator[tuple[Setting, int]]:
    """Compute every batch that the folder lacks; yields the setting and the number of runs that were written.

    Without a client they are computed here, one after the other, which is for a study that is over before workers
    have started.

    Raises
    ------
    InputError : the folder cannot be written, or a batch killed every worker it was given to.
    """
    study, seed, quick = folder.study, folder.plan.seed, folder.plan.quick
    # Every setting advances at the same pace, so that a study cut short is a smaller study.
    batches = sorted(
        ((setting, first) for setting in study.settings for first in folder.missing(setting)),
        key=lambda batch: batch[1] / folder.plan.runs[batch[0].name],
    )

    def arguments(batch: Batch) -> tuple[Any, ...]:
        return where, batch[0].name, seed, batch[1], quick

    computed: Iterator[tuple[Batch, dict[str, np.ndarray]]]
    if client is None:
        computed = ((batch, run_batch(*arguments(batch))) for batch in batches)
    else:
        computed = _on_workers(client, study.name, iter(batches), arguments)
    for (setting, first), arrays in computed:
        folder.write(setting, first, arrays)
        yield setting, min(setting.batch, folder.plan.runs[setting.name] - first)


def _on_workers(
    client: "Client", name: str, batches: Iterator[Batch], arguments: Callable[[Batch], tuple[Any, ...]]
) -> Iterator[tuple[Batch, dict[str, np.ndarray]]]:
    """What workers return of batches, in the order in which they finish."""
    from distributed import KilledWorker, as_completed
    from distributed.client import FutureCancelledError

    started: dict[Any, Batch] = {}

    def submit(count: int) -> list[Any]:
        futures = []
        for batch in itertools.islice(batches, count):
            future = client.submit(run_batch, *arguments(batch), pure=False)
            started[future] = batch
            futures.append(future)
        return futures

    workers = max(1, len(client.scheduler_info()["workers"]))
    waiting = as_completed(submit(WAITING * workers))
    for future in waiting:
        batch = started.pop(future)
        try:
            arrays: dict[str, np.ndarray] = future.result()
        except KilledWorker as error:
            raise InputError(
                f"study {name}, setting {batch[0].name}, runs from {batch[1]}: every worker that took them died, "
                "most likely for want of memory. What was written is kept."
            ) from error
        except FutureCancelledError as error:
            raise InputError("the scheduler went away. What was written is kept; run again with --resume.") from error
        yield batch, arrays
        # The arrays on the worker go with the future.
        future.release()
        for another in submit(1):
            waiting.add(another)


def _worker_environment() -> dict[str, str]:
    """One thread a worker, and compilations kept: the second worker finds what the first compiled."""
    folder = os.environ.get("JAX_COMPILATION_CACHE_DIR", cache_folder())
    flags = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    return {
        "XLA_FLAGS": f"{os.environ.get('XLA_FLAGS', '')} {flags}".strip(),
        "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
        **({} if folder is None else {"JAX_COMPILATION_CACHE_DIR": str(folder)}),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.1",
        # XLA's pool of threads goes by this, not by the flags above: two of them would take turns at the work of one.
        "NPROC": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
