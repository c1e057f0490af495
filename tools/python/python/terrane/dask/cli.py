"""The command line."""

from __future__ import annotations

import argparse
import asyncio
import concurrent.futures
import json
import logging
import os
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import NoReturn

from distributed import Client

from terrane.dask.driver import AGAIN, TRY_AGAIN, Job, Report, Stop, run, say
from terrane.dask.worker import INTERRUPTED

CANCELLED = (asyncio.CancelledError, concurrent.futures.CancelledError)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """`python -m terrane.dask WORKDIR`: exits with 0, with the code of the program that failed, with 69 when
    the cluster failed, or with 130."""
    args = parser().parse_args(arguments)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    # Dask logs every connection event; relevant ones are reported below.
    logging.disable(logging.ERROR)
    try:
        print(json.dumps(asdict(work(args)), indent=2))
        code = 0
    except Stop as stop:
        say(str(stop))
        code = stop.code
    except KeyboardInterrupt:
        say(f"interrupted; {AGAIN}")
        code = INTERRUPTED
    sys.exit(code)


def work(args: argparse.Namespace) -> Report:
    """Runs the job on the requested cluster."""
    try:
        with Client(args.scheduler) if args.scheduler else local(args) as client:
            return run(
                args.workdir,
                client,
                terrane=args.terrane,
                threads=args.threads_per_task,
                memory=args.memory,
                output=args.output,
                overwrite=args.overwrite,
                finish=args.finish,
                batch_seconds=args.batch_seconds,
                retries=args.retries,
                most_nodes=args.max_nodes,
            )
    except (OSError, TimeoutError, *CANCELLED) as error:
        raise Stop(TRY_AGAIN, f"the cluster is gone ({error}); {AGAIN}") from error


def local(args: argparse.Namespace) -> Client:
    """Worker processes on this machine, which end with this one."""
    # The program manages its own memory; workers need almost none.
    return Client(
        n_workers=args.workers or max(1, (os.cpu_count() or 1) // args.threads_per_task),
        threads_per_worker=1,
        memory_limit=None,
        # Ctrl-C reaches all processes of a terminal; this one cancels cleanly.
        preload="import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)",
        dashboard_address=None,
        silence_logs=logging.CRITICAL,
    )


def parser() -> argparse.ArgumentParser:
    """The options; their defaults are those of `Job`."""
    parser = argparse.ArgumentParser(
        prog="python -m terrane.dask",
        description="Do the tasks of a terrane plan on a Dask cluster. Done tasks are skipped. "
        "Prints a report as JSON.",
    )
    add = parser.add_argument
    add("workdir", metavar="WORKDIR", help="folder of the plan; all workers see it at this path")
    add("--scheduler", metavar="ADDRESS", help="such as tcp://host:8786 [default: this machine]")
    add("--workers", metavar="N", type=at_least(1), help="here [default: cores / threads a task]")
    add("--threads-per-task", metavar="N", type=at_least(1), default=Job.threads)
    add("--memory", metavar="SIZE", help="for a task, such as 2GiB [default: the program's]")
    add("--terrane", metavar="PATH", default=Job.terrane, help="the program [default: that of this package]")
    add("--output", metavar="FILE", help="file to write [default: in the folder]")
    add("--overwrite", action="store_true", help="replace a file that exists")
    add("--no-finish", dest="finish", action="store_false", help="all tasks, but no mesh or grid")
    add("--batch-seconds", metavar="S", type=float, default=Job.batch_seconds,
        help="duration of a batch of short tasks, about [default: %(default)s]")  # fmt: skip
    add("--retries", metavar="N", type=at_least(0), default=Job.retries,
        help="of a task that failed or was lost with its worker [default: %(default)s]")  # fmt: skip
    add("--max-nodes", metavar="N", type=at_least(1), default=Job.most_nodes,
        help="nodes in Dask's graph at once [default: %(default)s]")  # fmt: skip
    return parser


def at_least(least: int) -> Callable[[str], int]:
    """A parser of integers with a minimum."""

    def number(text: str) -> int:
        if int(text) < least:
            raise argparse.ArgumentTypeError(f"at least {least}")
        return int(text)

    return number
