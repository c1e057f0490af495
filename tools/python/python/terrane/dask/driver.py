"""Submits batches of tasks to a Dask cluster, collects results, and retries lost tasks."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import cloudpickle
from distributed import Client, Future, KilledWorker, as_completed

from terrane.dask import worker
from terrane.dask.batches import FINISH, Queue, Task

# Exit codes that a retry may fix: not ready, cannot write, disk, interrupted, and negative codes of
# killed programs. Too little memory (75) is permanent.
PASSING = {69, 73, 74, 130}
INTERNAL, TRY_AGAIN = 70, 69
# Seconds between looks at the number of workers, and between lines of progress.
TICK = 5.0
AGAIN = "finished tasks are kept, run again to go on"


@dataclass(frozen=True)
class Job:
    """A job with its settings. Paths are absolute, for use on other machines."""

    folder: str
    terrane: str = ""
    threads: int = 1
    memory: str | None = None
    output: str | None = None
    overwrite: bool = False
    finish: bool = True
    batch_seconds: float = 30.0
    retries: int = 3
    most_nodes: int = 50_000

    def command(self) -> list[str]:
        """The call of the program, without the task."""
        memory = ["--memory", self.memory] if self.memory else []
        threads = ["--threads", str(self.threads)]
        return [self.terrane, "run", self.folder, "--json", "--progress", "none", *threads, *memory]

    def arguments(self, task: Task) -> list[str]:
        """Command line arguments of a task."""
        output = ["--output", self.output] if self.output else []
        overwrite = ["--overwrite"] if self.overwrite else []
        return [task.id, *output, *overwrite] if task.id == FINISH else [task.id]


@dataclass
class Report:
    """Report of a job. Numbers of tasks: in the plan, open at the start, skipped (done before), done by this job,
    found (done by a batch whose result was lost), failed attempts. Then batches, and batches lost with their worker;
    largest number of graph nodes and worker threads; seconds of this job and of the program; overhead of worker
    threads as a share of the work; path of the mesh or grid."""

    tasks: int = 0
    skipped: int = 0
    done: int = 0
    found: int = 0
    retried: int = 0
    batches: int = 0
    lost: int = 0
    nodes: int = 0
    workers: int = 0
    wall_seconds: float = 0.0
    work_seconds: float = 0.0
    overhead: float | None = None
    output: str | None = None


class Stop(Exception):
    """Raised when a job fails, with its exit code."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


class ByValue:
    """A function that is pickled with its code, for workers without this package."""

    def __init__(self, function: Callable[..., Any]) -> None:
        cloudpickle.register_pickle_by_value(worker)
        self.pickled = cloudpickle.dumps(function)

    def __call__(self, *args: Any) -> Any:
        """Calls it here; on a worker it is the function itself."""
        return cloudpickle.loads(self.pickled)(*args)

    def __reduce__(self) -> tuple[Any, ...]:
        return cloudpickle.loads, (self.pickled,)


def status(job: Job) -> dict[str, Any]:
    """Status of the plan."""
    try:
        command = [*worker.program(job.terrane), "status", job.folder, "--json"]
        told = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise Stop(2, f"cannot run terrane: {error.strerror}; see --terrane") from error
    if told.returncode != 0:
        raise Stop(told.returncode, told.stderr.strip())
    return dict(json.loads(told.stdout))


def to_do(job: Job, plan: dict[str, Any]) -> list[Task]:
    """The tasks to do of a plan in a given state."""
    tasks = [Task(t["id"], tuple(t["after"]), t["work"]) for t in plan["to_do"]]
    tasks = [task for task in tasks if task.id != FINISH]
    is_written = plan["output"] and job.output in (None, plan["output"])
    if job.finish and (tasks or not is_written):
        tasks.append(Task(FINISH, (), plan["work"]))
    return tasks


