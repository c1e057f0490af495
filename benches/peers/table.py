"""Results as markdown. Standard library only; `table.py results.json` prints an earlier race."""

import json
import sys
from itertools import groupby

from contestants import PEER

COLUMNS = [
    "contestant", "wall s", "CPU s", "tiles + seams s", "ns/sample", "peak MiB", "vertices",
    "triangles", "true max error", "beyond", "faster: wall / CPU / tiles + seams", "vertices +-",
]


SUMMARY = [
    "grid", "tolerance", "kept", "greedy", "default", "greedy, tiles + seams",
    "default, tiles + seams", "two threads", "vertices, greedy", "vertices, default", "peer beyond",
]
GREEDY, DEFAULT, TWO = "terrane greedy, 1 thread", "terrane, 1 thread", "terrane, 2 threads"


def markdown(results):
    """The whole race: a summary, then a heading and a table for each job."""
    lines = [f"{key}: {results[key]}  " for key in ("date", "machine", "commit", "command")]
    lines.append(f"Medians of {results['rounds']} interleaved rounds; peaks are the largest.")
    lines += [f"Skipped, not there: {name}." for name in results["skipped"]]
    job = lambda row: (row["grid"], row["share"])
    jobs = [list(rows) for _, rows in groupby(results["rows"], key=job)]
    if {GREEDY, DEFAULT, TWO} <= {row["contestant"] for row in results["rows"]}:
        lines += ["", *summary(jobs)]
    for rows in jobs:
        lines += ["", *table(rows)]
    return "\n".join(lines)


def summary(jobs):
    """One line for each job that terrane ran in full: CPU ratios and vertices."""
    yield f"Times faster than {PEER} (CPU), two threads against one (wall), vertices against {PEER}:"
    yield ""
    yield f"| {' | '.join(SUMMARY)} |"
    yield f"|---|{'---:|' * (len(SUMMARY) - 1)}"
    for rows in jobs:
        by_name = {row["contestant"]: row for row in rows}
        if {GREEDY, DEFAULT, TWO} <= by_name.keys():
            yield f"| {' | '.join(summary_cells(by_name))} |"


def summary_cells(by_name):
    peer, greedy, default, two = (by_name[name] for name in (PEER, GREEDY, DEFAULT, TWO))
    ratio = lambda row, key: f"{peer['cpu'] / row[key]:.1f}"
    return [
        peer["grid"],
        f"{peer['tolerance']:g}",
        f"{100 * peer['vertices'] / peer['samples']:.2g} %",
        *(ratio(row, key) for key in ("cpu", "kernels") for row in (greedy, default)),
        f"{default['wall'] / two['wall']:.2f}",
        *(more(row, peer) for row in (greedy, default)),
        f"{peer['beyond']:,}",
    ]


def more(row, peer):
    return f"{100 * (row['vertices'] / peer['vertices'] - 1):+.1f} %"


def table(rows):
    peer = next(row for row in rows if row["contestant"] == PEER)
    kept = 100 * peer["vertices"] / peer["samples"]
    size = f"{peer['samples'] / 1e6:.2f} M samples"
    yield f"### {peer['grid']} at {peer['tolerance']:g} ({size}, {PEER} keeps {kept:.2g} %)"
    yield ""
    yield f"| {' | '.join(COLUMNS)} |"
    yield f"|---|{'---:|' * (len(COLUMNS) - 1)}"
    for row in rows:
        yield f"| {' | '.join(cells(row, peer))} |"


def cells(row, peer):
    return [
        row["contestant"],
        f"{row['wall']:.3f}",
        f"{row['cpu']:.3f}",
        "" if row["kernels"] is None else f"{row['kernels']:.3f}",
        f"{1e9 * row['cpu'] / row['samples']:.1f}",
        f"{row['peak_mib']:.0f}",
        f"{row['vertices']:,}",
        f"{row['triangles']:,}",
        error(row),
        f"{row['beyond']:,}",
        "" if row is peer else faster(row, peer),
        "" if row is peer else more(row, peer),
    ]


def error(row):
    """The true error, bold when beyond the tolerance, with holes and overlaps named."""
    text = f"{row['max_error']:.7g}"
    text = f"**{text}**" if row["beyond"] else text
    holes = f", {row['uncovered']:,} samples uncovered" if row["uncovered"] else ""
    return text + holes + ("" if row["area_matches"] else ", area differs")


def faster(row, peer):
    ratios = [peer["wall"] / row["wall"], peer["cpu"] / row["cpu"]]
    if row["kernels"] is not None:
        ratios.append(peer["cpu"] / row["kernels"])
    return " / ".join(f"{ratio:.1f}" for ratio in ratios)


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as results_file:
        print(markdown(json.load(results_file)))
