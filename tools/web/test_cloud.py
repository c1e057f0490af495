"""Pages of clouds, as a browser shows them: every point is where and what the file says, colours differ, classes and
returns can be switched off, and what is under the cursor is what is seen there."""

import numpy as np
import pytest
from conftest import SKY, terrane


def read_las(path):
    """Places, intensities, returns, classes and colours of a LAS file, read by its header."""
    data = path.read_bytes()
    word = lambda at, kind: np.frombuffer(data, kind, 1, at)[0]
    start, form, size = word(96, "<u4"), word(104, "u1"), word(105, "<u2")
    count = word(247, "<u8")
    scale, offset = np.frombuffer(data, "<f8", 3, 131), np.frombuffer(data, "<f8", 3, 155)
    assert form in (6, 7)
    kinds = [("xyz", "<i4", 3), ("intensity", "<u2"), ("returns", "u1"), ("flags", "u1"), ("class", "u1"), ("rest", "V13")]
    kinds += [("rgb", "<u2", 3)] if form == 7 else []
    known = np.dtype(kinds).itemsize
    kinds += [("extra", f"V{size - known}")] if size > known else []
    points = np.frombuffer(data, kinds, count, start)
    return points["xyz"] * scale + offset, points


@pytest.fixture(scope="session")
def cloud(place):
    """A cloud and its page."""
    terrane("synth", "cloud,size=120,density=3,seed=7", place / "cloud.las")
    report = terrane("view", place / "cloud.las", "--html", place / "cloud.html", "--keep-withheld")
    return {"report": report, "page": place / "cloud.html", "las": read_las(place / "cloud.las")}


ALL = """() => Array.from({length: terrane.points()}, (_, i) => { const p = terrane.point(i);
    return [p.x, p.y, p.z, p.class, p.number, p.returns, p.intensity]; })"""


def rows_of(table):
    return table[np.lexsort(table.T)]


def test_the_page_holds_all_points_as_the_file_has_them(cloud, opened):
    page = opened(cloud["page"])
    got = np.array(page(ALL))
    places, points = cloud["las"]
    bits = [points["class"], points["returns"] & 15, points["returns"] >> 4, points["intensity"]]
    wanted = np.column_stack([places, *bits])
    assert cloud["report"]["points"] == len(wanted) == len(got) and cloud["report"]["rounding"] == 0
    steps = lambda table: np.column_stack([np.rint(table[:, :3] * 100), table[:, 3:]])
    assert np.array_equal(rows_of(steps(got)), rows_of(steps(wanted)))
    counts = {of["class"]: of["points"] for of in page("() => terrane.facts.classes")}
    assert counts == dict(zip(*[part.tolist() for part in np.unique(points["class"], return_counts=True)]))


def test_a_share_of_the_points_is_spread_evenly_and_told(cloud, place, opened):
    terrane("view", place / "cloud.las", "--html", place / "few.html", "--points", 4000, "--keep-withheld")
    page = opened(place / "few.html")
    got, (places, _) = np.array(page(ALL)), cloud["las"]
    assert len(got) == 4000
    known = set(map(tuple, np.rint(places * 100).astype(int).tolist()))
    assert all(tuple(point) in known for point in np.rint(got[:, :3] * 100).astype(int).tolist()), "points of the file"
    # Of each quarter as large a share as of all, within four standard deviations.
    middle = (places[:, :2].min(axis=0) + places[:, :2].max(axis=0)) / 2
    share = lambda table: np.bincount((table[:, :2] > middle) @ [1, 2], minlength=4) / len(table)
    assert np.abs(share(got) - share(places)).max() < 4 * np.sqrt(0.25 * 0.75 / 4000)
    assert f"4000 of {len(places)} points" in page.page.inner_text("#notes")
    assert "%" in page.page.inner_text("#figures")


def test_colours_and_classes_change_the_picture(cloud, opened):
    page = opened(cloud["page"])
    pictures = {}
    for name, key in {"height": "1", "class": "2", "intensity": "3", "return": "4", "colour": "5"}.items():
        page.page.keyboard.press(key)
        pictures[name] = page.picture()
    is_sky = np.abs(pictures["height"] - SKY).sum(axis=2) < 12
    assert 0.1 < 1 - is_sky.mean() < 0.8, "points are drawn"
    assert not is_sky[340:430, 640:740].all(), "in the middle of what the panel leaves"
    assert len(np.unique(pictures["height"].reshape(-1, 3), axis=0)) > 300
    for name in ["class", "intensity", "return"]:
        assert (pictures[name] != pictures["height"]).any(axis=2).mean() > 0.02, name
    assert (pictures["colour"] == pictures["return"]).all(), "there are no colours, and the button tells so"
    assert page.page.is_disabled('[data-colour="4"]')
    # A click on a class hides it, another one shows it again; with Shift it is alone.
    page.page.keyboard.press("2")
    all_ = page("() => terrane.countShown()")
    ground = next(of for of in page("() => terrane.facts.classes") if of["class"] == 2)
    line = page.page.locator("#kinds button", has_text="2 ground")
    line.click()
    assert line.get_attribute("aria-pressed") == "false"
    assert page("() => terrane.countShown()") == all_ - ground["points"]
    without = page.picture()
    assert (without != pictures["class"]).any(axis=2).mean() > 0.02
    colour = np.array(ground["colour"])
    near = lambda picture: (np.abs(picture - colour).sum(axis=2) < 6).sum()
    assert near(pictures["class"]) > 500 > near(without)
    line.click()
    assert (page.picture() == pictures["class"]).all()
    line.click(modifiers=["Shift"])
    assert page("() => terrane.countShown()") == ground["points"]
    page.page.click("#everything")
    assert page("() => terrane.countShown()") == all_
    # Returns, too; and what is hidden stays so in other colours.
    page.page.keyboard.press("4")
    page.page.locator("#kinds button").first.click()
    page.page.keyboard.press("1")
    assert (page.picture() != pictures["height"]).any(axis=2).mean() > 0.02
    page.page.keyboard.press("0")
    assert (page.picture() == pictures["height"]).all()


