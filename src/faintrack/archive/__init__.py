"""Archives: months of recordings of many stations, tracked segment by segment by as many processes as there are.

A **segment** is an hour of a station, the unit of work and of what is kept. Within a **chain**, a day, the state of the
tracker passes from segment to segment, so that cutting a day otherwise changes no bit. A chain begins with a
**burn-in** in the chain before, so that chains can be computed side by side; tracks that both have in the burn-in are
joined. What a segment is follows from its inputs alone: computed again, by whatever worker and in whatever order, it
has the same bits.

.. code-block:: python

    from faintrack.archive.run import run
    from faintrack.archive.status import status

    run("scenario.toml", ["recordings"], out="store", pattern="{station}/%Y%m%d_%H%M%S")
    print(status("store"))
"""
