"""Submits batches of tasks to a Dask cluster, takes their results, tries again what was lost."""

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

# Exit codes of the program that another try may mend: not yet, cannot write, disk, interrupted. So
# may a program that was killed, whose code is below zero. Too little memory (75) stays too little.
PASSING = {69, 73, 74, 130}
INTERNAL, TRY_AGAIN = 70, 69
# Seconds between looks at the number of workers, and between lines of progress.
TICK = 5.0
AGAIN = "finished tasks are kept, run again to go on"


@dataclass(frozen=True)
class Job:
    """What to do and how. Paths are absolute: they are for other machines, too."""

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
        """The name of a task and what else the program is told for it."""
        output = ["--output", self.output] if self.output else []
        overwrite = ["--overwrite"] if self.overwrite else []
        return [task.id, *output, *overwrite] if task.id == FINISH else [task.id]


@dataclass
class Report:
    """What was done. Tasks: of the plan and to do at the start; skipped, because they were done
    before; done by this job, made by it or (found) by a batch whose result was lost; tries that
    failed. Then batches, and those lost with their worker; graph nodes and worker threads at most;
    seconds of this job, of the program by its own clock, and worker threads' time beside the work
    as a share of it; where the mesh or grid is."""

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
    """The end of a job that failed, with the exit code that tells why."""

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
    """How far the plan has come."""
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
        """Does all that is not done. Raises `Stop`; cancels what it submitted however it ends."""
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
        """Gives each worker something to do, and lets whole batches queue behind."""
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
        """Takes the results of batches that came to an end."""
        finished = [future for future in futures if future.status == "finished"]
        results = self.client.gather(finished)
        for future, result in zip(finished, results):
            self._note(self.out.pop(future), result)
        for future in (future for future in futures if future.status != "finished"):
            self._lose(self.out.pop(future), future)
        for future in futures:
            future.release()
        # The scheduler has to hear of it before others take their place in the graph.
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
        """A batch has no result: its workers died, or it raised, or the scheduler is gone."""
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
    """Does what is left of the plan of a mesh or a grid on the cluster that `client` is connected to.

    `plan` is the folder that `terrane plan` made; the workers have to see it, and the input, by the
    same paths. Tasks that are done are left alone, so a job that ended early goes on when it is run
    again. The bytes are those of a run without a plan.

    Args:
        plan: Folder of the plan.
        client: A connected `distributed.Client`. It is left open.
        terrane: The program: on the `PATH` of all workers, or a path that holds on each. Without one it is
            that of this package where a worker has it, and else `terrane` on its `PATH`.
        threads: Threads of a task. A Dask worker thread does one task at a time.
        memory: What a task may take, such as "2GiB"; the program's default when `None`.
        output: File to write, absolute or from here; in the folder when `None`.
        overwrite: Replace a file that is there.
        finish: False leaves the mesh or grid to `terrane plan finish`.
        batch_seconds: Short tasks are done together for about so long.
        retries: Of a task that failed in a way that may pass, or was lost with its worker.
        most_nodes: Nodes in Dask's graph at once.

    Returns:
        What was done; `report.output` is where the mesh or grid is.

    Raises:
        Stop: A task failed for good, or the cluster is gone. `code` is the exit code of the program,
            or 69 when another try may help; the text names the task and what to do.
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
