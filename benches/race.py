#!/usr/bin/env python3
"""Measures terrane beside its peers, all jobs of the speed goals in one run, and says which goals are missed.

    benches/race.py [--terrane PATH] [--only TEXT] [--rounds 3] [--scale 1] [--folder DIR] [--keep] [--list]

Each measurement is a process of its own. The rounds of a group of jobs are interleaved, and medians count: wall
seconds, processor seconds (user + system) and peak memory (20 MiB stands for less). A ratio is that of processor
seconds for one thread and of wall seconds for two threads. terrane is measured as a whole process, with reading and
writing. So are the peers, except pydelatin, rasterio, startin and shapely, of which only the call counts; this
favours them. All inputs are synthetic and are made when a job needs them. `--scale 0.5` halves their sides. Goals
hold for scale 1, and those beside pydelatin for processors with AVX-512.

Prints a table in Markdown, with the ratios of the last run kept in race.json at the same scale. `--keep` writes the
jobs of this run there. A peer that is not installed is named in its row and below the table.

Needs cargo (or --terrane), about 6 GB in DIR (default: a temporary folder; inputs in DIR are used again) and 4 GiB of
memory. Peers: pip install pydelatin laspy lazrs numpy scipy startinpy rasterio exactextract shapely pyogrio, in the
Python that runs this script; apt install gdal-bin; npm install -g mapshaper.
"""

import argparse
import datetime
import json
import pathlib
import statistics
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "peers"))
import measure  # noqa: E402
from calls import Missing, is_call, label, versions  # noqa: E402
from inputs import Inputs, note  # noqa: E402

KEPT = HERE / "race.json"
HEADER = ("job", "threads", "s", "CPU s", "MiB", "peer", "s", "CPU s", "MiB", "ratio", "goal", "met", "last kept")


@dataclass(frozen=True)
class Job:
    """A job of terrane, the peer that does the same, and the goals."""

    name: str
    command: str
    threads: tuple = (1,)
    peer: str = ""  # with {threads}: measured beside each number of threads, else beside the first
    goal: float | None = None  # times as fast as the peer, at least
    speedup: float | None = None  # two threads times as fast as one, at least
    most: tuple | None = None  # times the time of another job, at most: (limit, its name)
    rate: tuple | None = None  # unit, and M units/s with the most threads, at least (or None)
    repeat: int = 1  # runs in a round, of which the mean counts


def tin_jobs():
    has_goals = measure.vectors() == "AVX-512"
    for share, error, default, greedy in (("0.2 %", 6.5, 17, 20), ("1 %", 2.7, 11, 14), ("5 %", 1.07, 6.5, 9)):
        tin, pydelatin = f"tin {{rough}} {{out}}/o.ply --max-error {error}", f"pydelatin {{raw}} {{half}} {error}"
        default, greedy = (default, greedy) if has_goals else (None, None)
        yield Job(f"tin, {share}", tin, (1, 2), pydelatin, default, speedup=1.85)
        yield Job(f"tin --no-drop, {share}", tin + " --no-drop", (1, 2), pydelatin, greedy, speedup=1.85)
        for option, limit in ("--fit-heights", 4), ("--triangulation data-dependent", 1.6):
            yield Job(f"tin {option}, {share}", f"{tin} {option}", most=(limit, f"tin, {share}"))


def compressed_jobs():
    tin = "tin {} {{out}}/o.ply --max-error 25 --memory {}"
    samples, both = ("samples", None), (1, 2)
    yield Job("tin of a COG, 256M", tin.format("{cog}", "256M"), both, speedup=1.85, rate=("samples", 100))
    yield Job("tin of a COG, 128M", tin.format("{cog}", "128M"), both, speedup=1.85, rate=samples,
              most=(1.3, "tin of a COG, 256M"))
    for name in "deflate_strips", "lzw_tiles", "lzw_strips", "zstd_tiles", "zstd_strips", "lerc_tiles", "lerc_strips":
        codec, layout = name.split("_")
        yield Job(f"tin of {codec.upper()} {layout}, 256M", tin.format(f"{{{name}}}", "256M"), both, rate=samples)
    yield Job("tin of four COGs, 256M", tin.format("{nw} {ne} {sw} {se}", "256M"), both, rate=samples)
    yield Job("tin of a VRT, 256M", tin.format("{vrt}", "256M"), both, rate=samples)
    yield Job("convert of a COG", "convert {cog} {out}/o.tif -f GTiff", both, "gdal_translate -q {cog} {out}/o.tif",
              rate=samples)
    yield Job("slope of a COG", "slope {cog} {out}/o.tif", both, "gdaldem slope {cog} {out}/o.tif -q", rate=samples)
    yield Job("contour of a COG", "contour {cog} {out}/o.fgb --interval 100", both,
              "gdal_contour -q -a elev -i 100 -f FlatGeobuf {cog} {out}/o.fgb", rate=samples)
    yield Job("read a COG (info --stats)", "info {cog} --stats", both, "rasterio_blocks {cog} {threads}",
              rate=samples)


