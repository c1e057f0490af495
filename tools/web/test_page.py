"""Pages of `terrane view --html`, as a browser shows them.

    python -m pytest tools/web      # with TERRANE=target/debug/terrane and CHROMIUM=/usr/bin/chromium, or others

Pages are made by the program, opened in headless Chromium without a network, and asked through what they give to
scripts (`window.terrane`) and through real clicks and keys. What they show is compared with the files they were
made from, read here with numpy, and with other verbs of the program. Pictures are compared by what is in them,
not by pixels: drivers differ.
"""

import numpy as np
import pytest
from conftest import SKY, Opened, terrane


def read_ply(path):
    """Vertices and triangles of a binary PLY as terrane writes it."""
    data = path.read_bytes()
    head, body = data.split(b"end_header\n", 1)
    words = [line.split() for line in head.decode().splitlines()]
    counts = {word[1]: int(word[2]) for word in words if word[0] == "element"}
    assert [word[1:] for word in words if word[0] == "property"][:3] == [["double", axis] for axis in "xyz"]
    vertices = np.frombuffer(body, "<f8", 3 * counts["vertex"]).reshape(-1, 3)
    faces = np.frombuffer(body[vertices.nbytes :], [("n", "u1"), ("ids", "<u4", 3)], counts["face"])
    assert (faces["n"] == 3).all()
    return vertices, faces["ids"]


def read_asc(path):
    """Heights of an ESRI ASCII grid, and where its samples are."""
    lines = path.read_text().splitlines()
    head = dict(line.lower().split() for line in lines[:6] if line[0].isalpha())
    heights = np.loadtxt(lines[len(head) :])
    size = float(head["cellsize"])
    # Corners or middles of the outermost cells.
    west, south = [float(head.get(f"{axis}llcenter", float(head.get(f"{axis}llcorner", 0)) + size / 2)) for axis in "xy"]
    columns = west + size * np.arange(heights.shape[1])
    rows = south + size * np.arange(heights.shape[0])[::-1]
    return heights, columns, rows


def weights(corners, x, y):
    """Barycentric weights of places in a triangle."""
    (ax, ay), (bx, by), (cx, cy) = corners[:, :2]
    all_ = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    b = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / all_
    c = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / all_
    return np.stack([1 - b - c, b, c])


def height_at(vertices, triangles, x, y):
    for triangle in triangles:
        corners = vertices[triangle]
        if corners[:, 0].min() <= x <= corners[:, 0].max() and corners[:, 1].min() <= y <= corners[:, 1].max():
            share = weights(corners, x, y)
            if (share >= -1e-9).all():
                return float(share @ corners[:, 2])
    return None


@pytest.fixture(scope="session")
def mesh(place):
    """A grid, its mesh, and the page of both."""
    terrane("synth", "rough,size=129,seed=5", place / "dem.tif")
    terrane("convert", place / "dem.tif", place / "dem.asc")
    terrane("tin", place / "dem.asc", place / "mesh.ply", "--max-error", 2)
    report = terrane("view", place / "mesh.ply", "--html", place / "mesh.html", "--against", place / "dem.asc")
    return {"report": report, "page": place / "mesh.html", "ply": read_ply(place / "mesh.ply"), "asc": read_asc(place / "dem.asc")}


def test_the_page_of_a_mesh_holds_the_mesh(mesh, opened):
    page = opened(mesh["page"])
    vertices, triangles = mesh["ply"]
    got = np.array(page("() => Array.from({length: %d}, (_, i) => terrane.vertex(i))" % len(vertices)))
    assert np.abs(got - vertices).max() <= mesh["report"]["rounding"] <= 1e-4
    assert np.array_equal(np.array(page("() => [...terrane.corners()]")).reshape(-1, 3), triangles)
    assert mesh["report"]["triangles"] == len(triangles) and mesh["report"]["vertices"] == len(vertices)


