"""Batches: every task once, after those it waits for; as long as asked for; what failed alone."""

import random

import pytest

from terrane.dask.batches import FINISH, Queue, Task


def plan(strips: int, samples: int = 100) -> list[Task]:
    """Tasks as a plan has them, in its order."""
    tasks = []
    for strip in range(strips):
        tasks.append(Task(f"strip-{strip}", (), samples))
        if strip:
            both = (f"strip-{strip - 1}", f"strip-{strip}")
            tasks.append(Task(f"seam-{strip - 1}", both, samples))
    return [*tasks, Task(FINISH, (), strips * samples)]


@pytest.mark.parametrize("seed", range(50))
def test_tasks_come_once_and_after_those_they_wait_for(seed: int) -> None:
    chance = random.Random(seed)
    tasks = plan(chance.randint(1, 40))
    queue = Queue(tasks, chance.choice([0.0, 3.0, 20.0, 1e9]))
    done: list[str] = []
    out: list[list[Task]] = []
    while queue.left:
        if queue.has_ready() and (not out or chance.random() < 0.6):
            out.append(queue.take(chance.randint(1, 5)))
            continue
        assert out, "nothing is out and nothing is ready"
        batch = out.pop(chance.randrange(len(out)))
        failed = chance.randrange(len(batch)) if chance.random() < 0.2 else len(batch)
        for task in batch[:failed]:
            must = [t.id for t in tasks[:-1]] if task.id == FINISH else task.after
            assert set(must) <= set(done) and task.id not in done
            done.append(task.id)
            queue.done(task, chance.random() * 2)
        for task in batch[failed:]:
            queue.tries[task.id] += task is batch[failed]
            queue.give_back(task)
    assert sorted(done) == sorted(task.id for task in tasks) and not out


def test_one_task_at_a_time_until_a_time_is_measured_then_whole_batches() -> None:
    queue = Queue(plan(100), 30.0)
    first = queue.take(1)
    assert [task.id for task in first] == ["strip-0"] and not queue.has_batch()
    queue.done(first[0], 2.0)
    assert queue.has_batch()
    batch = queue.take(1)
    assert [task.id for task in batch[:4]] == ["strip-1", "seam-0", "strip-2", "seam-1"]
    assert len(batch) == 15, "30 seconds of 2 each"
    for task in batch:
        queue.done(task, 6.0)
    assert 5 <= len(queue.take(1)) <= 6, "they take longer than was thought"


def test_work_that_is_short_is_shared() -> None:
    queue = Queue(plan(9), 30.0)
    queue.done(queue.take(4)[0], 1.0)
    assert len(queue.take(4)) == 2, "8 strips are ready, for 4 workers"


def test_what_failed_goes_alone() -> None:
    queue = Queue(plan(20), 1e9)
    queue.done(queue.take(1)[0], 1.0)
    batch = queue.take(1)
    assert "strip-5" in [task.id for task in batch[1:-1]]
    queue.tries["strip-5"] += 1
    for task in batch:
        queue.give_back(task)
    batches = []
    while queue.has_ready():
        batches.append([task.id for task in queue.take(1)])
    assert ["strip-5"] in batches and len(batches[0]) > 1, batches


def test_a_plan_that_only_lacks_its_mesh() -> None:
    queue = Queue([Task(FINISH, (), 1)], 30.0)
    assert [task.id for task in queue.take(3)] == [FINISH]
