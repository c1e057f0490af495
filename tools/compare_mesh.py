#!/usr/bin/env python3
"""Compares the meshes that terrane writes with each other, as other programs read them.

    python3 tools/compare_mesh.py [--terrane target/debug/terrane]

Grids made here (in metres, feet of both kinds, degrees and nothing; with voids and far from 0, 0) become
meshes in every format, and a solid. PLY as meshio reads it is what the others must be: the same vertices,
as exactly as the format says that it holds them, and the same triangles, counter-clockwise as seen from
above. DXF is read with ezdxf, 3MF with lib3mf in its strict mode, LandXML with lxml and held to the words
and the order of LandXML 1.2, compressed GLB with meshoptimizer's own decoder, and the rest with trimesh and
meshio. Units and reference systems must be those of the grid. Prints a line for each grid and format and
exits with 1 when anything differs. Needs ezdxf, lib3mf, lxml, meshio, meshoptimizer, numpy and trimesh.
"""

import argparse
import json
import math
import os
import re
import struct
import subprocess
import sys
import tempfile

import ezdxf
import lib3mf
import meshio
import meshoptimizer
import numpy as np
import trimesh
from lxml import etree

VOID = -9999
# Most of what formats do block by block is seen in large ones alone.
SMALL, LARGE = (24, 19), (190, 150)
# Columns and rows, first column and row, size of a cell, reference system, its number, metres in x and z (None: as no format
# has one unit for both).
GRIDS = {
    "utm": (SMALL, 500005.25, 4750003.5, 10, "EPSG:32632", "32632", 1.0),
    "utm_large": (LARGE, -8500005.25, 19750003.5, 30, "EPSG:32632", "32632", 1.0),
    "us_feet": (SMALL, 980000.125, 200000.25, 10, "EPSG:2263+6360", "2263", 1200 / 3937),
    "feet": (SMALL, 980000.125, 200000.25, 10, "EPSG:2223", "2223", 0.3048),
    "metres_and_feet": (SMALL, 500005.25, 4750003.5, 10, "EPSG:32612+6360", "32612", None),
    "nowhere": (SMALL, 0, 0, 1, None, None, 1.0),
    "degrees": (SMALL, 7.03, 46.02, 0.01, "EPSG:4326", "4326", None),
}
OWN_3MF = "urn:terrane:mesh"
LANDXML = "http://www.landxml.org/schema/LandXML-1.2"
# Of the simple types of the schema, those for the units that have to be there.
UNITS_OF = {
    "Metric": {
        "areaUnit": {"hectare", "squareMeter", "squareMillimeter", "squareCentimeter"},
        "linearUnit": {"millimeter", "centimeter", "meter", "kilometer"},
        "volumeUnit": {"cubicMeter", "liter", "hectareMeter"},
        "temperatureUnit": {"celsius", "kelvin"},
        "pressureUnit": {"HPA", "milliBars", "mmHG", "millimeterHG"},
    },
    "Imperial": {
        "areaUnit": {"acre", "squareFoot", "squareInch", "squareMiles"},
        "linearUnit": {"foot", "USSurveyFoot", "inch", "mile"},
        "volumeUnit": {"US_gallon", "IMP_gallon", "cubicInch", "cubicFeet", "cubicYard", "acreFeet"},
        "temperatureUnit": {"fahrenheit", "kelvin"},
        "pressureUnit": {"inchHG", "inHG"},
    },
}
LANDXML_METRES = {"meter": 1.0, "foot": 0.3048, "USSurveyFoot": 1200 / 3937}
DXF_METRES = {0: None, 2: 0.3048, 6: 1.0, 21: 1200 / 3937}


class Wrong(Exception):
    """What is wrong with a file."""


def expect(is_so, what):
    if not is_so:
        raise Wrong(what)


class Mesh:
    """Vertices in the coordinates of the grid, triangles, and how exact the vertices are along each axis."""

    def __init__(self, points, faces, exact=0.0):
        self.points, self.faces, self.exact = np.asarray(points, float), np.asarray(faces), exact

    @classmethod
    def single(cls, stored, faces, origin, scale=(1, 1, 1)):
        """One of f32 that are relative to an origin: half a unit in the last place, and what f64 rounds."""
        stored, origin, scale = (np.asarray(a, float) for a in (stored, origin, scale))
        expect((stored == stored.astype(np.float32)).all(), "positions are no f32")
        points = origin + stored / scale
        return cls(points, faces, (np.abs(stored) * 2.0**-24 + 1e-30) / scale + np.abs(points) * 2.0**-51)