def test_errors_are_those_of_the_samples(mesh, opened, place):
    page = opened(mesh["page"])
    errors = np.array(page("() => [...terrane.errors()]"), float)
    proof = terrane("verify", place / "mesh.ply", place / "dem.asc")
    assert abs(np.nanmax(errors) - mesh["report"]["max_error"]) < 1e-5
    assert abs(proof["max_error"] - mesh["report"]["max_error"]) < 1e-5
    vertices, triangles = mesh["ply"]
    heights, columns, rows = mesh["asc"]
    x, y = np.meshgrid(columns, rows)
    for own, triangle in list(zip(errors, triangles))[::7]:
        corners = vertices[triangle]
        share = weights(corners, x, y)
        inside = (share >= -1e-9).all(axis=0)
        plane = np.tensordot(corners[:, 2], share, axes=1)
        assert abs(np.abs(plane - heights)[inside].max() - own) < 1e-4


def test_a_surface_is_drawn_and_every_way_to_draw_it_differs(mesh, opened):
    page = opened(mesh["page"])
    pictures = {}
    for name, keys in {"error": "3", "slope": "2", "height": "1", "relief": "4", "edges": "1e", "plain": "e", "facets": "g", "high": "g++++", "no base": "b"}.items():
        for key in keys:
            page.page.keyboard.press(key)
        pictures[name] = page.picture()
    first = pictures["height"]
    is_sky = np.abs(first - SKY).sum(axis=2) < 12
    assert is_sky[:40, 400:1000].all(), "sky above"
    assert 0.15 < 1 - is_sky.mean() < 0.8, "a surface below it"
    assert not is_sky[330:430, 640:740].any(), "in the middle of what the panel leaves"
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 500, "in many colours"
    lit = lambda picture: picture[~is_sky].mean()
    assert lit(pictures["edges"]) < lit(first) - 3, "edges are dark"
    assert (pictures["plain"] == first).all(), "edges go again"
    for name in ["error", "slope", "relief", "edges", "facets", "high"]:
        assert (pictures[name] != first).any(axis=2).mean() > 0.02, name
    assert (pictures["no base"] != pictures["high"]).any(), "the base goes"


def test_the_height_under_the_cursor_is_that_of_the_mesh(mesh, opened):
    page = opened(mesh["page"])
    vertices, triangles = mesh["ply"]
    random = np.random.default_rng(3)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    for _ in range(60):
        x, y = low[:2] + random.random(2) * (high - low)[:2]
        assert abs(page("([x, y]) => terrane.at(x, y).z", [x, y]) - height_at(vertices, triangles, x, y)) < 1e-4
    assert page("() => terrane.at(0, 0)") is None
    # And where the mouse is, from a view in perspective.
    for px, py in [(690, 380), (560, 420), (800, 330)]:
        page.page.mouse.move(px, py)
        told = dict(line.rsplit(" ", 1) if i < 2 else line.split(" ", 1) for i, line in enumerate(page("() => [...document.querySelectorAll('#status span')].slice(0, 3).map((e) => e.textContent)")))
        x, y = (float(told[axis].replace(",", "")) for axis in "XY")
        height = float(told["Height"].split()[0].replace(",", ""))
        assert abs(height - height_at(vertices, triangles, x, y)) < 0.2
        found = page("([px, py]) => terrane.under(px, py)", [px, py])
        assert abs(found["z"] - height_at(vertices, triangles, found["x"], found["y"])) < 1e-3
        back = page("(p) => terrane.toView([p.x, p.y, p.z])", found)
        assert np.hypot(back[0] - px, back[1] - py) < 1e-3, "it is seen where it was found"


def test_sections_follow_the_mesh_and_lengths_are_measured(mesh, opened):
    page = opened(mesh["page"])
    vertices, triangles = mesh["ply"]
    page.page.keyboard.press("p")
    page.page.mouse.click(560, 420)
    page.page.mouse.click(820, 350)
    ends = page("() => terrane.places()")
    line = page("() => terrane.profile().line")
    assert len(line) > 20 and page.page.is_visible("#sheet")
    shares = np.array([share for share, _ in line])
    assert shares[0] < 1e-9 and shares[-1] > 1 - 1e-9 and (np.diff(shares) > -1e-12).all()
    for _, (x, y, z) in line:
        assert abs(z - height_at(vertices, triangles, x, y)) < 1e-3
    page.page.keyboard.press("Escape")
    assert not page.page.is_visible("#sheet")
    page.page.keyboard.press("m")
    page.page.mouse.click(560, 420)
    page.page.mouse.click(820, 350)
    told = page.page.inner_text("#status")
    plan = np.hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1])
    assert abs(float(told.split("plan ")[1].split(" m")[0].replace(",", "")) - plan) < 0.06, told


