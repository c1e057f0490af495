"""The grids of the race, and how they come to be. Standard library only."""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import measure

SYNTHETIC = {
    "rough": "rough,size=4097,seed=7",
    "smooth": "smooth,size=4097,seed=7",
    "integer": "integer,size=4097,seed=7",
}
REAL = {
    "N48W125": "dem/N48W125.hgt.zip",
    "bigtujunga": "dem/srtm_bigtujunga30m_utm11.tif",
    "N42E001": "dem/N42E001.hgt.zip",
    "no_kv": "dem/proj_no_kv_CD_above_Ell.tif",
}
NAMES = [*SYNTHETIC, *REAL]


@dataclass(frozen=True)
class Grid:
    """One job: a GeoTIFF for terrane, the same heights as raw f32 for the peers."""

    name: str
    tif: Path
    raw: Path
    meta: Path
    width: int
    height: int
    voids_filled: int

    @property
    def samples(self):
        return self.width * self.height


def data_folder(root):
    """Where the real files are, or would be."""
    return Path(os.environ.get("TERRANE_DATA", root.parent / "shared" / "data"))


def prepare(name, tools):
    """The grid called `name`, made when it is not there; `None` when its source is absent."""
    folder = tools.work / "grids"
    folder.mkdir(parents=True, exist_ok=True)
    tif, raw, meta = (folder / f"{name}.{ending}" for ending in ("tif", "raw", "json"))
    source = tif if name in SYNTHETIC else data_folder(tools.root) / REAL[name]
    if name in REAL and not source.is_file():
        return None
    if not meta.is_file():
        if name in SYNTHETIC:
            measure.run([tools.terrane, "synth", SYNTHETIC[name], tif, "--overwrite", "--quiet"])
        measure.run([tools.python, tools.here / "prepare.py", source, tif, raw, meta])
    facts = json.loads(meta.read_text(encoding="utf-8"))
    size = facts["width"], facts["height"]
    return Grid(name, tif, raw, meta, *size, facts["voids_filled"])
