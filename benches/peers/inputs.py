"""The inputs of `../race.py`, all synthetic: files, made when they are needed, and numbers that follow the scale."""

import sys
from collections import ChainMap

import calls
import measure
from calls import CELL, NORTH, WEST

TILES = "--co TILED=YES --co BLOCKXSIZE=512 --co BLOCKYSIZE=512"
# File name and recipe of each input. Other names in braces are numbers, see `Inputs`.
FILES = {
    "small": ("small.tif", "synth rough,size=65,seed=7 {made}"),
    "rough": ("rough.tif", "synth rough,size={half},seed=7 {made}"),
    "raw": ("rough.flt", "convert {rough} {made}"),
    "store": ("store.tif", "synth rough,size={side},seed=7 {made}"),
    "plain": ("plain.tif", "convert {store} {made} -f GTiff"),
    "cog": ("cog.tif", "convert {store} {made} -f COG --co PREDICTOR=3"),
    "deflate_strips": ("deflate_strips.tif", "convert {store} {made} --co COMPRESS=DEFLATE"),
    "lzw_tiles": ("lzw_tiles.tif", f"convert {{store}} {{made}} --co COMPRESS=LZW {TILES}"),
    "lzw_strips": ("lzw_strips.tif", "convert {store} {made} --co COMPRESS=LZW"),
    "zstd_tiles": ("zstd_tiles.tif", f"convert {{store}} {{made}} --co COMPRESS=ZSTD {TILES}"),
    "zstd_strips": ("zstd_strips.tif", "convert {store} {made} --co COMPRESS=ZSTD"),
    "lerc_tiles": ("lerc_tiles.tif", "lerc {store} {made} yes"),
    "lerc_strips": ("lerc_strips.tif", "lerc {store} {made} no"),
    "nw": ("part1.tif", "convert {store} {made} -f COG --bounds {x0},{y1},{x1},{y2}"),
    "ne": ("part2.tif", "convert {store} {made} -f COG --bounds {x1},{y1},{x2},{y2}"),
    "sw": ("part3.tif", "convert {store} {made} -f COG --bounds {x0},{y0},{x1},{y1}"),
    "se": ("part4.tif", "convert {store} {made} -f COG --bounds {x1},{y0},{x2},{y1}"),
    "vrt": ("parts.vrt", "gdalbuildvrt -q {made} {nw} {ne} {sw} {se}"),
    "colours": ("colours.txt", "colours {made}"),
    "zones": ("zones.geojson", "zones {made} {side}"),
    "laz": ("cloud.laz", "synth cloud,size={metres},density=8,seed=7 {made}"),
    "las": ("cloud.las", "synth cloud,size={metres},density=8,seed=7 {made}"),
    "small_las": ("small.las", "synth cloud,size={few_metres},density=8,seed=7 {made}"),
    "koch": ("koch.fgb", "synth koch,vertices={vertices} {made}"),
    "coverage": ("coverage.geojson", "synth coverage,vertices={border},features=400 {made}"),
}


def note(text):
    print(text, file=sys.stderr, flush=True)


class Inputs(dict):
    """Paths and numbers for the names in braces. A file is made when its name is first used."""

    def __init__(self, terrane, folder, scale):
        side = round(8192 * scale) + 1
        middle, end = WEST + CELL * (side // 2), WEST + CELL * side
        super().__init__(side=side, half=round(4096 * scale) + 1, x0=WEST, x1=middle, x2=end, y2=NORTH,
                         y1=NORTH - (middle - WEST), y0=NORTH - (end - WEST), metres=round(2280 * scale),
                         few_metres=round(270 * scale), vertices=round(1e6 * scale), border=round(10_000 * scale))
        self.terrane, self.folder, self.out = terrane, folder / f"scale-{scale:g}", folder / "out"
        self.folder.mkdir(parents=True, exist_ok=True)

    def __missing__(self, name):
        file, recipe = FILES[name]
        path, fresh = self.folder / file, self.folder / f"new-{file}"
        if not path.exists():
            argv = self.argv(recipe, made=str(fresh))
            note(f"making {file}")
            measure.run(argv)
            fresh.replace(path)
        return self.setdefault(name, str(path))

    def argv(self, command, **more):
        """The words of a command of terrane or of a peer; raises `Missing`."""
        names = ChainMap({"out": str(self.out), **more}, self)
        words = [word.format_map(names) for word in command.split()]
        return calls.argv_of(words) or [self.terrane, *words]

    def millions(self, unit):
        if unit == "samples":
            return self["side"] ** 2 / 1e6
        with open(self["laz"], "rb") as file:
            return int.from_bytes(file.read(255)[247:], "little") / 1e6
