"""Tiles that `terrane view --serve` sends, as a browser shows them: where it looks from decides what is loaded, what
is drawn has no hole and is as near to the grid as the page says, and nothing is asked of anybody else.
"""

import json
import subprocess

import numpy as np
import pytest
from geographiclib.geodesic import Geodesic
from conftest import SKY, TERRANE, terrane

SIDE, CELL, WEST, SOUTH = 257, 1 / 3600, 7.4, 46.1
FORMATS = ["quantized-mesh", "3dtiles"]
# A page that is left alone for some frames has asked for all that it lacks.
CALM = 4


@pytest.fixture(scope="session")
def grid(place):
    """Heights by row from the south, and the tiles of both formats."""
    terrane("synth", f"rough,size={SIDE},seed=5", place / "rough.tif")
    terrane("convert", place / "rough.tif", place / "rough.asc")
    lines = (place / "rough.asc").read_text().splitlines()
    heights = np.loadtxt([line for line in lines if not line[0].isalpha()])
    head = f"ncols {SIDE}\nnrows {SIDE}\nxllcenter {WEST}\nyllcenter {SOUTH}\ncellsize {CELL}\n"
    with open(place / "globe.asc", "w") as out:
        out.write(head)
        np.savetxt(out, heights, "%.3f")
    (place / "globe.prj").write_text("EPSG:4326")
    for name in FORMATS:
        terrane("tiles", place / "globe.asc", place / name, "--format", name)
    return np.round(heights[::-1], 3)


class Served:
    """A server of a folder, while it lasts."""

    def __init__(self, folder):
        self.process = subprocess.Popen([TERRANE, "view", folder, "--serve", "--json"], stdout=subprocess.PIPE, text=True)
        told = ""
        while not told.endswith("\n}\n"):
            told += self.process.stdout.readline()
        self.told = json.loads(told)

    def stop(self):
        self.process.terminate()
        assert self.process.wait(20) == 0


@pytest.fixture(scope="session")
def servers(grid, place):
    all_ = {name: Served(place / name) for name in FORMATS}
    yield all_
    for server in all_.values():
        server.stop()


@pytest.fixture
def served(servers):
    return servers["quantized-mesh"]


@pytest.fixture(params=FORMATS)
def either(servers, request):
    return servers[request.param]


def calm(page):
    """Waits until nothing is missing."""
    seen = 0
    while seen < CALM:
        page.wait(lambda: page("() => terrane.isIdle()"))
        page.page.wait_for_timeout(50)
        seen = seen + 1 if page("() => terrane.isIdle()") else 0
    return page("() => terrane.figures()")


def show(opened, served, **how):
    page = opened(served.told["url"], **{"width": 760, "height": 480, **how})
    page.figures = calm(page)
    return page


def look(page, grid, column, row, distance):
    """Looks at a sample of the grid."""
    where = [WEST + CELL * int(column), SOUTH + CELL * int(row), distance, float(grid[row, column])]
    page("(where) => terrane.look(...where)", where)
    return where[:2]


def slide(page, pixels):
    page("(value) => { const s = document.getElementById('allowed'); s.value = value; s.dispatchEvent(new Event('input')); }", float(np.log2(pixels)))
    return calm(page)


def test_the_error_on_the_screen_decides_what_is_loaded(either, opened):
    page = show(opened, either)
    first = page.figures
    assert first["failures"] == 0 and 0 < first["pixels"] <= page("() => terrane.shown.allowed") == 2
    assert first["loaded"] < either.told["tiles"], "not all of them"
    coarse = slide(page, 16)
    assert coarse["drawn"] < first["drawn"] and coarse["pixels"] <= 16.01
    fine = slide(page, 0.7)
    assert fine["drawn"] > first["drawn"] and fine["levels"][1] > coarse["levels"][1]
    assert fine["pixels"] <= 0.71 or fine["levels"][1] == either.told["levels"] - 1
    # Nearer: finer tiles, until there are none.
    slide(page, 2)
    for _ in range(12):
        page.page.mouse.move(516, 260)
        page.page.mouse.wheel(0, -500)
        page.page.wait_for_timeout(30)
    near = calm(page)
    assert near["levels"][1] == either.told["levels"] - 1 and near["received"] > first["received"]
    told = dict(row.split("\t") for row in page.page.inner_text("#figures").splitlines())
    assert told["Tiles drawn"] == f"{near['drawn']:,}" and told["Tiles loading"] == "0"


