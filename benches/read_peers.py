#!/usr/bin/env python3
"""Compares how fast terrane and GDAL (through rasterio) read the same files.

    benches/read_peers.py [--rounds 5] [--side 4096] [--folder DIR]

Makes a rough terrain in float32 and one in int16, writes them with GDAL in each compression, and
reads every sample of each file by windows, from one thread and from two. Rounds are interleaved:
terrane, GDAL, terrane, ... Each reading opens the file anew, so nothing is cached but by the
system; each thread of GDAL has a dataset of its own, and its samples stay in the file's type, while
terrane hands out float32 heights with voids marked. The best of the rounds counts. Prints a table in
Markdown: millions of samples a second, and for text megabytes.

With --cpu it is seconds of the processor that count, of one thread, with the start of the process in
terrane's: for a machine that has other work to do.

Needs cargo, numpy and rasterio; about 900 MB in DIR (default: a temporary folder).
"""

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import threading
import time

import numpy as np
import rasterio
from rasterio.windows import Window

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
TILE = 512
FLOAT, INTEGER = "rough", "integer"
# Name, terrain, options of GDAL's GTiff driver.
FILES = [
    ("float32 deflate, predictor 3", FLOAT, dict(compress="deflate", predictor=3)),
    ("float32 zstd, predictor 3", FLOAT, dict(compress="zstd", predictor=3)),
    ("float32 LZW, predictor 3", FLOAT, dict(compress="lzw", predictor=3)),
    ("float32 LZW, predictor 2", FLOAT, dict(compress="lzw", predictor=2)),
    ("float32 LZW", FLOAT, dict(compress="lzw")),
    ("int16 LZW, predictor 2", INTEGER, dict(compress="lzw", predictor=2)),
    ("int16 deflate, predictor 2", INTEGER, dict(compress="deflate", predictor=2)),
    ("float32 none", FLOAT, dict()),
]
# Name, terrain, how a number is written.
TEXTS = [("text, 2 decimals", FLOAT, "%.2f"), ("text, 6 decimals", FLOAT, "%.6f"),
         ("text, whole numbers", INTEGER, "%d")]


def executable(kind, name):
    """Builds a binary or benchmark for measuring and returns its path."""
    build = ["build", "--release", "--bin"] if kind == "bin" else ["bench", "--no-run", "--bench"]
    command = ["cargo", *build, name, "--message-format=json"]
    lines = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    made = [json.loads(line) for line in lines.splitlines()]
    paths = [m["executable"] for m in made if m.get("executable") and m["target"]["name"] == name]
    return paths[-1]


def terrain(terrane, character, side, folder):
    """Samples of a synthetic terrain."""
    store = os.path.join(folder, f"{character}.store.tif")
    name = f"synth:{character},size={side},seed=7"
    subprocess.run([terrane, "convert", name, store, "--overwrite", "--quiet"], check=True)
    with rasterio.open(store) as dataset:
        samples = dataset.read(1)
    os.remove(store)
    return samples


def write_tiff(path, samples, options):
    profile = dict(driver="GTiff", width=samples.shape[1], height=samples.shape[0], count=1,
                   dtype=samples.dtype, tiled=True, blockxsize=256, blockysize=256, crs="EPSG:32631",
                   transform=rasterio.transform.from_origin(5e5, 4.75e6, 30, 30), **options)
    with rasterio.open(path, "w", **profile) as dataset:
        dataset.write(samples, 1)


def write_text(path, samples, number):
    rows, columns = samples.shape
    with open(path, "w") as out:
        out.write(f"ncols {columns}\nnrows {rows}\nxllcorner 0\nyllcorner 0\ncellsize 30\n")
        np.savetxt(out, samples, fmt=number)


def write_points(path, samples):
    rows, columns = np.indices(samples.shape)
    points = [5e5 + 30 * columns.ravel(), 4.75e6 - 30 * rows.ravel(), samples.ravel()]
    np.savetxt(path, np.column_stack(points), fmt=["%.1f", "%.1f", "%.3f"])