def test_the_camera_turns_moves_and_flies(mesh, opened):
    page = opened(mesh["page"])
    state = lambda: page("() => { const c = terrane.camera(); return [c.yaw, c.pitch, c.distance, ...c.target]; }")
    before = state()
    page.page.mouse.move(690, 380)
    page.page.mouse.down()
    page.page.mouse.move(760, 400, steps=4)
    page.page.mouse.up()
    turned = state()
    assert turned[0] > before[0] and turned[1] < before[1] and turned[3:] == before[3:]
    page.page.mouse.wheel(0, -400)
    page.page.wait_for_timeout(100)
    nearer = state()
    assert nearer[2] < turned[2]
    page.page.keyboard.down("w")
    page.page.wait_for_timeout(300)
    page.page.keyboard.up("w")
    flown = state()
    assert flown[3:] != nearer[3:] and flown[0] == nearer[0]
    page.page.keyboard.press("r")
    assert np.allclose(state(), before)
    page.page.keyboard.press("?")
    assert page.page.is_visible("#help")
    page.page.keyboard.press("Escape")
    assert not page.page.is_visible("#help")


def test_a_phone_shows_the_surface(mesh, opened):
    page = opened(mesh["page"], width=390, height=780, phone=True)
    assert page("() => document.documentElement.scrollWidth") <= 390
    assert not page.page.is_visible("#figures"), "the panel is folded"
    picture = page.picture()
    assert 0.1 < (np.abs(picture - SKY).sum(axis=2) > 12).mean() < 0.9
    page.page.touchscreen.tap(195, 420)
    assert "Height" in page.page.inner_text("#status")
    page.page.tap("#fold")
    assert page.page.is_visible("#figures")


def test_nothing_can_be_fetched(mesh, browser):
    page = Opened(browser, mesh["page"])
    got = page("() => fetch('https://example.org/').then(() => 'fetched', (e) => 'refused')")
    assert got == "refused" and any("Content Security Policy" in fault for fault in page.faults)
    page.context.close()


def test_names_of_files_are_text(place, opened):
    name = "<img src=x onerror=alert(1)>&amp;.obj"
    (place / name).write_text("v 0 0 0\nv 8 0 1\nv 8 8 2\nv 0 8 3\nf 1 2 3\nf 1 3 4\n")
    terrane("view", place / name, "--html", place / "named.html")
    page = opened(place / "named.html")
    assert page.page.inner_text("h1") == name and page.page.title() == name


def test_the_page_of_a_grid_has_its_samples(place, mesh, opened):
    heights, columns, rows = mesh["asc"]
    report = terrane("view", place / "dem.asc", "--html", place / "grid.html")
    assert report["stride"] == 1 and report["vertices"] == heights.size
    page = opened(place / "grid.html")
    for row, column in [(0, 0), (64, 3), (128, 128), (17, 90)]:
        found = page("([x, y]) => terrane.at(x, y).z", [columns[column], rows[row]])
        assert abs(found - heights[row, column]) <= report["rounding"] + 1e-4, "but for digits of the text"
    assert page("() => document.querySelector('[data-colour=\"3\"]').disabled"), "there are no errors to show"


# ---- lines