def test_the_terrain_is_drawn_in_every_way(served, opened):
    page = show(opened, served)
    pictures = {}
    for name, keys in {"height": "1", "slope": "2", "level": "3", "error": "4", "relief": "5", "edges": "1e", "plain": "e", "facets": "g", "borders": "gb", "high": "b++++"}.items():
        for key in keys:
            page.page.keyboard.press(key)
        calm(page)
        pictures[name] = page.picture()
    first = pictures["height"]
    assert len(np.unique(first[130:400, 300:740].reshape(-1, 3), axis=0)) > 500, "in many colours"
    assert (first.max(axis=2) - first.min(axis=2))[210:290, 470:560].mean() > 25, "the data are in the middle"
    assert (pictures["plain"] == first).all(), "edges go again"
    for name in ["slope", "level", "error", "relief", "edges", "facets", "borders", "high"]:
        assert (pictures[name] != first).any(axis=2).mean() > 0.01, name
    page("() => terrane.look(7.4, 46.1, 3e7)")
    calm(page)
    far = page.picture()
    is_sky = np.abs(far - SKY).sum(axis=2) < 12
    assert 0.2 < is_sky.mean() < 0.95 and not is_sky[230:250, 506:526].any(), "the globe before the sky"


def test_heights_are_those_of_the_grid_but_for_the_error_told(either, opened, grid):
    page = show(opened, either)
    random = np.random.default_rng(1)
    largest = 0
    for distance in [20000, 3000, 400]:
        column, row = random.integers(20, SIDE - 20, 2)
        look(page, grid, column, row, distance)
        calm(page)
        reach = int(min(15, distance / 100)) or 1
        for c, r in random.integers(-reach, reach + 1, (40, 2)) + [column, row]:
            found = page("([lon, lat]) => terrane.at(lon, lat)", [WEST + CELL * int(c), SOUTH + CELL * int(r)])
            off = abs(found["height"] - grid[r, c])
            # 32-bit floats of places up to some kilometres from the middle of a tile.
            assert off <= found["error"] + 2e-3, (found, off)
            largest = max(largest, off / found["error"])
    assert largest > 0.3, "errors are not told far too large"


def test_the_place_under_the_cursor_is_where_it_is_seen(served, opened):
    page = show(opened, served)
    for _ in range(2):
        for px, py in [(516, 250), (420, 290), (580, 220)]:
            page.page.mouse.move(px, py)
            page.page.wait_for_timeout(200)
            found = page("([px, py]) => terrane.under(px, py)", [px, py])
            told = dict(line.rsplit(" ", 1) for line in page("() => [...document.querySelectorAll('#status span')].slice(0, 2).map((e) => e.textContent)"))
            assert abs(float(told["Lon"][:-1]) - found["lon"]) < 2e-6 and abs(float(told["Lat"][:-1]) - found["lat"]) < 2e-6
            back = page("(p) => terrane.toView([p.lon, p.lat, p.height])", found)
            assert np.hypot(back[0] - px, back[1] - py) < 0.05, "it is seen where it was found"
        # Again from near by.
        page("() => { const at = terrane.under(516, 250); terrane.look(at.lon, at.lat, 60, at.height); }")
        calm(page)


def holders(drawn, lon, lat):
    """How many of the tiles that are drawn have a place."""
    found = 0
    for tile in drawn:
        width = 180 / 2 ** tile["level"]
        x, y = (lon + 180) / width - tile["x"], (lat + 90) / width - tile["y"]
        if 0 <= x < 1 and 0 <= y < 1:
            found += tile["quarters"] >> (int(x >= 0.5) + 2 * int(y >= 0.5)) & 1
    return found


