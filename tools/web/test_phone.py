"""Pages on a phone: what the folded panel holds is drawn when it opens, and the help can be read."""

import os

import numpy as np
import pytest

from conftest import terrane

PHONE = {"width": 390, "height": 844, "phone": True}

DRAWN = """(id) => { const c = document.getElementById(id);
    const d = c.getContext('2d').getImageData(0, 0, Math.max(1, c.width), Math.max(1, c.height)).data;
    const s = new Set(); for (let i = 0; i < d.length; i += 4) if (d[i + 3]) s.add((d[i] << 16) | (d[i + 1] << 8) | d[i + 2]);
    return [c.width, c.height, s.size]; }"""


@pytest.fixture(scope="module")
def pages(place):
    folder = place / "phone"
    folder.mkdir()
    dem, mesh, cloud = (folder / name for name in ("dem.tif", "mesh.ply", "cloud.laz"))
    terrane("synth", "rough,size=129,seed=3", dem)
    terrane("tin", dem, mesh, "--max-error", "8")
    terrane("synth", "cloud,size=40,density=3,seed=2", cloud)
    made = {name: folder / f"{name}.html" for name in ("mesh", "errors", "grid", "lines", "cloud")}
    terrane("view", mesh, "--html", made["mesh"])
    terrane("view", mesh, "--html", made["errors"], "--against", dem)
    terrane("view", dem, "--html", made["grid"])
    terrane("view", "synth:koch,vertices=3000", "--html", made["lines"])
    terrane("view", cloud, "--html", made["cloud"])
    return made


@pytest.mark.parametrize("name", ["mesh", "errors", "grid", "lines", "cloud"])
def test_the_panel_is_drawn_when_it_opens(pages, opened, name):
    page = opened(pages[name], **PHONE)
    assert page("() => document.getElementById('panel').classList.contains('closed')")
    page.page.tap("#fold")
    page.page.wait_for_timeout(200)
    for canvas in page("() => [...document.querySelectorAll('#panel canvas')].filter((c) => !c.hidden).map((c) => c.id)"):
        width, height, colours = page(DRAWN, canvas)
        assert width > 200 and height > 40 and colours > (20 if canvas == "legend" else 3), (canvas, width, height, colours)
    if os.environ.get("SHOTS"):
        page.page.screenshot(path=os.path.join(os.environ["SHOTS"], f"panel-{name}.png"))


@pytest.mark.parametrize("name", ["mesh", "lines", "cloud"])
def test_the_help_can_be_read(pages, opened, name):
    page = opened(pages[name], **PHONE)
    page.page.tap("#fold")
    page("() => document.getElementById('ask').click()")
    box = page("() => { const b = document.getElementById('help').getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; }")
    assert box[0] >= 0 and box[1] >= 0 and box[2] <= 390 and box[3] <= 844, box
    wide, held = page("() => { const h = document.getElementById('help'); return [h.scrollWidth, h.clientWidth]; }")
    assert wide <= held, "nothing is cut off at the side"
    cut = page("""() => { const right = document.getElementById('help').getBoundingClientRect().right;
        return [...document.querySelectorAll('#help td')].filter((td) => td.getBoundingClientRect().right > right + 0.5
          || td.scrollWidth > td.clientWidth + 1).map((td) => td.textContent); }""")
    assert cut == []
    if os.environ.get("SHOTS"):
        page.page.screenshot(path=os.path.join(os.environ["SHOTS"], f"help-{name}.png"))
    page.page.tap("#done")
    assert page("() => document.getElementById('help').hidden")


def test_errors_are_a_key_away(pages, opened):
    page = opened(pages["errors"])
    assert page("() => [terrane.shown.colour, terrane.shown.wire]") == [1, False], "heights, without edges"
    assert page.page.get_attribute('[data-colour="1"]', "aria-pressed") == "true"
    heights = page.picture()
    page.page.keyboard.press("e")
    edges = page.picture()
    assert (np.abs(edges - heights).max(axis=2) > 20).mean() > 0.01, "edges are drawn"
    page.page.keyboard.press("3")
    assert page("() => terrane.shown.colour") == 3
    assert (page.picture() != edges).any(axis=2).mean() > 0.05