def test_the_slider_of_lines_filters_as_the_methods_do(place, opened):
    terrane("synth", "coverage,vertices=6000,features=40", place / "lines.geojson")
    report = terrane("view", place / "lines.geojson", "--html", place / "lines.html")
    page = opened(place / "lines.html")
    assert page("() => terrane.facts.vertices") == report["vertices"]
    for method, name in enumerate(["rdp", "visvalingam"]):
        low, high = page("(m) => terrane.range(m)", method)
        for share in [0.2, 0.5, 0.7]:
            threshold = float(f"{low * (high / low) ** share:.4g}")
            how = ["--tolerance", threshold] if method == 0 else ["--area", threshold]
            out = place / f"few-{name}-{share}.geojson"
            kept = terrane("line", place / "lines.geojson", out, "--method", name, *how)["kept"]
            page("([m, t]) => terrane.choose(m, t)", [method, threshold])
            result = page("() => terrane.result()")
            assert result["kept"] == kept == page("([m, t]) => terrane.count(m, t)", [method, threshold]), (name, threshold)
    # By hand: the slider, the number, the other method.
    told = lambda: int(page.page.inner_text("#kept").replace(",", ""))
    page.page.fill("#exact", "0")
    everything = told()
    page.page.focus("#slider")
    page("() => { const s = document.getElementById('slider'); s.value = 900; s.dispatchEvent(new Event('input')); }")
    few = told()
    assert few < everything / 2
    page.page.keyboard.press("Home")
    assert told() == everything
    page("() => { const s = document.getElementById('slider'); s.value = 700; s.dispatchEvent(new Event('input')); }")
    some = told()
    page.page.click("#methods button:nth-child(2)")
    assert abs(told() - some) <= 0.02 * some, "the other method keeps as many"
    picture = page.picture()
    red = (picture[:, :, 0] > picture[:, :, 2] + 60).mean()
    assert red > 0.01, "lines are drawn"
    page.page.click("#original")
    assert (page.picture() != picture).any(axis=2).mean() > 0.001, "the original goes"


def test_a_move_over_a_million_vertices_takes_less_than_a_frame(place, opened):
    terrane("view", "synth:koch,vertices=1000000", "--html", place / "koch.html")
    page = opened(place / "koch.html")
    took = page("""() => { const out = [];
        for (let i = 0; i < 60; i++) { const m = i % 2, [low, high] = terrane.range(m);
          terrane.choose(m, low * (high / low) ** ((i % 30) / 30)); out.push(terrane.result().took); }
        return out; }""")
    print("ms a move: median", np.median(took), "largest", max(took))
    assert np.median(took) <= 16, took


# ---- insertion


def test_insertion_is_that_of_the_textbook(place, opened):
    terrane("synth", "integer,size=65,seed=3", place / "whole.tif")
    report = terrane("view", place / "whole.tif", "--html", place / "insertion.html", "--insertion")
    assert report["rounding"] == 0 and report["vertices"] == 65 * 65
    page = opened(place / "insertion.html")
    for which, triangulation in enumerate(["delaunay", "split3"]):
        for error in [20, 8, 3, 1]:
            out = place / f"greedy-{triangulation}-{error}.ply"
            other = terrane("tin", place / "whole.tif", out, "--method", "greedy1", "--triangulation", triangulation, "--max-error", error)
            assert page("([i, e]) => terrane.needed(i, e)", [which, error]) == other["vertices"], (triangulation, error)
            page("(n) => terrane.go(n - 4)", other["vertices"])
            own = page("(i) => terrane.meshes()[i].vertices.map((v) => [v % 65, Math.floor(v / 65)])", which)
            vertices, triangles = read_ply(out)
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            lattice = np.rint((vertices[:, :2] - [low[0], high[1]]) / ((high - low)[:2] / 64) * [1, -1]).astype(int)
            assert sorted(map(tuple, own)) == sorted(map(tuple, lattice.tolist()))
            assert page("(i) => terrane.meshes()[i].triangles", which) == len(triangles)


def test_insertion_plays(place, opened):
    terrane("view", "synth:rough,size=65,seed=2", "--html", place / "play.html", "--insertion")
    page = opened(place / "play.html")
    page("() => terrane.go(0)")
    assert page.page.inner_text("#told") == "4 vertices"
    page.page.click("#play")
    page.wait(lambda: page("() => terrane.shown.step") >= 2)
    page.page.click("#play")
    step = page("() => terrane.shown.step")
    page.page.keyboard.press("ArrowRight")
    assert page("() => terrane.shown.step") == step + 1
    page.page.click("#curve", position={"x": 500, "y": 60})
    assert page("() => terrane.shown.step") > step + 1
    runs = page("() => terrane.runs().map((run) => [run.largest[0], run.largest.at(-1), run.rms.at(-1)])")
    assert all(first > 0 and last == 0 and rms < 1e-3 for first, last, rms in runs)
    for canvas in ["mesh-0", "mesh-1", "curve"]:
        colours = page("(id) => { const c = document.getElementById(id); const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; const s = new Set(); for (let i = 0; i < d.length; i += 4) s.add((d[i] << 16) | (d[i + 1] << 8) | d[i + 2]); return s.size; }", canvas)
        assert colours > 20, canvas
