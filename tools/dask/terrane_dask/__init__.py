"""Does the tasks of a terrane plan on a Dask cluster.

| module | what |
|---|---|
| `cli` | the command line: options, cluster, report |
| `driver` | submits batches, takes their results, retries; the only one that talks to a scheduler |
| `batches` | which tasks go together and when they may; knows no Dask |
| `worker` | calls the program for the tasks of a batch; runs on the workers |
"""
