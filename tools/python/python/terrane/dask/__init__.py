"""Does the tasks of a terrane plan on a Dask cluster.

    from distributed import Client
    from terrane.dask import run

    with Client("tcp://head:8786") as client:
        print(run("/cluster/plan", client, memory="2GiB").output)

| module | what |
|---|---|
| `cli` | the command line: options, cluster, report |
| `driver` | submits batches, takes their results, retries; the only one that talks to a scheduler |
| `batches` | which tasks go together and when they may; knows no Dask |
| `worker` | calls the program for the tasks of a batch; runs on the workers |
"""

from terrane.dask.driver import Report, Stop, run

__all__ = ["Report", "Stop", "run"]