def test_there_is_no_hole_at_any_moment(either, opened, grid):
    page = show(opened, either)
    # From now on tiles take their time.
    page("""() => { const before = window.fetch; const now = window.asked = { most: 0, under: 0, ended: 0, delay: 150 };
        window.fetch = async (...args) => { now.most = Math.max(now.most, ++now.under);
          try { await new Promise((ready) => setTimeout(ready, now.delay)); return await before(...args); }
          catch (error) { now.ended++; throw error; } finally { now.under--; } }; }""")
    random = np.random.default_rng(2)
    moments = 0
    for distance in [6000, 900]:
        before = page("() => terrane.stream().turn")
        lon, lat = look(page, grid, *random.integers(100, 150, 2), distance)
        page.wait(lambda: page("() => terrane.stream().turn") > before)
        for _ in range(200):
            drawn, found = page("""([lon, lat]) => [terrane.drawn(), [-2, -1, 0, 1, 2].map((k) => terrane.at(lon + k * 3e-4, lat + k * 2e-4) !== null)]""", [lon, lat])
            assert all(found)
            assert [holders(drawn, lon + k * 3e-4, lat + k * 2e-4) for k in [-2, -1, 0, 1, 2]] == [1] * 5
            moments += 1
            page.page.wait_for_timeout(10)
            if page("() => terrane.isIdle()"):
                break
    assert moments > 5
    calm(page)
    # Moving on before all is there ends requests.
    page("() => { asked.delay = 4000; }")
    look(page, grid, 30, 200, 150)
    page.wait(lambda: page("() => asked.under") > 0)
    page("() => terrane.look(7.4, 46.1, 3e7)")
    calm(page)
    asked = page("() => window.asked")
    assert asked["most"] <= 6 and asked["ended"] > 0 and asked["under"] == 0, asked
    assert page("() => terrane.figures().failures") == 0


def test_memory_has_an_end(served, opened):
    page = show(opened, served)
    full = slide(page, 0.5)
    # Both tiles at the top stay.
    most = 480_000
    assert full["bytes"] > 1.3 * most
    page("(most) => { terrane.stream().most = most; terrane.refresh(); }", most)
    little = calm(page)
    assert little["bytes"] <= most and little["strain"] > 1 and little["drawn"] < full["drawn"]
    assert "do not fit" in page.page.inner_text("#notes")
    page("() => { terrane.stream().most = 1 << 28; terrane.refresh(); }")
    again = calm(page)
    assert again["drawn"] == full["drawn"] and again["strain"] == 1


def test_the_camera_turns_moves_and_flies_around_the_globe(served, opened):
    page = show(opened, served)
    state = lambda: page("() => { const c = terrane.camera(); return [c.yaw, c.pitch, c.distance, c.frame.lon, c.frame.lat, c.target[2]]; }")
    before = state()
    page.page.mouse.move(516, 260)
    page.page.mouse.down()
    page.page.mouse.move(576, 275, steps=4)
    page.page.mouse.up()
    turned = state()
    assert turned[0] > before[0] and turned[1] < before[1] and turned[3:5] == before[3:5]
    page.page.keyboard.down("Shift")
    page.page.mouse.down()
    page.page.mouse.move(526, 260, steps=4)
    page.page.mouse.up()
    page.page.keyboard.up("Shift")
    moved = state()
    assert moved[3] > turned[3] and moved[2] == turned[2]
    page.page.keyboard.down("w")
    page.wait(lambda: state()[4] > moved[4])
    page.page.keyboard.up("w")
    page.page.keyboard.press("r")
    calm(page)
    assert np.allclose(state(), before, atol=0.5)
    # Around the globe: east over 180 degrees, up to the pole, and still on the ground.
    for lon, lat, key in [(179.9, 0, "d"), (10, 89, "w")]:
        page("([lon, lat]) => terrane.look(lon, lat, 2e6)", [lon, lat])
        page.page.keyboard.press("n")
        page.page.keyboard.down(key)
        page.page.wait_for_timeout(1500)
        page.page.keyboard.up(key)
        calm(page)
        now = state()
        assert np.isfinite(now).all() and abs(now[3]) <= 180 and abs(now[4]) <= 90
        assert page("() => terrane.drawn !== null") and len(np.unique(page.picture().reshape(-1, 3), axis=0)) > 20
    page.page.keyboard.press("?")
    assert page.page.is_visible("#help")
    page.page.keyboard.press("Escape")
    assert not page.page.is_visible("#help")