def grid_jobs():
    for verb in ("slope", "hillshade"):
        yield Job(verb, f"{verb} {{plain}} {{out}}/o.tif", peer=f"gdaldem {verb} {{plain}} {{out}}/o.tif -q")
    yield Job("color-relief", "color-relief {plain} {colours} {out}/o.tif",
              peer="gdaldem color-relief {plain} {colours} {out}/o.tif -q")
    yield Job("convert --to-crs, bilinear", "convert {plain} {out}/o.tif --to-crs EPSG:4326 --resampling bilinear",
              peer="gdalwarp -q -et 0 -r bilinear -t_srs EPSG:4326 {plain} {out}/o.tif")
    yield Job("contour", "contour {plain} {out}/o.fgb --interval 100",
              peer="gdal_contour -q -a elev -i 100 -f FlatGeobuf {plain} {out}/o.fgb")
    yield Job("zonal, 60 polygons", "zonal {plain} {zones} {out}/o.geojson --stat count,sum,mean,min,max,stdev",
              peer="exactextract {plain} {zones} count,sum,mean,min,max,stdev")


def cloud_jobs():
    stats = "grid {} {{out}}/o.tif --cell 1 --stat {}"
    points, both, two, copc = ("points", None), (1, 2), (2,), "points {laz} {out}/o.copc.laz --memory 256M"
    four, ground = "mean,min,max,count", "tin --class 2"
    yield Job("LAZ to mean, min, max, count", stats.format("{laz}", four), both, "laspy_grid {laz} {threads}",
              rate=("points", 11.9))
    yield Job("LAS to mean, min, max, count", stats.format("{las}", four), both, "laspy_grid {las} 1", rate=points)
    yield Job("LAS to IDW", stats.format("{las}", "idw"), both, rate=points)
    yield Job("LAZ to LAZ", "points {laz} {out}/o.laz", both, "laspy_copy {laz} {out}/o.laz", rate=points)
    yield Job("LAS to LAZ", "points {las} {out}/o.laz", (1,), "laspy_copy {las} {out}/o.laz", rate=("points", 4))
    yield Job("LAZ to COPC, 256M", copc, two, rate=("points", 5))
    for method in ("csf-ptd", "csf", "ptd", "pmf"):
        yield Job(f"--dtm --ground {method}, 512M", f"grid {{laz}} {{out}}/o.tif --cell 1 --dtm --ground {method} "
                  "--memory 512M", two, rate=points)
    yield Job("LAZ to TIN of the ground", stats.format("{laz}", ground), both, rate=("points", 8.3))
    yield Job("LAZ to TIN of the ground, 512M", stats.format("{laz}", ground) + " --memory 512M", two, rate=points)
    yield Job("LAZ to mesh, 0.2 m", "tin {laz} {out}/o.ply --class 2 --max-error 0.2", both, rate=points)
    yield Job("small LAS to TIN of the ground", stats.format("{small_las}", ground), peer="scipy_tin {small_las}")
    yield Job("small LAS, all triangles", "tin {small_las} {out}/o.ply --class 2 --max-error 0", both,
              "startin {small_las}")


def line_jobs():
    rdp = "simplify {} {{out}}/o.{} --method rdp --tolerance {}"
    line, coverage = rdp.format("{koch}", "fgb", 0.05), rdp.format("{coverage}", "geojson", 1)
    yield Job("simplify, one line", line, peer="shapely_simplify {koch} 0.05 no")
    yield Job("simplify --topology, one line", line + " --topology", peer="shapely_simplify {koch} 0.05 yes")
    yield Job("simplify --topology, coverage", coverage + " --topology", (1, 2),
              "mapshaper {coverage} -simplify rdp interval=1 -o {out}/o.geojson")