def make(folder):
    """The grids, with a hole and a notch."""
    for name, ((columns, rows), x, y, cell, crs, *_) in GRIDS.items():
        path = os.path.join(folder, f"{name}.asc")

        def height(row, column):
            if 4 <= row < 7 and 9 <= column < 14 or row < 3 and column < 2:
                return str(VOID)
            wave = 40 * math.sin(column / 3) + 30 * math.cos(row / 4)
            return f"{150 + wave + (column * 7 + row * 3) % 5 * 0.37:.3f}"

        with open(path, "w") as file:
            head = f"ncols {columns}\nnrows {rows}\nxllcenter {x}\nyllcenter {y}\ncellsize {cell}\n"
            file.write(f"{head}NODATA_value {VOID}\n")
            for row in range(rows):
                file.write(" ".join(height(row, column) for column in range(columns)) + "\n")
        if crs:
            with open(path.replace(".asc", ".prj"), "w") as file:
                file.write(crs)
        yield name, path


def joined(corners):
    """Vertices and triangles of triangles that share none."""
    points, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return points, faces.reshape(-1, 3)


def by_meshio(path, _):
    read = meshio.read(path)
    expect(list(read.cells_dict) == ["triangle"], f"has cells of the kinds {list(read.cells_dict)}")
    expect(read.points.dtype == np.float64, f"has vertices of the type {read.points.dtype}")
    return Mesh(read.points, read.cells_dict["triangle"])


def ply(path, _):
    read = trimesh.load(path, process=False)
    return Mesh(read.vertices, read.faces)


def stl(path, _):
    with open(path, "rb") as file:
        words = file.read(80).decode("ascii").split()
    expect(words[:2] == ["terrane", "origin"], f"has the head {words}")
    origin = [float(word) for word in words[2:5]]
    scale = [float(word) for word in words[6:9]] if words[5] == "scale" else [1, 1, 1]
    read = trimesh.load(path, process=False)
    corners = np.array(read.triangles)
    edges = corners[:, 1:] - corners[:, :1]
    is_along = np.einsum("ij,ij->i", read.face_normals, np.cross(edges[:, 0], edges[:, 1])) > 0
    expect(is_along.all(), "has normals that point elsewhere")
    return Mesh.single(*joined(corners), origin, scale)


def chunks(path):
    """What a GLB says, and its bytes."""
    with open(path, "rb") as file:
        data = file.read()
    magic, version, length = struct.unpack_from("<4sII", data)
    expect((magic, version, length) == (b"glTF", 2, len(data)), "has another head")
    size, kind = struct.unpack_from("<I4s", data, 12)
    expect(kind == b"JSON", "does not begin with JSON")
    return json.loads(data[20 : 20 + size]), data[20 + size + 8 :]


def of_glb(path, number, stored, faces):
    told = chunks(path)[0]["asset"]["extras"]
    expect(number is None or f":{number}" in told["crs"], f"is in {told.get('crs')}")
    turned = np.asarray(stored, float)[:, [0, 2, 1]] * [1, -1, 1]
    return Mesh.single(turned, faces, told["origin"], told.get("scale", [1, 1, 1]))


def glb(path, number):
    read = trimesh.load(path, process=False).to_mesh()
    return of_glb(path, number, read.vertices, read.faces)


def meshopt(path, number):
    told, body = chunks(path)
    expect("EXT_meshopt_compression" in told["extensionsRequired"], "does not require what it needs")

    def unpacked(accessor):
        accessor = told["accessors"][accessor]
        view = told["bufferViews"][accessor["bufferView"]]
        packed = view["extensions"]["EXT_meshopt_compression"]
        at, size, stride, count = (packed[k] for k in ("byteOffset", "byteLength", "byteStride", "count"))
        expect(view["byteLength"] == stride * count, "has a view of another length")
        source = body[at : at + size]
        if packed["mode"] == "ATTRIBUTES":
            rows = meshoptimizer.decode_vertex_buffer(count, stride, source)
            low, high = rows.min(axis=0), rows.max(axis=0)
            expect((low == np.float32(accessor["min"])).all(), "says another least position")
            expect((high == np.float32(accessor["max"])).all(), "says another greatest position")
            return rows
        expect(packed["mode"] == "TRIANGLES", f"has the mode {packed['mode']}")
        return meshoptimizer.decode_index_buffer(count, stride, source).reshape(-1, 3)

    part = told["meshes"][0]["primitives"][0]
    return of_glb(path, number, unpacked(part["attributes"]["POSITION"]), unpacked(part["indices"]))


