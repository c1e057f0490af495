#!/usr/bin/env python3
"""Counts the instructions of some jobs and compares them with the counts kept in instructions.json.

    benches/instructions.py [--terrane target/debug/terrane] [--keep]

Counts do not depend on how busy a machine is, so they show whether a job needs more instructions where times could
not. 10 % more than the kept count is an error; after a change that is worth it, or with another compiler, `--keep`
writes the new counts. 10 % less is reported; accept it with `--keep`. A job that names its threads once regressed with
more threads or less memory; all others use one thread. The count of unchanged code varies by up to
8 %, where the compiler divides a crate otherwise.

Needs valgrind, which emulates AVX2 but not AVX-512. The build is that of the tests: other builds have other counts.
"""

import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile

KEPT = pathlib.Path(__file__).with_name("instructions.json")
MARGIN = 0.1
INPUTS = """
    synth rough,size=769,seed=7 grid.tif
    convert grid.tif cog.tif -f COG --co PREDICTOR=3
    convert grid.tif coarse.tif --resolution 25 --resampling bilinear
    convert grid.tif part.tif --bounds 501000,4744000,505000,4748000
    synth cloud,size=80,density=8,seed=3 cloud.laz
    synth cloud,size=700,density=1,seed=3 wide.laz
    synth koch,vertices=60000 lines.geojson
    tin grid.tif checked.ply --max-error 2
"""
ZONES = "POLYGON ((500103 4749951, 507000 4749904, 505610 4742402, 500103 4749951))"
JOBS = {
    "start": "--version",
    "tin": "tin grid.tif tin.ply --max-error 2",
    "tin, insertion alone": "tin grid.tif greedy.ply --max-error 2 --no-drop",
    "tin, heights fitted": "tin grid.tif fitted.ply --max-error 2 --fit-heights",
    "tin of a compressed grid": "tin cog.tif cog.ply --max-error 50",
    "verify": "verify checked.ply grid.tif",
    "slope": "slope grid.tif slope.tif",
    "contour": "contour grid.tif contours.geojson --interval 50",
    "contour, polygons": "contour grid.tif bands.geojson --interval 50 --polygons",
    "read points": "grid cloud.laz means.tif --cell 1 --stat mean",
    "write points": "points cloud.laz copy.laz --where class=2",
    "ground": "grid cloud.laz ground.tif --cell 1 --dtm --ground ptd",
    "ground, two threads, little memory": "grid wide.laz wide.tif --cell 1 --dtm --ground pmf --threads 2 --memory 200M",
    "resample": "convert coarse.tif fine.tif --resolution 10 --resampling cubic",
    "merge, feathered": "convert coarse.tif part.tif merged.tif --resampling bilinear --feather 8",
    "reproject": "convert grid.tif globe.tif --to-crs EPSG:4326 --resampling bilinear",
    "write points, octree": "points cloud.laz copy.copc.laz",
    "zonal": "zonal grid.tif zones.wkt zones.geojson --stat mean,p90",
    "sample": "sample grid.tif zones.wkt draped.geojson --with-z --step 2",
    "simplify, topology kept": "simplify lines.geojson simple.geojson --tolerance 1 --topology",
}


def arguments(job):
    return job.split() + ([] if job.startswith("-") else ["--quiet"])


def count(terrane, job, folder):
    """Instructions of the whole process."""
    threads = [] if job.startswith("-") or "--threads" in job else ["--threads", "1"]
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", terrane, *arguments(job), *threads]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    found = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode != 0 or not found:
        sys.exit(f"{job}: exit {done.returncode}\n{done.stderr}")
    return int(found[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--terrane", type=pathlib.Path, default=KEPT.parent.parent / "target/debug/terrane")
    parser.add_argument("--keep", action="store_true", help="write the counts into instructions.json")
    options = parser.parse_args()
    terrane = options.terrane.resolve()
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    if not options.keep and kept.keys() != JOBS.keys():
        sys.exit("instructions.json has other jobs: run with --keep")
    counts, regressions = {}, []
    with tempfile.TemporaryDirectory() as folder:
        for line in INPUTS.strip().splitlines():
            subprocess.run([terrane, *arguments(line)], cwd=folder, check=True)
        folder = pathlib.Path(folder)
        (folder / "zones.wkt").write_text(ZONES)
        (folder / "zones.prj").write_text("EPSG:32631")
        for name, job in JOBS.items():
            counts[name] = count(terrane, job, folder)
            ratio = counts[name] / kept.get(name, counts[name])
            print(f"{name:36} {counts[name] / 1e6:10.1f} M  {ratio:.3f}", flush=True)
            if ratio > 1 + MARGIN:
                regressions.append(f"{name}: {ratio:.3f} times the kept count")
            elif ratio < 1 - MARGIN:
                print(f"{name}: fewer than the kept count; accept it with --keep")
    if options.keep:
        KEPT.write_text(json.dumps(counts, indent=2) + "\n")
    elif regressions:
        sys.exit("\n".join(regressions))


main()