def small_jobs():
    yield Job("view of 65 x 65 samples", "view {small} -o {out}/o.png", repeat=10)
    yield Job("start (--version)", "--version", repeat=100)


GROUPS = {"tin": tin_jobs, "compressed": compressed_jobs, "grids": grid_jobs, "clouds": cloud_jobs,
          "lines": line_jobs, "small": small_jobs}


def without_goals(job):
    most, rate = job.most and (None, job.most[1]), job.rate and (job.rate[0], None)
    return replace(job, goal=None, speedup=None, most=most, rate=rate)


def chosen(text, scale):
    """By group, the jobs with the text in their name or that of the group, and those they are compared with."""
    for group, jobs_of in GROUPS.items():
        jobs = [job if scale == 1 else without_goals(job) for job in jobs_of()]
        named = [job for job in jobs if text in job.name or text in group]
        names = {job.name for job in named} | {job.most[1] for job in named if job.most}
        yield [job for job in jobs if job.name in names]


def spend(argv, out, repeat):
    """Wall seconds, processor seconds and MiB of a command that writes into `out`: the mean of its runs."""
    costs = []
    for _ in range(repeat):
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        costs.append(measure.run(argv))
    if is_call(argv) and costs[0].stdout:
        facts = json.loads(costs[0].stdout.splitlines()[-1])
        return facts["wall"], facts["cpu"], costs[0].peak_mib
    return [statistics.mean(column) for column in zip(*((cost.wall, cost.cpu, cost.peak_mib) for cost in costs))]


def peer_of(job, threads):
    """The command beside which a job with so many threads is measured, if any."""
    is_beside = threads == job.threads[0] or "{threads}" in job.peer
    return job.peer.replace("{threads}", str(threads)) if is_beside else ""


def race(runs, inputs, rounds):
    """Medians by run (job and threads) and by command of a peer; a text where there are none."""
    commands, found = {}, {}

    def attempt(key, work):
        try:
            return work()
        except Missing as missing:
            found[key] = f"not here: {missing}"
        except measure.Failed as failure:
            found[key] = f"failed: {key if isinstance(key, str) else key[0]}"
            note(failure)

    for job, threads in runs:
        options = "" if job.command.startswith("--") else f" -q --threads {threads}"
        for key, command, repeat in (((job.name, threads), job.command + options, job.repeat),
                                     (peer_of(job, threads), peer_of(job, threads), 1)):
            argv = attempt(key, lambda: inputs.argv(command)) if command else None
            commands |= {key: (argv, repeat)} if argv else {}
    costs = {key: [] for key in commands}
    for turn in range(rounds):
        for key in [key for key in commands if key not in found]:
            note(f"round {turn + 1} of {rounds}: {key}")
            cost = attempt(key, lambda: spend(commands[key][0], inputs.out, commands[key][1]))
            costs[key] += [cost] if cost else []
    return {key: [statistics.median(column) for column in zip(*costs[key])] for key in costs} | found


@dataclass(frozen=True)
class Ratio:
    value: float
    unit: str
    least: float | None = None
    most: float | None = None

    def goal(self):
        return f"≥ {self.least}" if self.least else f"≤ {self.most}" if self.most else ""

    def met(self):
        is_met = self.value >= self.least if self.least else self.value <= self.most if self.most else None
        return {None: "", True: "yes", False: "no"}[is_met]


def ratios(job, threads, found, inputs):
    """The comparisons of a run."""
    index = 1 if threads == 1 else 0

    def seconds(key, index=index):
        return None if isinstance(found.get(key), (str, type(None))) else found[key][index]

    own, peer = seconds((job.name, threads)), peer_of(job, threads)
    if own is None:
        return
    if theirs := seconds(peer):
        yield Ratio(theirs / own, f"times as fast as {label(peer)}", least=job.goal)
    if threads > 1 and (one := seconds((job.name, 1), 0)):
        yield Ratio(one / own, "times as fast as one thread", least=job.speedup)
    if job.most and (other := seconds((job.most[1], threads))):
        yield Ratio(own / other, f"times the time of {job.most[1]}", most=job.most[0])
    if job.rate:
        least = job.rate[1] if threads == job.threads[-1] else None
        yield Ratio(inputs.millions(job.rate[0]) / own, f"M {job.rate[0]}/s", least)


def figures(cost):
    return [cost, "", ""] if isinstance(cost, str) else [f"{cost[0]:.3g}", f"{cost[1]:.3g}", f"{cost[2]:.0f}"]