def dxf(path, number):
    document = ezdxf.readfile(path)
    faults = document.audit()
    expect(not faults.errors and not faults.fixes, f"has the faults {faults.errors + faults.fixes}")
    faces = list(document.modelspace().query("3DFACE"))
    expect(len(faces) == len(document.modelspace()), "holds other things, too")
    corners = np.array([[tuple(face.dxf.get(f"vtx{k}")) for k in range(4)] for face in faces])
    expect((corners[:, 3] == corners[:, 2]).all(), "has faces of four corners")
    metres = DXF_METRES[document.header["$INSUNITS"]]
    given = next(own[-1] for own in GRIDS.values() if own[5] == number)
    expect(number is None or metres == given, f"has a unit of {metres} metres")
    return Mesh(*joined(corners[:, :3]))


def landxml(path, number):
    # What is not understood, such as an entity, is an error.
    root = etree.parse(path, etree.XMLParser(resolve_entities=False)).getroot()
    name = f"{{{LANDXML}}}"
    expect(root.tag == f"{name}LandXML" and root.get("version") == "1.2", f"is {root.tag}")
    expect(re.fullmatch(r"\d{4}-\d\d-\d\d", root.get("date", "")), "has no date")
    expect(re.fullmatch(r"\d\d:\d\d:\d\d", root.get("time", "")), "has no time")
    below = [child.tag.removeprefix(name) for child in root]
    known = ["Units", "CoordinateSystem", "Project", "Application", "Surfaces"]
    expect(below == [own for own in known if own != "CoordinateSystem" or number], f"has {below}")
    (unit,) = root.find(f"{name}Units")
    for key, values in UNITS_OF[unit.tag.removeprefix(name)].items():
        expect(unit.get(key) in values, f"has the {key} {unit.get(key)}")
    given = next(own[-1] for own in GRIDS.values() if own[5] == number)
    expect(LANDXML_METRES[unit.get("linearUnit")] == given, f"is in {unit.get('linearUnit')}")
    system = root.find(f"{name}CoordinateSystem")
    expect(number is None or number in system.get("desc"), "has another system")
    expect(root.find(f"{name}Project").get("name") and root.find(f"{name}Application").get("name"), "no names")
    (surface,) = root.find(f"{name}Surfaces")
    expect(surface.get("name"), "has a surface without a name")
    (definition,) = surface
    expect(definition.get("surfType") == "TIN", "is no TIN")
    points, faces = definition
    expect([points.tag, faces.tag] == [f"{name}Pnts", f"{name}Faces"], "has other parts")
    places = {point.get("id"): place for place, point in enumerate(points)}
    expect(len(places) == len(points), "has two points of one id")
    # Northing, easting, elevation.
    points = [[float(word) for word in point.text.split()] for point in points]
    points = np.array(points)[:, [1, 0, 2]]
    return Mesh(points, [[places[id] for id in face.text.split()] for face in faces])


def threemf_of(path):
    """The object, where it was, and how large."""
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(path)
    expect(reader.GetWarningCount() == 0, f"{reader.GetWarningCount()} warnings")
    expect(model.GetBuildItems().Count() == 1, "has no object to build, or several")
    objects = model.GetMeshObjects()
    expect(objects.Count() == 1 and objects.MoveNext(), "has no mesh, or several")
    expect(model.GetUnit() == lib3mf.ModelUnit.Meter, f"is in {model.GetUnit()}")
    records = model.GetMetaDataGroup()
    records = [records.GetMetaData(at) for at in range(records.GetMetaDataCount())]
    own = {own.GetName(): own.GetValue() for own in records if own.GetNameSpace() == OWN_3MF}
    numbers = [[float(word) for word in own.get(key, "1 1 1").split()] for key in ("origin", "scale")]
    # Kept alive as long as the mesh is asked for.
    return model, objects.GetCurrentMeshObject(), numbers, own


