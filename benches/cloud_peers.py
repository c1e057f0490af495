#!/usr/bin/env python3
"""Compares terrane with laspy, numpy, scipy and startin on the same clouds, job by job.

    benches/cloud_peers.py [--terrane PATH] [--size 2280] [--rounds 3] [--folder DIR] [--only TEXT]

Makes an airborne-like cloud (`terrane synth cloud`, about 8 points a square metre, point format 6) as
LAS and LAZ, and does each job with each program, a process of its own each time, rounds interleaved.
Prints a table in Markdown: medians of wall seconds, processor seconds and peak memory.

Needs cargo (or --terrane), laspy, lazrs, numpy, scipy and startinpy; about 1.6 GB in DIR for the
default size of 41 million points (default: a temporary folder).
"""

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import textwrap
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
# What a peer does, as a program of its own: {cloud} is the file.
NUMPY_GRID = """
    import laspy, numpy as np
    with laspy.open({cloud!r}, laz_backend={backend}) as f:
        h = f.header
        x0, y1 = np.floor(h.mins[0]), np.floor(h.maxs[1]) + 1
        cols, rows = int(np.floor(h.maxs[0]) + 1 - x0), int(y1 - np.floor(h.mins[1]))
        n = np.zeros(cols * rows, np.int64); s = np.zeros(cols * rows)
        lo = np.full(cols * rows, np.inf); hi = np.full(cols * rows, -np.inf)
        for p in f.chunk_iterator(1_000_000):
            c = (np.ceil(y1 - np.asarray(p.y)).astype(np.int64) - 1) * cols
            c += (np.asarray(p.x) - x0).astype(np.int64)
            z = np.asarray(p.z)
            n += np.bincount(c, minlength=cols * rows)
            s += np.bincount(c, z, minlength=cols * rows)
            np.minimum.at(lo, c, z); np.maximum.at(hi, c, z)
"""
SCIPY_TIN = """
    import laspy, numpy as np
    from scipy.interpolate import LinearNDInterpolator
    p = laspy.read({cloud!r}); k = p.classification == 2
    xy = np.c_[np.asarray(p.x)[k], np.asarray(p.y)[k]]; z = np.asarray(p.z)[k]
    xs = np.arange(np.floor(xy[:, 0].min()) + .5, xy[:, 0].max())
    ys = np.arange(np.floor(xy[:, 1].min()) + .5, xy[:, 1].max())
    LinearNDInterpolator(xy, z)(*np.meshgrid(xs, ys))
"""
STARTIN = """
    import laspy, numpy as np, startinpy
    p = laspy.read({cloud!r}); k = p.classification == 2
    dt = startinpy.DT(); dt.insert(np.c_[p.x, p.y, p.z][k])
"""
BACKENDS = {
    "lazrs, one thread": "laspy.LazBackend.Lazrs",
    "lazrs, all threads": "laspy.LazBackend.LazrsParallel",
}


def jobs(terrane, big, small):
    """Job, program, command."""
    stats = ["--cell", "1", "--stat", "mean,min,max,count"]

    def grid(cloud, threads, *more):
        return [terrane, "grid", cloud, "{out}.tif", "--overwrite", "-q", "--threads", str(threads), *more]

    def python(text, cloud, backend="None"):
        code = textwrap.dedent(text).format(cloud=cloud, backend=backend)
        return [sys.executable, "-c", code]

    for kind in ("las", "laz"):
        name = f"{kind.upper()} to mean, min, max, count"
        for threads in (1, 2):
            yield name, f"terrane, {threads} thread(s)", grid(f"{big}.{kind}", threads, *stats)
        backends = BACKENDS.items() if kind == "laz" else [("LAS", "None")]
        for label, backend in backends:
            yield name, f"laspy + numpy ({label})", python(NUMPY_GRID, f"{big}.{kind}", backend)
    for threads in (1, 2):
        yield "LAS to IDW", f"terrane, {threads} thread(s)", grid(
            f"{big}.las", threads, "--cell", "1", "--stat", "idw")
    for threads, memory in ((1, "4G"), (2, "4G"), (2, "512M")):
        yield "LAZ to TIN of the ground", f"terrane, {threads} thread(s), {memory}", grid(
            f"{big}.laz", threads, "--cell", "1", "--stat", "tin", "--class", "2", "--memory", memory)
    yield "small LAS to TIN of the ground", "terrane, 1 thread", grid(
        f"{small}.las", 1, "--cell", "1", "--stat", "tin", "--class", "2")
    yield "small LAS to TIN of the ground", "scipy", python(SCIPY_TIN, f"{small}.las")
    mesh = [terrane, "tin", f"{small}.las", "{out}.ply", "--class", "2", "--overwrite", "-q"]
    for threads in (1, 2):
        yield "small LAS, all triangles", f"terrane, {threads} thread(s), written as PLY", [
            *mesh, "--max-error", "0", "--threads", str(threads)]
    yield "small LAS, all triangles", "startin, in memory", python(STARTIN, f"{small}.las")
    for threads in (1, 2):
        yield "LAZ to mesh, 0.2 m", f"terrane, {threads} thread(s)", [
            terrane, "tin", f"{big}.laz", "{out}.ply", "--class", "2", "--overwrite", "-q",
            "--max-error", "0.2", "--threads", str(threads)]


def measure(command):
    """Wall seconds, processor seconds, peak MiB."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"failed: {command}")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--terrane")
    parser.add_argument("--size", type=int, default=2280)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder")
    parser.add_argument("--only", default="", help="jobs with this in their name")
    args = parser.parse_args()
    if not args.terrane:
        subprocess.run(["cargo", "build", "--release"], cwd=ROOT, check=True)
        args.terrane = os.path.join(ROOT, "target/release/terrane")
    with tempfile.TemporaryDirectory(dir=args.folder) as folder:
        big, small = os.path.join(folder, "big"), os.path.join(folder, "small")
        for name, size in ((big, args.size), (small, args.size * 0.35)):
            for kind in ("las", "laz"):
                cloud = f"cloud,size={size:.0f},density=8,seed=7"
                subprocess.run([args.terrane, "synth", cloud, f"{name}.{kind}", "-q"], check=True)
        wanted = [job for job in jobs(args.terrane, big, small) if args.only in job[0]]
        figures = {job[:2]: [] for job in wanted}
        for _ in range(args.rounds):
            for job, program, command in wanted:
                out = os.path.join(folder, "out")
                command = [word.replace("{out}", out) for word in command]
                figures[job, program].append(measure(command))
    print(f"machine: {platform.processor() or platform.machine()}, {os.cpu_count()} cores  ")
    print(f"command: benches/cloud_peers.py --size {args.size} --rounds {args.rounds}  \n")
    print("| job | program | s | CPU s | peak MiB |\n|---|---|---:|---:|---:|")
    for (job, program), runs in figures.items():
        wall, cpu, peak = (statistics.median(column) for column in zip(*runs))
        print(f"| {job} | {program} | {wall:.2f} | {cpu:.2f} | {peak:.0f} |")


if __name__ == "__main__":
    main()
