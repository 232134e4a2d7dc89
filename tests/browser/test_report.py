"""Viewers in a page that is one file: turned and played without a server, still where scripts are off."""

from importlib.resources import files

import pytest

from tensegra.mechanics import solve_path
from tensegra.structure import library
from tensegra.viewer import panel, scene
from tensegra.viewer.page import viewer_head, viewer_tail


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    """Return a page as a report writes it, with a path, a structure alone and their still pictures."""
    beam = library.paper_beam()
    path = solve_path(beam, {"A14": 0.1, "A23": 0.1})
    still = '<img alt="still" src="data:image/svg+xml;utf8,<svg xmlns=\'http://www.w3.org/2000/svg\'/>">'
    style = files("tensegra.report").joinpath("style.css").read_text("utf-8")
    body = panel(scene(path), "path", still) + panel(scene(beam), "given", still)
    file = tmp_path_factory.mktemp("report") / "report.html"
    file.write_text(
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>t</title>'
        f"<style>{style}</style>{viewer_head()}</head>"
        f"<body><main>{body}</main>{viewer_tail()}</body></html>",
        encoding="utf-8",
    )
    return file


VIEWER = "document.querySelector('[data-tensegra-scene]').viewer"

INKED = f"""() => {{
  const viewer = {VIEWER}, gl = viewer.painter.gl, [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
  viewer.draw(0);
  const data = new Uint8Array(4 * w * h);
  gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, data);
  let inked = 0;
  for (let i = 0; i < data.length; i += 4) if (data[i] + data[i + 1] + data[i + 2] < 600) inked += 1;
  return inked / (w * h);
}}"""
"""Share of the picture's pixels that are no paper."""

WITHOUT_WEBGL = """
  const canvas = HTMLCanvasElement.prototype, get = canvas.getContext;
  canvas.getContext = function (kind, ...rest) {
    return kind === "webgl2" ? null : get.call(this, kind, ...rest);
  };
"""


def test_a_path_is_played_without_a_server(opened, page_file):
    watched = opened(page_file.as_uri())
    page = watched.page
    page.wait_for_function(f"{VIEWER} && {VIEWER}.drawn > 0")
    assert not page.locator("img").first.is_visible()
    assert page.evaluate(f"{VIEWER}.fault") is None  # WebGL draws
    inked = page.evaluate(INKED)
    assert 0.005 < inked < 0.5
    last = page.evaluate(f"{VIEWER}.scene.nFrames") - 1
    assert last > 3
    page.get_by_role("slider").first.fill("0")
    assert page.evaluate(f"{VIEWER}.frame") == 0
    page.get_by_role("button", name="Play").first.click()
    page.wait_for_function(f"{VIEWER}.frame > 0.5")
    page.wait_for_function(f"{VIEWER}.frame === {last} && !{VIEWER}.playing")
    assert watched.requests == [page_file.as_uri()]
    watched.picture("viewer")


def test_modes_swing_and_the_reader_may_ask_for_stillness(opened, page_file):
    page = opened(page_file.as_uri()).page
    page.wait_for_function(f"{VIEWER} && {VIEWER}.drawn > 0")
    names = page.evaluate(f"{VIEWER}.scene.modes.map((mode) => mode.name)")
    assert names[0].startswith("mode 1: ")
    page.get_by_label("Mode", exact=True).first.select_option("0")
    drawn = page.evaluate(f"{VIEWER}.drawn")
    page.wait_for_function(f"{VIEWER}.drawn > {drawn} + 3")
    still = opened(page_file.as_uri(), reduced_motion="reduce").page
    still.wait_for_function(f"{VIEWER} && {VIEWER}.drawn > 0")
    still.get_by_label("Mode", exact=True).first.select_option("0")
    assert still.evaluate(f"{VIEWER}.playing") is False


def test_the_page_s_reactions_are_those_of_the_solver(opened, page_file):
    page = opened(page_file.as_uri()).page
    page.wait_for_function(f"{VIEWER} && {VIEWER}.drawn > 0")
    shown = page.evaluate(f"Array.from({VIEWER}.state.reactions)")
    path = solve_path(library.paper_beam(), {"A14": 0.1, "A23": 0.1})
    # The page computes in float32 tensions: six digits of the largest force.
    assert shown == pytest.approx(path.final.reactions.ravel().tolist(), abs=1e-4)


def test_without_scripts_a_still_picture_is_shown(opened, page_file):
    page = opened(page_file.as_uri(), java_script_enabled=False).page
    assert page.locator("img").count() == 2
    assert page.locator("canvas").count() == 0


def test_without_webgl_lines_are_drawn(opened, page_file):
    watched = opened("about:blank")
    page = watched.page
    page.add_init_script(WITHOUT_WEBGL)
    page.goto(page_file.as_uri())
    page.wait_for_function(f"{VIEWER} && {VIEWER}.drawn > 0")
    assert page.locator(".still svg path").count() > 48
    assert "drawn as lines" in page.locator(".tv-told").first.text_content()
