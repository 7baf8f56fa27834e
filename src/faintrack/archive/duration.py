"""How long an archive takes so many processes: the order of work of `faintrack.archive.run`, without the work.

A scheduler hands out one task after the other, each taking it `TASK`. A segment follows the one before it in its chain
on the process that computed that; a process whose chain has ended takes the next one. What limits a run can be read off
the result: the work itself, the longest chain, what does not divide evenly among processes, or the scheduler.
"""

import heapq
from collections import deque
from collections.abc import Sequence

TASK = 3.3e-3
"""Seconds that Dask's scheduler and this package's client take for a task together, one after the other."""


def duration(chains: Sequence[Sequence[float]], workers: int, task: float = TASK) -> float:
    """Seconds from the first task to the end of the last.

    Parameters
    ----------
    chains : seconds that each of its segments takes a process.
    workers : processes.
    task : seconds of the scheduler for a task.

    Examples
    --------
    >>> duration([[10.0, 10.0], [10.0], [10.0]], workers=2, task=0.0)
    20.0
    >>> round(duration([[10.0]] * 5000, workers=1000), 1)  # five in a row, the first of them begun one by one
    53.3
    """
    waiting, running = deque(enumerate(chains)), list[tuple[float, int, int]]()
    scheduler = 0.0

    def begin(chain: int, number: int, ready: float) -> None:
        nonlocal scheduler
        scheduler = max(scheduler, ready) + task
        heapq.heappush(running, (scheduler + chains[chain][number], chain, number))

    for _ in range(min(workers, len(chains))):
        begin(waiting.popleft()[0], 0, 0.0)
    now = 0.0
    while running:
        now, chain, number = heapq.heappop(running)
        if number + 1 < len(chains[chain]):
            begin(chain, number + 1, now)
        elif waiting:
            begin(waiting.popleft()[0], 0, now)
    return now
