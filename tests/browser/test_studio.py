"""The studio's page as a person uses it: drag, read, take back, copy, search, edit, save."""

import json
import re
from urllib.parse import urlsplit

import pytest

from tensegra.mechanics import solve_path
from tensegra.structure import library, read_structure, write_structure

axe = pytest.importorskip("axe_playwright_python.sync_playwright")

STUDY = """
schema: tensegra/study/1
name: beam
structure: library:paper_beam
seed: 1
variables:
  A14: {actuator: A14, distribution: {uniform: [0.05, 0.10]}, label: actuation of the top cables}
  A23: {actuator: A23, distribution: {uniform: [0.05, 0.10]}, label: actuation of the bottom cables}
  T_top: {temperature: top, distribution: {uniform: [0, 150]}}
outputs:
  v: {displacement: y, nodes: [18, 23]}
  w: {displacement: z, nodes: [18, 23]}
design: {sampler: sobol, sizes: 64}
surrogates: {gpr: {kind: gpr}}
"""


NODE_18 = """() => {
  const { camera, state } = window.tensegra.viewer;
  return camera.project([...state.positions.slice(51, 54)]);
}"""
"""Where a node stands in the picture."""


@pytest.fixture(scope="module")
def runs(command_line, tmp_path_factory):
    """Return the folder of a small campaign with its surrogate."""
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "study.yaml").write_text(STUDY)
    command_line("run", str(folder / "study.yaml"), "-o", str(folder / "runs"))
    return folder / "runs"


def number(text):
    return float(re.match(r"[−\d.e]+", text).group().replace("−", "-"))


def slider(page, key):
    return page.locator(f"input[type=range][data-key='{key}']")


def set_number(page, key, value):
    field = page.locator(f"input[type=number][data-key='{key}']")
    field.fill(str(value))
    field.press("Enter")


def drag(page, key, share):
    """Drag a slider by the mouse, in many small moves, to a share of its way."""
    box = slider(page, key).bounding_box()
    middle = box["y"] + box["height"] / 2
    start = float(slider(page, key).evaluate("s => (s.value - s.min) / (s.max - s.min)"))
    page.mouse.move(box["x"] + 8 + (box["width"] - 16) * start, middle)
    page.mouse.down()
    for i in range(1, 31):
        page.mouse.move(box["x"] + 8 + (box["width"] - 16) * (start + (share - start) * i / 30), middle)
    page.mouse.up()


def watch(page, nodes):
    field = page.locator("#watch input[name=nodes]")
    field.fill(nodes)
    field.press("Enter")


def wait_for_state(page, values):
    """Wait until the structure stands where some knobs are."""
    page.wait_for_function(
        "values => Object.entries(values).every(([k, v]) => (window.tensegra.values || {})[k] === v)",
        arg=values,
    )


def wait_for_verdict(page, sign):
    """Wait until the page says whether the edited structure stands."""
    page.wait_for_function(
        "sign => document.querySelector('#editing [role=status]').textContent.startsWith(sign)", arg=sign
    )


def serious(page):
    """Return the serious faults that axe-core finds."""
    found = axe.Axe().run(page).response["violations"]
    return [
        (fault["id"], node["html"])
        for fault in found
        if fault["impact"] in {"serious", "critical"}
        for node in fault["nodes"]
    ]


def test_the_tip_moves_as_the_command_line_says(studio, beam_studio, command_line):
    watched = studio(beam_studio)
    page = watched.page
    watch(page, "18, 23")
    drag(page, "actuator:A14", 0.8)
    value = page.locator("input[type=number][data-key='actuator:A14']").input_value()
    assert float(value) > 0.05  # it was dragged
    set_number(page, "actuator:A23", 0.1)
    wait_for_state(page, {"actuator:A23": 0.1, "actuator:A14": float(value)})
    page.wait_for_timeout(200)
    shown = page.locator("#displacement").text_content()
    solved = json.loads(
        command_line("solve", "library:paper_beam", "-a", f"A14={value}", "-a", "A23=0.1", "--json")
    )
    moved = [solved["actuation"]["displacements"][node][2] for node in ("18", "23")]
    assert shown == f"{sum(moved) / 2:.6g} cm"
    assert "stable" in page.locator("#status-word").text_content()
    watched.picture("studio")
    assert watched.strangers(urlsplit(beam_studio).netloc) == []
    assert len(watched.requests) > 2