@dataclass
class Driver:
    """A job on a cluster."""

    client: Client
    job: Job
    report: Report = field(default_factory=Report)

    def run(self) -> Report:
        """Runs all open tasks. Raises `Stop`; always cancels its submissions at the end."""
        started = time.monotonic()
        plan = status(self.job)
        self.queue = Queue(to_do(self.job, plan), self.job.batch_seconds)
        self.report.tasks = plan["done"] + len(plan["to_do"])
        self.report.skipped = plan["done"]
        self.out: dict[Future, list[Task]] = {}
        self.next_tick = 0.0
        self.completed = as_completed(loop=self.client.loop)
        self.run_batch = ByValue(worker.run_batch)
        try:
            self._work()
        finally:
            self.client.cancel(list(self.out), force=True)
        self.report.wall_seconds = time.monotonic() - started
        if self.report.work_seconds:
            threads = self.report.wall_seconds * self.report.workers
            self.report.overhead = threads / self.report.work_seconds - 1
        self.report.output = status(self.job)["output"]
        return self.report

    def _work(self) -> None:
        self._submit()
        for futures in self.completed.batches():
            self._take(futures)
            self._submit()

    def _submit(self) -> None:
        """Submits work to each worker, with whole batches queued behind."""
        self._tick()
        while self.queue.has_ready() and len(self.out) < self.job.most_nodes:
            if len(self.out) >= self.workers and not self.queue.has_batch():
                break
            tasks = self.queue.take(self.workers)
            tries = self.queue.tries[tasks[0].id]
            future = self.client.submit(
                self.run_batch,
                self.job.command(),
                [self.job.arguments(task) for task in tasks],
                2.0 * 5 ** (tries - 1) if tries else 0.0,
                key=f"terrane-{uuid.uuid4().hex}",
                retries=self.job.retries,
                pure=False,
            )
            self.out[future] = tasks
            self.completed.add(future)
            self.report.batches += 1
            self.report.nodes = max(self.report.nodes, len(self.out))

    def _take(self, futures: list[Future]) -> None:
        """Collects the results of finished batches."""
        finished = [future for future in futures if future.status == "finished"]
        results = self.client.gather(finished)
        for future, result in zip(finished, results):
            self._note(self.out.pop(future), result)
        for future in (future for future in futures if future.status != "finished"):
            self._lose(self.out.pop(future), future)
        for future in futures:
            future.release()
        # The scheduler must process it before others take their place in the graph.
        self.client.sync(asyncio.sleep, 0)

    def _note(self, tasks: list[Task], results: list[worker.Result]) -> None:
        for task, result in zip(tasks, results):
            if result["code"] == 0:
                self._done(task, result)
            else:
                self._try_again(task, result["code"], result["message"])
        for task in tasks[len(results) :]:
            self.queue.give_back(task)

    def _done(self, task: Task, result: worker.Result) -> None:
        made = result["made"] or task.id == FINISH
        self.report.done += 1
        self.report.found += not made
        self.report.work_seconds += result["work_seconds"]
        self.queue.done(task, result["seconds"] if made else None)

    def _try_again(self, task: Task, code: int, message: str) -> None:
        self.queue.tries[task.id] += 1
        if (code >= 0 and code not in PASSING) or self.queue.tries[task.id] > self.job.retries:
            raise Stop(code if code > 0 else TRY_AGAIN, message)
        self.report.retried += 1
        say(f"{message}; trying again")
        self.queue.give_back(task)

    def _lose(self, tasks: list[Task], future: Future) -> None:
        """Handles a batch without a result: dead workers, an exception, or a lost scheduler."""
        if future.status != "error":
            raise Stop(TRY_AGAIN, f"the cluster is gone; {AGAIN}")
        error = future.exception()
        if not isinstance(error, KilledWorker):
            raise Stop(INTERNAL, f"{tasks[0].id}: {error}") from error
        self.report.lost += 1
        for task in tasks:
            self._try_again(task, TRY_AGAIN, f"{task.id}: its worker died repeatedly")

    def _tick(self) -> None:
        now = time.monotonic()
        if now < self.next_tick:
            return
        self.next_tick = now + TICK
        self.workers = max(1, sum(self.client.nthreads().values()))
        self.report.workers = max(self.report.workers, self.workers)
        done = self.report.skipped + self.report.done
        left = f"{len(self.queue.left)} left, {len(self.out)} batches out"
        say(f"{done} of {self.report.tasks} tasks done, {left}, {self.workers} worker threads")


def run(
    plan: str | os.PathLike[str],
    client: Client,
    *,
    terrane: str = Job.terrane,
    threads: int = Job.threads,
    memory: str | None = None,
    output: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    finish: bool = True,
    batch_seconds: float = Job.batch_seconds,
    retries: int = Job.retries,
    most_nodes: int = Job.most_nodes,
) -> Report:
    """Runs the open tasks of a plan of a mesh or a grid on the cluster of `client`.

    `plan` is the folder made by `terrane plan`; workers need it and the input at the same paths. Finished tasks are
    skipped, so an interrupted job resumes when it is run again. The result is identical to a run without a plan.

    Args:
        plan: Folder of the plan.
        client: A connected `distributed.Client`, which stays open.
        terrane: The program: a name on the `PATH` of all workers, or a path valid on each. By default that of this
        package if installed on the worker, otherwise `terrane` on its `PATH`.
        threads: Threads per task. A Dask worker thread runs one task at a time.
        memory: Memory budget per task, such as "2GiB"; the program's default when `None`.
        output: Output file, absolute or relative to the current folder; in the plan folder when `None`.
        overwrite: Replace an existing file.
        finish: False leaves the mesh or grid to `terrane plan finish`.
        batch_seconds: Approximate duration of a batch of short tasks.
        retries: Retries of a task after a temporary failure or the loss of its worker.
        most_nodes: Largest number of nodes in Dask's graph.

    Returns:
        The report; `report.output` is the path of the mesh or grid.

    Raises:
        Stop: A task failed permanently, or the cluster is lost. `code` is the exit code of the program, or 69 if a
        retry may help; the text names the task and the remedy.
    """
    is_path = os.sep in terrane
    job = Job(
        folder=os.path.abspath(plan),
        terrane=os.path.abspath(terrane) if is_path else terrane,
        threads=threads,
        memory=memory,
        output=os.path.abspath(output) if output else None,
        overwrite=overwrite,
        finish=finish,
        batch_seconds=batch_seconds,
        retries=retries,
        most_nodes=most_nodes,
    )
    return Driver(client, job).run()


def say(text: str) -> None:
    """A line on stderr."""
    print(f"terrane.dask: {text}", file=sys.stderr, flush=True)
