"""Batches of tasks, and their order."""

from __future__ import annotations

import heapq
import math
from collections import Counter, defaultdict
from collections.abc import Container, Iterable
from dataclasses import dataclass

FINISH = "finish"
# Weight of the past beside the next measured time: terrain changes along a plan.
MEMORY = 0.98


@dataclass(frozen=True)
class Task:
    """A task of a plan: name, dependencies, and work (samples of a mesh, cells of a grid)."""

    id: str
    after: tuple[str, ...]
    work: int


class Queue:
    """Open tasks in the order of the plan. The task `finish` depends on all."""

    def __init__(self, tasks: Iterable[Task], batch_seconds: float) -> None:
        self.left = {task.id: task for task in tasks}
        self.tries: Counter[str] = Counter()
        self._batch_seconds = batch_seconds
        self._work = self._seconds = 0.0
        self._rank = {id: rank for rank, id in enumerate(self.left)}
        self._followers: dict[str, list[Task]] = defaultdict(list)
        # Neither ready, nor submitted, nor done.
        self._waiting = set(self.left)
        self._ready: list[tuple[int, Task]] = []
        self._ready_work = 0
        for task in self.left.values():
            for before in task.after:
                self._followers[before].append(task)
        self._release(list(self.left.values()))

    def has_ready(self) -> bool:
        """True when a task can be done now."""
        return bool(self._ready)

    def has_batch(self) -> bool:
        """True when a whole batch is known to be ready."""
        return self._batch_seconds <= self._estimate(self._ready_work) < math.inf

    def take(self, workers: int) -> list[Task]:
        """The next batch of at least one task, in dependency order. Smaller than a whole batch if there is not enough
        work for all `workers`; one task until a time is measured. Failed tasks are submitted alone, so a crash loses
        nothing else."""
        seconds = min(self._batch_seconds, self._estimate(self._ready_work) / workers)
        batch: dict[str, Task] = {}
        while self._ready and (not batch or seconds > 0 and not self.tries[self._ready[0][1].id]):
            task = heapq.heappop(self._ready)[1]
            self._ready_work -= task.work
            joined = [task]
            while joined and (not batch or seconds > 0):
                task = joined.pop()
                batch[task.id] = task
                seconds -= math.inf if self.tries[task.id] else self._estimate(task.work)
                joined += [next for next in self._followers[task.id] if self._may_join(next, batch)]
            self._waiting.difference_update(batch)
        return list(batch.values())

    def done(self, task: Task, seconds: float | None) -> None:
        """Records that `task` is done, with its time unless it was done before."""
        self.left.pop(task.id, None)
        if seconds is not None:
            self._work = self._work * MEMORY + task.work
            self._seconds = self._seconds * MEMORY + seconds
        self._release(self._followers[task.id])
        if len(self.left) == 1:
            self._release(list(self.left.values()))

    def give_back(self, task: Task) -> None:
        """Returns an unfinished task to the queue."""
        self._waiting.add(task.id)
        self._release([task])

    def _release(self, tasks: list[Task]) -> None:
        for task in tasks:
            if task.id in self._waiting and self._is_free(task, ()):
                self._waiting.remove(task.id)
                heapq.heappush(self._ready, (self._rank[task.id], task))
                self._ready_work += task.work

    def _may_join(self, task: Task, batch: Container[str]) -> bool:
        waits = task.id in self._waiting and task.id not in batch
        return waits and not self.tries[task.id] and self._is_free(task, batch)

    def _is_free(self, task: Task, batch: Container[str]) -> bool:
        if task.id == FINISH:
            return len(self.left) == 1
        return all(before not in self.left or before in batch for before in task.after)

    def _estimate(self, work: int) -> float:
        """Estimated seconds; infinite before the first measurement."""
        return work * self._seconds / self._work if self._work else math.inf