def test_a_drag_is_taken_back_as_one(studio, beam_studio):
    page = studio(beam_studio).page
    before = page.locator("#displacement").text_content()
    drag(page, "actuator:A14", 0.9)
    page.wait_for_function("() => document.getElementById('undo').disabled === false")
    page.get_by_role("button", name="Undo", exact=True).click()
    wait_for_state(page, {"actuator:A14": 0})
    page.wait_for_timeout(200)
    assert page.locator("#displacement").text_content() == before
    assert page.locator("#undo").is_disabled()


def test_pages_do_not_share_their_state(studio, beam_studio):
    first, second = studio(beam_studio).page, studio(beam_studio).page
    still = second.locator("#displacement").text_content()
    set_number(first, "actuator:A14", 0.1)
    wait_for_state(first, {"actuator:A14": 0.1})
    second.get_by_role("button", name="Reset").click()
    wait_for_state(second, {"actuator:A14": 0})
    assert second.locator("#displacement").text_content() == still
    assert first.evaluate("window.tensegra.values['actuator:A14']") == 0.1


def test_faults_are_told_and_nothing_moves(studio, beam_studio):
    page = studio(beam_studio).page
    set_number(page, "actuator:A14", 1.5)
    page.wait_for_function("() => !document.getElementById('fault').hidden")
    assert "rest length" in page.locator("#fault").text_content()
    assert page.evaluate("window.tensegra.values['actuator:A14']") == 0
    watch(page, "nowhere")
    page.wait_for_function("() => document.getElementById('fault').textContent.includes('nowhere')")


def test_keys_and_pointer_turn_and_pick(studio, beam_studio):
    page = studio(beam_studio).page
    canvas = page.locator("#viewer canvas").first
    canvas.focus()
    azimuth = page.evaluate("window.tensegra.viewer.camera.azimuth")
    canvas.press("ArrowLeft")
    assert page.evaluate("window.tensegra.viewer.camera.azimuth") != azimuth
    canvas.press(".")
    page.wait_for_function("() => document.querySelector('.tv-told').textContent !== ''")
    name = page.evaluate("window.tensegra.viewer.scene.members[0]")
    told = page.locator(".tv-told").text_content()
    assert told.startswith(f"{name}, ")
    assert "tension" in told
    canvas.press("Escape")
    # A click at a node's place in the picture finds the node.
    x, y, _ = page.evaluate(NODE_18)
    box = canvas.bounding_box()
    page.mouse.click(box["x"] + x, box["y"] + y)
    page.wait_for_function("() => document.querySelector('.tv-told').textContent.startsWith('node ')")


def test_pictures_are_saved(studio, beam_studio):
    page = studio(beam_studio).page
    with page.expect_download() as png:
        page.get_by_role("button", name="PNG").click()
    assert png.value.path().read_bytes().startswith(b"\x89PNG")
    with page.expect_download() as svg:
        page.get_by_role("button", name="SVG").click()
    text = svg.value.path().read_text()
    assert text.startswith("<svg")
    assert text.count("<path") >= 48  # a line for each member at least


def test_it_can_be_used_by_everyone(studio, beam_studio):
    for scheme in ("light", "dark"):
        watched = studio(beam_studio, color_scheme=scheme)
        assert serious(watched.page) == []
    watched.page.locator("#viewer select").first.select_option("tension")
    watched.page.wait_for_timeout(300)
    watched.picture("studio-dark")