def test_a_phone_shows_the_tiles(served, opened):
    page = show(opened, served, width=390, height=780, phone=True)
    assert page("() => document.documentElement.scrollWidth") <= 390
    assert not page.page.is_visible("#figures"), "the panel is folded"
    picture = page.picture()
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500
    page.page.touchscreen.tap(195, 400)
    page.page.wait_for_timeout(200)
    assert "Height" in page.page.inner_text("#status")
    box = page.page.locator("#status").bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= 390
    page.page.tap("#fold")
    assert page.page.is_visible("#figures")


def test_a_small_plateau_is_seen_from_above(place, opened):
    heights = 5500 + np.random.default_rng(7).random((33, 33)) * 20
    with open(place / "high.asc", "w") as out:
        out.write(f"ncols 33\nnrows 33\nxllcenter 86.9\nyllcenter 27.9\ncellsize {CELL / 3}\n")
        np.savetxt(out, heights, "%.3f")
    (place / "high.prj").write_text("EPSG:4326")
    terrane("tiles", place / "high.asc", place / "high")
    server = Served(place / "high")
    page = show(opened, server)
    height, target = page("() => { const c = terrane.camera(); return [terrane.at(c.frame.lon, c.frame.lat).height, c.target[2] / terrane.shown.exaggeration]; }")
    assert abs(height - 5510) < 15 and abs(height - target) < 0.01
    first = page.picture()
    assert (first.max(axis=2) - first.min(axis=2))[210:290, 470:560].mean() > 25, "the data are in the middle"
    server.stop()


def test_tiles_that_are_gone_are_told_of(grid, place, opened):
    import shutil

    shutil.copytree(place / "quantized-mesh", place / "damaged")
    for path in (place / "damaged/12").rglob("*.terrain"):
        path.write_bytes(b"no tile")
    server = Served(place / "damaged")
    page = show(opened, server)
    slide(page, 0.5)
    figures = page("() => terrane.figures()")
    assert figures["failures"] > 0 and figures["levels"][1] == 11, "what is above them is shown"
    assert "cannot be shown, first 12/" in page.page.inner_text("#notes")
    server.stop()


# ---- measuring and sections


def on_ellipsoid(one, other):
    """Metres between two places [longitude, latitude, ..], by a library of others."""
    return Geodesic.WGS84.Inverse(one[1], one[0], other[1], other[0])["s12"]


def in_space(lon, lat, height):
    """Earth-centred metres."""
    lon, lat = np.radians([lon, lat])
    flattening = 1 / 298.257223563
    squash = flattening * (2 - flattening)
    reach = 6378137 / np.sqrt(1 - squash * np.sin(lat) ** 2)
    flat = (reach + height) * np.cos(lat)
    return np.array([flat * np.cos(lon), flat * np.sin(lon), (reach * (1 - squash) + height) * np.sin(lat)])