def rounded(numbers):
    return [float(f"{number:.4g}") for number in numbers] if isinstance(numbers, list) else numbers


def row(*cells):
    print(f"| {' | '.join(map(str, cells))} |", flush=True)


def report(job, threads, found, inputs, last):
    """Prints the rows of a run; returns what is kept of it, and the goals it misses."""
    peer, told = peer_of(job, threads), list(ratios(job, threads, found, inputs))
    start = [job.name, threads, *figures(found[job.name, threads])]
    start += [label(peer), *figures(found[peer])] if peer else [""] * 4
    for ratio in told:
        before = last.get("ratios", {}).get(ratio.unit)
        row(*start, f"{ratio.value:.3g} {ratio.unit}", ratio.goal(), ratio.met(),
            "" if before is None else f"{before:.3g}")
        start = [""] * 9
    if not told:
        before = last.get("terrane")
        row(*start, "", "", "", f"{before[0]:.3g} s" if isinstance(before, list) else "")
    missed = [f"goal missed: {job.name}, threads {threads}: {ratio.value:.3g} {ratio.unit}, goal {ratio.goal()}"
              for ratio in told if ratio.met() == "no"]
    kept = {"terrane": rounded(found[job.name, threads]), "peer": rounded(found.get(peer))}
    return kept | {"ratios": {ratio.unit: float(f"{ratio.value:.4g}") for ratio in told}}, missed


def listing(job):
    goals = (job.goal and f"≥ {job.goal} times its speed",
             job.speedup and f"two threads ≥ {job.speedup} times one",
             job.most and f"≤ {job.most[0]} times {job.most[1]}",
             job.rate and job.rate[1] and f"≥ {job.rate[1]} M {job.rate[0]}/s")
    beside = [f"beside {label(job.peer)}"] if job.peer else []
    return "; ".join([job.name, f"threads {' and '.join(map(str, job.threads))}", *beside, *filter(None, goals)])


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--terrane", type=pathlib.Path, default=HERE.parent / "target/release/terrane")
    parser.add_argument("--only", default="", help=f"jobs, or groups ({', '.join(GROUPS)}), with this in their name")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--scale", type=float, default=1.0, help="factor of the sides of all inputs")
    parser.add_argument("--folder", type=pathlib.Path, help="folder for inputs, which are used again")
    parser.add_argument("--keep", action="store_true", help="write the jobs of this run into race.json")
    parser.add_argument("--list", action="store_true", help="list the jobs and their goals")
    return parser.parse_args()


def main():
    options = arguments()
    groups = list(chosen(options.only, options.scale))
    if options.list:
        return print("\n".join(map(listing, sum(groups, []))))
    if not options.terrane.exists():
        subprocess.run(["cargo", "build", "--release", "--bin", "terrane"], cwd=HERE.parent, check=True)
    kept, new, remarks = json.loads(KEPT.read_text()) if KEPT.exists() else {}, {}, []
    facts = {"date": f"{datetime.date.today()}", "machine": measure.machine(), "scale": options.scale}
    print(f"date: {facts['date']}; commit {measure.commit(HERE.parent)}  \nmachine: {facts['machine']}  ")
    print(f"command: benches/race.py {' '.join(sys.argv[1:])}  ")
    print(f"peers: {versions(job.peer for job in sum(groups, []))}  \n")
    row(*HEADER)
    row(*("---" if name in ("job", "peer", "ratio", "met") else "---:" for name in HEADER))
    with tempfile.TemporaryDirectory() as temporary:
        inputs = Inputs(options.terrane.resolve(), options.folder or pathlib.Path(temporary), options.scale)
        for runs in [[(job, threads) for job in jobs for threads in job.threads] for jobs in groups]:
            found = race(runs, inputs, options.rounds)
            for job, threads in runs:
                key = f"{job.name}, {threads}"
                last = kept.get(key, {}) if kept.get(key, {}).get("scale") == options.scale else {}
                entry, missed = report(job, threads, found, inputs, last)
                new[key], remarks = facts | entry, remarks + missed
            remarks += [text for text in found.values() if isinstance(text, str)]
    print("\n" + "\n".join(f"- {remark}" for remark in dict.fromkeys(remarks)))
    if options.keep:
        lines = (f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in (kept | new).items())
        KEPT.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    return any(remark.startswith("failed") for remark in remarks)


if __name__ == "__main__":
    sys.exit(main())