def test_the_state_is_saved_and_read_again(studio, beam_studio, tmp_path):
    page = studio(beam_studio).page
    watch(page, "18, 23")
    set_number(page, "actuator:A14", 0.08)
    wait_for_state(page, {"actuator:A14": 0.08})
    page.get_by_role("button", name="Copy or save…").click()
    command = page.get_by_label("Command line", exact=True).input_value()
    assert command == "tensegra solve library:paper_beam -a A14=0.08"
    with page.expect_download() as saved:
        page.get_by_role("button", name="Save it as it stands").click()
    file = tmp_path / "standing.yaml"
    saved.value.save_as(file)
    again = solve_path(read_structure(file))
    expected = solve_path(library.paper_beam(), {"A14": 0.08})
    tip = library.paper_beam().node_ids.index("18")
    assert again.final.nodes[tip] == pytest.approx(expected.final.nodes[tip], rel=1e-8)


def test_the_report_of_a_campaign_holds_viewers(opened, command_line, runs):
    command_line("report", str(runs), "-o", str(runs / "report.html"))
    watched = opened((runs / "report.html").as_uri())
    page = watched.page
    figure = page.locator("#figure-1")
    figure.scroll_into_view_if_needed()
    page.wait_for_function("document.querySelector('#figure-1 canvas') !== null")
    assert not figure.locator("img").is_visible()
    assert page.locator("#figure-3 img").is_visible()  # a plot stays a picture
    assert serious(page) == []
    assert watched.requests == [(runs / "report.html").as_uri()]


def test_a_campaign_predicts_and_is_searched(studio, running, runs):
    with running(str(runs)) as address:
        watched = studio(address)
        page = watched.page
        page.wait_for_selector("#campaign .bar")
        row = page.locator("#campaign tbody tr").last
        true, predicted = (row.locator("td").nth(i).text_content() for i in range(2))
        assert number(true) == pytest.approx(number(predicted), rel=1e-2)
        assert "±" in predicted
        page.get_by_role("button", name="Largest").click()
        page.get_by_role("button", name="Go there").click()
        page.wait_for_function(
            "() => ['A14', 'A23'].every((name) => window.tensegra.values[name] > 0.0999999)"
        )
        page.wait_for_timeout(300)
        best = solve_path(library.paper_beam(), {"A14": 0.1, "A23": 0.1}, {"top": 75.0})
        shown = number(page.locator("#campaign tbody tr").last.locator("td").first.text_content())
        assert shown == pytest.approx(best.displacement("z", nodes=[18, 23]), rel=1e-5)
        assert serious(page) == []
        page.get_by_label("Limit").fill("52")
        page.keyboard.press("Tab")
        page.wait_for_timeout(500)
        page.locator("#campaign").scroll_into_view_if_needed()
        watched.picture("studio-campaign")
        assert watched.strangers(urlsplit(address).netloc) == []


def test_a_tower_is_edited_until_it_stands(studio, command_line, running, tmp_path):
    write_structure(library.tower(n_stages=1, n_struts=4), tmp_path / "tower.yaml")
    with running(str(tmp_path / "tower.yaml")) as address:
        watched = studio(address)
        page = watched.page
        page.get_by_text("Edit the structure").click()
        verdict = page.locator("#editing [role=status]")
        wait_for_verdict(page, "✓")
        page.get_by_label("Member to remove").select_option("v0_0")
        page.get_by_role("button", name="Remove").click()
        wait_for_verdict(page, "✗")
        assert "does not stand" in page.locator("#status").text_content()  # nothing is left of what stood
        assert page.locator("#facts dd").count() == 0
        watched.picture("studio-edit")
        form = page.locator("#editing form", has_text="New member")
        form.get_by_label("Name").fill("again")
        removed = library.tower(n_stages=1, n_struts=4).members["v0_0"]
        form.get_by_label("Nodes in order").fill(" ".join(removed.nodes))
        form.get_by_label("Material and area of").select_option("v0_1")
        form.get_by_label("Prestrain").fill("0.005")
        form.get_by_role("button", name="Add").click()
        wait_for_verdict(page, "✓")
        assert "self-stress: 1" in verdict.text_content()
        page.get_by_role("button", name="Copy or save…").click()
        with page.expect_download() as saved:
            page.get_by_role("button", name="Save the structure").click()
        saved.value.save_as(tmp_path / "edited.yaml")
        checked = json.loads(command_line("check", str(tmp_path / "edited.yaml"), "--json"))
        assert checked["stands"]
        assert "again" in checked["members"]