def windows(dataset, width, height):
    for row in range(0, dataset.height, height):
        for column in range(0, dataset.width, width):
            yield Window(column, row, min(width, dataset.width - column),
                         min(height, dataset.height - row))


def read_gdal(path, threads, width, height):
    """Seconds that GDAL takes for all samples."""
    def work(first):
        with rasterio.open(path) as dataset:
            for window in list(windows(dataset, width, height))[first::threads]:
                dataset.read(1, window=window)

    start = time.perf_counter()
    workers = [threading.Thread(target=work, args=(first,)) for first in range(threads)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return time.perf_counter() - start


def read_terrane(bench, path, threads, width, height):
    command = [bench, "read", str(threads), str(width), str(height), path]
    return float(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)


def cpu_seconds(who, work):
    """Seconds of the processor that `work` takes in this process or in its children."""
    def spent():
        usage = resource.getrusage(who)
        return usage.ru_utime + usage.ru_stime

    start = spent()
    work()
    return spent() - start


def race(bench, path, threads, shape, rounds, cpu):
    """Best seconds of terrane and of GDAL."""
    ours = lambda: read_terrane(bench, path, threads, *shape)
    theirs = lambda: read_gdal(path, threads, *shape)
    if cpu:
        pairs = [(cpu_seconds(resource.RUSAGE_CHILDREN, ours),
                  cpu_seconds(resource.RUSAGE_SELF, theirs)) for _ in range(rounds)]
    else:
        pairs = [(ours(), theirs()) for _ in range(rounds)]
    return [min(times) for times in zip(*pairs)]


def prepare(terrane, folder, side):
    """Writes all files; yields name, path, size of the windows and units read (samples or bytes)."""
    grids = {kind: terrain(terrane, kind, side, folder) for kind in (FLOAT, INTEGER)}
    for number, (name, kind, options) in enumerate(FILES):
        path = os.path.join(folder, f"{number}.tif")
        write_tiff(path, grids[kind], options)
        yield name, path, (TILE, TILE), side * side, "M samples/s"
    for index, (name, kind, number) in enumerate(TEXTS):
        path = os.path.join(folder, f"{index}.asc")
        write_text(path, grids[kind][: side // 2, : side // 2], number)
        yield name, path, (side // 2, TILE), os.path.getsize(path), "MB/s"
    path = os.path.join(folder, "points.xyz")
    write_points(path, grids[FLOAT][: side // 4, : side // 4])
    yield "points (xyz), 3 decimals", path, (side // 4, TILE), os.path.getsize(path), "MB/s"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--side", type=int, default=4096)
    parser.add_argument("--folder")
    parser.add_argument("--cpu", action="store_true")
    options = parser.parse_args()
    terrane, bench = executable("bin", "terrane"), executable("bench", "raster_read")
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        files = list(prepare(terrane, folder, options.side))
        print(f"date: {time.strftime('%Y-%m-%d %H:%M UTC', time.gmtime())}  ")
        print(f"machine: {platform.machine()}, {os.cpu_count()} cores; load average "
              f"{os.getloadavg()[0]:.1f} at the start  ")
        print(f"peers: rasterio {rasterio.__version__}, GDAL {rasterio.__gdal_version__}  ")
        clock = "seconds of the processor" if options.cpu else "seconds of the clock"
        print(f"job: {options.side} x {options.side} samples, best of {options.rounds}, {clock}\n")
        crews = {1: "1 thread"} if options.cpu else {1: "1 thread", 2: "2 threads"}
        heads = [f"terrane, {crew} | GDAL, {crew} | times" for crew in crews.values()]
        print(f"| file | unit | {' | '.join(heads)} |")
        print(f"|---|---|{'---:|' * 3 * len(crews)}")
        for name, path, shape, units, unit in files:
            cells = []
            for threads in crews:
                ours, theirs = race(bench, path, threads, shape, options.rounds, options.cpu)
                cells += [f"{units / ours / 1e6:.0f}", f"{units / theirs / 1e6:.0f}",
                          f"{theirs / ours:.2f}"]
            print(f"| {name} | {unit} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