def threemf(path, number):
    _model, mesh, (origin, scale), own = threemf_of(path)
    expect(number is None or any(f":{number}" in text for text in own.values()), "has another system")
    points = [list(at.Coordinates) for at in mesh.GetVertices()]
    return Mesh.single(points, [list(face.Indices) for face in mesh.GetTriangleIndices()], origin, scale)


def solid(path, number):
    """The triangles of a solid that are on top of it."""
    _model, mesh, _, _ = threemf_of(path)
    expect(mesh.IsManifoldAndOriented(), "is not closed")
    whole = threemf(path, number)
    body = trimesh.Trimesh(whole.points, whole.faces, process=False)
    expect(body.is_watertight and body.volume > 0, "has no inside")
    corners = whole.points[whole.faces]
    edges = corners[:, 1:, :2] - corners[:, :1, :2]
    is_up = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0] > 1e-6
    used, faces = np.unique(whole.faces[is_up], return_inverse=True)
    return Mesh(whole.points[used], faces.reshape(-1, 3), whole.exact[used])


# How each is made and read. What has two rows has two readers.
FORMATS = [
    ("OBJ", "obj", [], by_meshio),
    ("PLY", "ply", [], ply),
    ("STL", "stl", [], stl),
    ("GLB", "glb", [], glb),
    ("GLB-meshopt", "meshopt.glb", [], meshopt),
    ("DXF", "dxf", [], dxf),
    ("LandXML", "xml", [], landxml),
    ("3MF", "3mf", [], threemf),
    ("3MF, a solid", "solid.3mf", ["--co", "SOLID_BASE=20"], solid),
]


def by_sample(mesh, grid):
    """Vertices by the sample that they are at, and triangles of these, which begin with the least of them."""
    _, x, y, cell, *_ = GRIDS[grid]
    at = np.rint((mesh.points[:, :2] - [x, y]) / cell).astype(int)
    number = at[:, 0] * 10_000 + at[:, 1]
    expect(len(set(number)) == len(number), "has two vertices at one place")
    faces = number[mesh.faces]
    first = faces.argmin(axis=1)
    rows = np.arange(len(faces))
    faces = np.stack([faces[rows, (first + k) % 3] for k in range(3)], axis=1)
    return number, sorted(map(tuple, faces.tolist()))


def compare(want, got, grid):
    """Says what differs."""
    numbers, faces = by_sample(want, grid)
    own_numbers, own_faces = by_sample(got, grid)
    expect(sorted(numbers) == sorted(own_numbers), "has other vertices")
    place = {number: place for place, number in enumerate(numbers)}
    order = [place[number] for number in own_numbers]
    off = np.abs(got.points - want.points[order])
    expect((off <= got.exact).all(), f"has vertices that are off by {off.max()}")
    expect(faces == own_faces, "has other triangles, or turned ones")


def one(terrane, source, grid, row, want, folder):
    """What is wrong with one format; None where it cannot hold the mesh."""
    _, ending, options, read = row
    output = os.path.join(folder, f"{grid}.{ending}")
    command = [terrane, "tin", source, output, "--max-error", "2", "--overwrite", "-q", *options]
    ran = subprocess.run(command, capture_output=True, text=True)
    if ran.returncode != 0 and "LandXML requires one length unit" in ran.stderr and GRIDS[grid][6] is None:
        return None
    if ran.returncode != 0:
        return ran.stderr.strip()
    try:
        compare(want, read(output, GRIDS[grid][5]), grid)
    except Wrong as wrong:
        return str(wrong)
    except Exception as error:  # Whatever they raise is what a user would see.
        return f"does not open: {error!r}"
    return ""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--terrane", default="target/debug/terrane")
    terrane = parser.parse_args().terrane
    failed = looked_at = 0
    with tempfile.TemporaryDirectory() as inputs, tempfile.TemporaryDirectory() as folder:
        for grid, source in make(inputs):
            output = os.path.join(folder, f"{grid}.ply")
            command = [terrane, "tin", source, output, "--max-error", "2", "-q"]
            subprocess.run(command, check=True)
            want = by_meshio(output, None)
            for row in FORMATS:
                what = one(terrane, source, grid, row, want, folder)
                looked_at += what is not None
                failed += bool(what)
                told = {None: "cannot hold it", "": "same"}.get(what, what)
                print(f"{grid:16} {row[0]:14} {told}")
    print(f"{failed} of {looked_at} differ")
    return 1 if failed or not looked_at else 0


if __name__ == "__main__":
    sys.exit(main())