def test_points_grow_are_shaded_and_stretched(cloud, opened):
    page = opened(cloud["page"])
    drawn = lambda: (np.abs(page.picture() - SKY).sum(axis=2) > 12).mean()
    before = drawn()
    for _ in range(6):
        page.page.keyboard.press(".")
    assert drawn() > before
    shaded = page.picture()
    page.page.keyboard.press("l")
    assert page.picture().mean() > shaded.mean(), "shades are dark"
    page.page.keyboard.press("+")
    assert (page.picture() != shaded).any(axis=2).mean() > 0.02
    page.page.keyboard.press("t")
    assert page("() => terrane.camera().pitch") < -1.5


def test_what_is_under_the_cursor_is_a_point_that_is_seen_there(cloud, opened):
    page = opened(cloud["page"])
    places, points = cloud["las"]
    found_any = 0
    for px, py in [(690, 380), (560, 420), (800, 330), (650, 450), (760, 400)]:
        found = page("([px, py]) => terrane.under([px][0], py)", [px, py])
        if found is None:
            continue
        found_any += 1
        seen = page("(p) => terrane.toView([p.x, p.y, p.z])", found)
        assert np.hypot(seen[0] - px, seen[1] - py) < 14, "within its size and a few pixels"
        own = np.nonzero(np.abs(places - [found["x"], found["y"], found["z"]]).max(axis=1) < 0.005)[0]
        assert any(points["class"][i] == found["class"] and points["intensity"][i] == found["intensity"] for i in own)
        page.page.mouse.move(px, py)
        told = page.page.inner_text("#status")
        assert "Height" in told and "Class" in told and "Return" in told and str(found["intensity"]) in told
    assert found_any >= 3
    page.page.keyboard.press("m")
    page.page.mouse.click(690, 380)
    page.page.mouse.click(650, 450)
    ends = np.array(page("() => terrane.places()"))
    assert len(ends) == 2
    told = page.page.inner_text("#status")
    plan = np.hypot(*(ends[1] - ends[0])[:2])
    assert abs(float(told.split("plan ")[1].split(" m")[0].replace(",", "")) - plan) < 0.06, told
    page.page.keyboard.press("p")
    assert page("() => terrane.places().length") == 2, "clouds have no sections"
    page.page.keyboard.press("Escape")


def test_colours_of_the_points_are_shown(place, opened):
    """Colours of 16 bits, as other programs write them, and of 8."""
    terrane("points", place / "cloud.las", place / "rgb.las", "--point-format", 7, "--overwrite")
    for name, times in [("16", 257), ("8", 1)]:
        data = bytearray((place / "rgb.las").read_bytes())
        start, size = int.from_bytes(data[96:100], "little"), int.from_bytes(data[105:107], "little")
        count = int.from_bytes(data[247:255], "little")
        for i in range(count):
            at = start + i * size + 30
            data[at : at + 6] = np.array([i % 200, 40, 255 - i % 200], "<u2").__mul__(times).astype("<u2").tobytes()
        (place / f"rgb{name}.las").write_bytes(data)
        terrane("view", place / f"rgb{name}.las", "--html", place / f"rgb{name}.html")
    pages = [opened(place / f"rgb{name}.html") for name in ["16", "8"]]
    colours = [page("() => Array.from({length: 500}, (_, i) => terrane.point(i).colour)") for page in pages]
    assert colours[0] == colours[1] and all(g == 40 and r + b == 255 for r, g, b in colours[0])
    for page in pages:
        page.page.keyboard.press("l")
        page.page.keyboard.press("5")
    pictures = [page.picture() for page in pages]
    assert (pictures[0] == pictures[1]).all()
    is_point = np.abs(pictures[0] - SKY).sum(axis=2) > 12
    assert (np.abs(pictures[0][is_point][:, 1] - 40) <= 1).all(), "all are of the colours of points"


def test_a_phone_shows_the_cloud(cloud, opened):
    page = opened(cloud["page"], width=390, height=780, phone=True)
    assert page("() => document.documentElement.scrollWidth") <= 390
    assert not page.page.is_visible("#figures"), "the panel is folded"
    assert 0.05 < (np.abs(page.picture() - SKY).sum(axis=2) > 12).mean() < 0.9
    page.page.touchscreen.tap(195, 400)
    assert "Height" in page.page.inner_text("#status")
    page.page.tap("#fold")
    assert page.page.is_visible("#figures")


def test_a_single_point_is_a_cloud(place, opened):
    (place / "one.csv").write_text("x,y,z\n5.5,6.5,7.5\n")
    terrane("view", f"cloud:{place / 'one.csv'}", "--html", place / "one.html")
    page = opened(place / "one.html")
    assert page("() => terrane.point(0).z") == 7.5
    assert (np.abs(page.picture() - SKY).sum(axis=2) > 12).any()
    assert "NaN" not in page.page.inner_text("body")