def test_lengths_along_the_ellipsoid_are_those_of_geographiclib(served, opened):
    page = show(opened, served)
    random = np.random.default_rng(4)
    pairs = []
    for i in range(200):
        one = [random.uniform(-180, 180), np.degrees(np.arcsin(random.uniform(-1, 1)))]
        near = 10.0 ** random.uniform(-6, 1) * random.normal(size=2)
        other = [one[0] + near[0], np.clip(one[1] + near[1], -90, 90)]
        if i % 4 == 0:
            other = [random.uniform(-180, 180), random.uniform(-90, 90)]
        if i % 4 == 1:  # nearly opposite
            other = [one[0] + 180 + random.normal() / 4, -one[1] + random.normal() / 4]
        pairs.append([one, [float(v) for v in other]])
    pairs += [[[0, 0], [lon, 0]] for lon in [0, 1e-5, 90, 179.39, 179.5, 180]]
    pairs += [[[0, 1e-9], [179, -1e-10]], [[0, 90], [50, 90]], [[0, 90], [0, -90]], [[179.9, 10], [-179.9, 10]]]
    got = page("(pairs) => pairs.map(([a, b]) => terrane.geodesic(a, b))", pairs)
    for (one, other), length in zip(pairs, got):
        assert abs(length - on_ellipsoid(one, other)) < 1e-6, (one, other)


