#!/usr/bin/env python3
"""Writes crates/crs/src/shifts.tsv: shifts of datums to WGS 84, from the EPSG dataset that comes with PROJ.

    python3 tools/make_shifts.py > crates/crs/src/shifts.tsv

One line for each operation that is not given up or replaced, is said to be right to 50 m, and moves,
turns and scales as one (three or seven parameters): EPSG codes of the datum and of the operation,
accuracy in metres, west, south, east and north of the area it is made for, x, y, z in metres, rotations
in arc-seconds (as position vectors turn), scale in parts per million, and the name. Zeros at the end are
left out. A datum that counts longitudes from another meridian than Greenwich has the operations of the
one it was made from. Needs pyproj.
"""

import os
import sqlite3

import pyproj

TARGETS = ("4326", "4979", "4978")
METHODS = {
    "9603": 1, "1031": 1, "1035": 1,  # translations
    "9606": 1, "1033": 1, "1037": 1,  # position vectors
    "9607": -1, "1032": -1, "1038": -1,  # coordinate frames
}
QUERY = """
    select s.datum_code, h.code, h.accuracy, e.west_lon, e.south_lat, e.east_lon, e.north_lat,
           h.tx, h.ty, h.tz, h.rx, h.ry, h.rz, h.scale_difference, h.method_code,
           h.translation_uom_code, h.rotation_uom_code, h.scale_difference_uom_code, h.name
    from helmert_transformation_table h
    join geodetic_crs s on s.auth_name = h.source_crs_auth_name and s.code = h.source_crs_code
    join usage u on u.object_table_name = 'helmert_transformation'
         and u.object_auth_name = h.auth_name and u.object_code = h.code
    join extent e on e.auth_name = u.extent_auth_name and e.code = u.extent_code
    where h.auth_name = 'EPSG' and h.target_crs_auth_name = 'EPSG' and not h.deprecated
          and h.target_crs_code in (?, ?, ?) and h.accuracy <= 50 and s.datum_auth_name = 'EPSG'
"""
# Operations whose place others have taken.
REPLACED = """
    select superseded_code from supersession
    where superseded_table_name = 'helmert_transformation' and superseded_auth_name = 'EPSG'
          and replacement_table_name = 'helmert_transformation' and replacement_auth_name = 'EPSG'
          and replacement_code in (select code from helmert_transformation_table
                                   where auth_name = 'EPSG' and target_crs_code in (?, ?, ?))
"""
# Datums with a meridian of their own, and those of the same survey from Greenwich on.
ALIASES = """
    select distinct a.datum_code, b.datum_code from other_transformation o
    join geodetic_crs a on a.auth_name = o.source_crs_auth_name and a.code = o.source_crs_code
    join geodetic_crs b on b.auth_name = o.target_crs_auth_name and b.code = o.target_crs_code
    where o.method_code = '9601' and o.auth_name = 'EPSG' and not o.deprecated
"""


def factor(database, code):
    """The size of a unit: metres, radians or ones."""
    found = database.execute(
        "select conv_factor from unit_of_measure where auth_name = 'EPSG' and code = ?", (code,))
    return found.fetchone()[0]


def short(value):
    return f"{value:.10g}"


def rows(database):
    aliases = {}
    for alias, base in database.execute(ALIASES):
        aliases.setdefault(str(base), []).append(str(alias))
    second = factor(database, "9104")
    replaced = {row[0] for row in database.execute(REPLACED, TARGETS)}
    for row in database.execute(QUERY, TARGETS):
        datum, code, accuracy, west, south, east, north = row[:7]
        sign = METHODS.get(str(row[14]))
        if sign is None or code in replaced:
            continue
        move = [value * factor(database, row[15]) for value in row[7:10]]
        turn = [sign * (value or 0) * factor(database, row[16]) / second for value in row[10:13]] \
            if row[16] else [0, 0, 0]
        scale = [(row[13] or 0) * factor(database, row[17]) * 1e6] if row[17] else [0]
        numbers = [short(value + 0.0) for value in [*move, *turn, *scale]]
        while numbers and float(numbers[-1]) == 0:
            numbers.pop()
        area = [short(side) for side in (west, south, east, north)]
        for own in [str(datum), *aliases.get(str(datum), [])]:
            yield (int(own), int(code), short(accuracy), " ".join(area), " ".join(numbers), row[18])


def main():
    path = os.path.join(pyproj.datadir.get_data_dir(), "proj.db")
    database = sqlite3.connect(path)
    for row in sorted(set(rows(database))):
        print("\t".join(map(str, row)))


if __name__ == "__main__":
    main()