def test_what_is_measured_is_told(either, opened, grid):
    page = show(opened, either)
    # From where somebody looks, the camera follows the ground no more.
    look(page, grid, SIDE // 2, SIDE // 2, 12000)
    calm(page)
    page.page.keyboard.press("m")
    # As it is shown: of a plane canvas that was drawn anew, Chromium gives scripts the picture before now and then.
    seen = lambda: page.page.screenshot(clip={"x": 470, "y": 210, "width": 100, "height": 100})
    bare = seen()
    clicks = [(480, 260), (560, 220), (540, 300)]
    for at in clicks[:2]:
        page.page.mouse.click(*at)
    a, b = page("() => terrane.places()")
    told = lambda: dict(line.rsplit(" ", 2)[:2] for line in page("() => [...document.querySelectorAll('#status span')].map((e) => e.textContent)"))
    number = lambda text: float(text.replace(",", "").replace("+", ""))
    first = told()
    unit = 1000 if "km" in page.page.inner_text("#status").split("in space")[0] else 1
    assert abs(number(first["Length on the ellipsoid"]) - on_ellipsoid(a, b) / unit) <= 0.06, first
    assert abs(number(first["in space"]) - np.linalg.norm(in_space(*a) - in_space(*b)) / unit) <= 0.06, first
    assert abs(number(first["Height"]) - (b[2] - a[2])) <= 0.06, first
    assert abs(number(first["Grade of the last"]) - 100 * (b[2] - a[2]) / on_ellipsoid(a, b)) <= 0.06, first
    for place, at in zip([a, b], clicks):
        found = page("([px, py]) => terrane.under(px, py)", list(at))
        assert [found["lon"], found["lat"], found["height"]] == place
    # A line of several places, and one place taken back.
    page.page.mouse.click(*clicks[2])
    assert number(told()["Length on the ellipsoid"]) > number(first["Length on the ellipsoid"])
    page.page.keyboard.press("Backspace")
    assert told() == first
    page.wait(lambda: seen() != bare)  # the line is seen
    page.page.keyboard.press("Escape")
    assert page("() => terrane.places().length") == 0
    page.wait(lambda: seen() == bare)


def test_sections_are_of_the_tiles_that_are_shown(either, opened, grid):
    page = show(opened, either)
    page.page.keyboard.press("p")
    page.page.mouse.click(440, 270)
    page.page.mouse.click(590, 225)
    calm(page)
    a, b = page("() => terrane.places()")

    def check():
        """Every point lies on the terrain shown, on the line; the line is told of from one end to the other."""
        pieces = page("() => terrane.profile().pieces")
        assert page.page.is_visible("#sheet") and len(pieces) > 10
        assert abs(pieces[0][0][0]) < 1e-6 and abs(pieces[-1][1][0] - 1) < 1e-6
        assert all(one[0][0] < one[1][0] for one in pieces)
        length = on_ellipsoid(a, b)
        # Edges are straight in space and parallels are not: where tiles of two levels meet at one, the coarser edge lies beside it.
        at = [page("([lon, lat]) => terrane.at(lon, lat)", piece[0][1][:2]) for piece in pieces]
        side = 20_004_000 / 2 ** min(found["level"] for found in at if found) * np.cos(np.radians(a[1]))
        beside = side**2 * np.tan(np.radians(a[1])) / (8 * 6_371_000) / (abs(b[1] - a[1]) * 111_200 / length)
        gap = max(abs(one[1][0] - next_[0][0]) for one, next_ in zip(pieces, pieces[1:]))
        assert gap < 1e-6 + beside / length, "without gaps"
        for share, place in [end for piece in pieces for end in piece][:: max(1, len(pieces) // 40)]:
            assert abs(on_ellipsoid(a, place) - share * length) < 1e-3 * length, "as far along as it says"
            found = page("([lon, lat]) => terrane.at(lon, lat)", place[:2])
            assert found is None or abs(found["height"] - place[2]) < 0.02 + 1e-3 * abs(place[2]), (found, place)
            assert abs(on_ellipsoid(a, place) + on_ellipsoid(place, b) - length) < 1e-4 * length, "on the line"
        return pieces

    coarse = check()
    # Finer tiles, a finer section; and none for less of the line.
    assert len(check()) >= len(coarse)
    slide(page, 0.5)
    fine = check()
    assert len(fine) > len(coarse)
    error = float(page.page.inner_text("#profile-told").split("≤ ")[1].split(" m")[0])
    for share, (lon, lat, height) in [piece[0] for piece in fine]:
        column, row = (lon - WEST) / CELL, (lat - SOUTH) / CELL
        c, r = int(column), int(row)
        if not (0 <= c < SIDE - 1 and 0 <= r < SIDE - 1):
            continue
        square = grid[r : r + 2, c : c + 2]
        assert square.min() - error - 0.01 <= height <= square.max() + error + 0.01
    page("([lon, lat]) => terrane.look(lon, lat, 300)", a[:2])
    calm(page)
    assert page("() => terrane.profile().covered") > 1 - 1e-6
    # A pointer over the chart marks the place.
    box = page.page.locator("#profile").bounding_box()
    page.page.mouse.move(box["x"] + 50 + (box["width"] - 58) / 2, box["y"] + 60)
    mark = page("() => terrane.profile().mark")
    assert abs(on_ellipsoid(a, mark) / on_ellipsoid(a, b) - 0.5) < 0.01
    assert page.page.inner_text("#profile-told").startswith("Section: ")
    page.page.keyboard.press("Escape")
    assert not page.page.is_visible("#sheet")


SECTION = "([from, to]) => terrane.section(from, to)"


def shares_of(pieces):
    return [share for piece in pieces for share, _ in piece]


def test_sections_end_where_data_end(either, opened):
    page = show(opened, either)
    inside, outside = [WEST + 0.03, SOUTH + 0.03, 500], [WEST - 0.03, SOUTH + 0.03, 500]
    assert abs(min(shares_of(page(SECTION, [outside, inside]))) - 0.5) < 1e-3
    assert abs(max(shares_of(page(SECTION, [inside, outside]))) - 0.5) < 1e-3
    assert page(SECTION, [outside, [WEST - 0.03, SOUTH + 0.05, 500]]) == []
    # No line, or none that is the only one.
    assert page(SECTION, [inside, inside]) == []
    assert page(SECTION, [inside, [inside[0] - 180, -inside[1], 500]]) == []


def test_sections_take_each_place_of_one_tile(served, opened):
    page = show(opened, served)
    # Every other tile is not there: quarters of those above are shown beside tiles below them.
    page("""() => { const before = window.fetch; window.fetch = async (url, how) =>
        (Number(url.split('/')[1]) % 2 ? before(url, how) : new Response('', { status: 404 })); }""")
    assert slide(page, 0.5)["failures"] > 0
    assert any(tile["quarters"] != 15 for tile in page("() => terrane.drawn()"))
    for row in [0.01, 0.02, 0.04]:
        pieces = page(SECTION, [[WEST + 0.005, SOUTH + row, 500], [WEST + 0.065, SOUTH + row + 0.01, 500]])
        ends = [(one[1][0], next_[0][0]) for one, next_ in zip(pieces, pieces[1:])]
        assert len(ends) > 5 and max(abs(end - begin) for end, begin in ends) < 1e-4


def test_sections_cross_180_degrees(place, opened):
    with open(place / "globe-5.asc", "w") as out:
        out.write("ncols 73\nnrows 35\nxllcenter -180\nyllcenter -85\ncellsize 5\n")
        np.savetxt(out, np.full((35, 73), 500.0), "%.1f")
    (place / "globe-5.prj").write_text("EPSG:4326")
    terrane("tiles", place / "globe-5.asc", place / "globe-5", "--max-level", 7)
    server = Served(place / "globe-5")
    page = show(opened, server)
    page("() => terrane.look(180, 10, 4e6)")
    calm(page)
    ends = [[174, 5, 500], [-173, 16, 500]]
    pieces = page(SECTION, ends)
    shares = shares_of(pieces)
    assert min(shares) == 0 and max(shares) == 1
    assert max(abs(one[1][0] - next_[0][0]) for one, next_ in zip(pieces, pieces[1:])) < 1e-6, "without gaps"
    assert {np.sign(at[0]) for piece in pieces for _, at in piece} == {1, -1}
    error = max(tile["error"] for tile in page("() => terrane.drawn()"))
    assert all(abs(at[2] - 500) <= error for piece in pieces for _, at in piece)
    server.stop()


# ---- requests that fail

# From now on some requests fail so often: with a status, or without an answer.
FAILING = """([times, status, pauses]) => { const before = window.fetch; const now = window.asked = {};
    terrane.stream().asker.pauses = pauses;
    window.fetch = async (url, how) => { const list = now[url] ??= []; list.push(performance.now());
      if (list.length > times) return before(url, how);
      if (status === 0) throw new TypeError('no answer');
      return new Response('', { status, statusText: 'told' }); }; }"""


# Keeps each text of the notes: a text is there for as long as a pause, and a busy machine may look for it too late.
NOTES = """() => { const notes = document.getElementById('notes'); window.notes = [];
    new MutationObserver(() => window.notes.push(notes.innerText)).observe(notes, { childList: true, characterData: true, subtree: true }); }"""


@pytest.mark.parametrize("status", [0, 503])
def test_requests_that_failed_are_made_again(either, opened, grid, status):
    page = show(opened, either)
    before = page.figures
    page(NOTES)
    page(FAILING, [3, status, [500, 1000, 2000]])
    slide_soon = "() => { const s = document.getElementById('allowed'); s.value = -1; s.dispatchEvent(new Event('input')); }"
    page(slide_soon)
    page.wait(lambda: page("() => Object.keys(window.asked).length") > 0)
    figures = calm(page)
    assert figures["failures"] == 0 and figures["again"] == 0 and figures["loaded"] > before["loaded"]
    assert any("failed requests will be repeated" in note for note in page("() => window.notes"))
    assert page.page.inner_text("#notes") == ""
    asked = list(page("() => window.asked").values())
    assert len(asked) > 3 and all(len(times) in (1, 2, 3, 4) for times in asked)
    full = [np.diff(times) for times in asked if len(times) == 4]
    assert full
    for pauses in full:
        assert (pauses > [495, 995, 1995]).all(), "pauses that grow"


def test_requests_are_given_up_in_the_end(either, opened, grid):
    page = show(opened, either)
    page(FAILING, [10**6, 500, [20, 40]])
    figures = slide(page, 0.5)
    assert figures["failures"] > 0 and figures["drawn"] > 0, "what is above is shown"
    assert "cannot be shown, first" in page.page.inner_text("#notes")
    assert "500 told after 3 requests; reload the page" in page.page.inner_text("#notes")
    assert {len(times) for times in page("() => window.asked").values()} == {3}


def test_what_is_not_there_is_asked_for_once(served, opened):
    page = show(opened, served)
    page(FAILING, [10**6, 404, [20, 40]])
    figures = slide(page, 0.5)
    assert figures["failures"] > 0 and {len(times) for times in page("() => window.asked").values()} == {1}
