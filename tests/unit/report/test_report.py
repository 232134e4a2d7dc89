import re
from base64 import b64decode
from html.parser import HTMLParser
from xml.etree import ElementTree as ET

import pytest

from tensegra.errors import StudyError
from tensegra.report.pipeline import carry_out
from tensegra.report.report import build_report, write_report
from tensegra.report.results import open_results
from tensegra.study import open_campaign

SVG = "{http://www.w3.org/2000/svg}"


class Page(HTMLParser):
    """What a test wants to know of a page."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.images, self.open = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        if tag not in {"meta", "img", "br"}:
            self.open.append(tag)
        if "id" in values:
            self.ids.append(values["id"])
        if tag == "a":
            self.links.append(values["href"])
        if tag == "img":
            self.images.append(values)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def report(results):
    return build_report(open_results(results.campaign))


@pytest.fixture(scope="module")
def page(results, tmp_path_factory):
    path = write_report(results.campaign, tmp_path_factory.mktemp("report") / "report.html")
    return path.read_text(encoding="utf-8")


def test_the_report_shows_every_figure_it_names(page):
    read = Page(page)
    assert not read.open
    assert len(read.ids) == len(set(read.ids))
    shown = {anchor for anchor in read.ids if not anchor.startswith("scene-")}
    assert {link.removeprefix("#") for link in read.links} == shown
    named = [link for link in read.links if link.startswith("#figure-")]
    assert len(named) == len(read.images) == len(re.findall("<figcaption>", page))
    for image in read.images:
        kind, _, content = image["src"].partition(",")
        assert kind == "data:image/svg+xml;base64"
        picture = ET.fromstring(b64decode(content))  # noqa: S314 - our own
        assert picture.tag == f"{SVG}svg"
        assert len(list(picture.iter(f"{SVG}path"))) > 10
        assert image["alt"]


def test_the_report_needs_nothing_else(page):
    assert not re.search(r"""(?:src|href)=["'](?!data:|#)""", page)
    assert "@import" not in page
    # Scripts stand in the page itself, and what they draw is beside them.
    scripts = re.findall("<script([^>]*)>", page)
    assert scripts.count(' type="module"') == 1
    scenes = [script for script in scripts if script.startswith(' type="application/json" id="scene-figure-')]
    assert len(scenes) == len(scripts) - 1 == page.count("data-tensegra-scene=")
    assert set(re.findall(r"https?://[^\s\"'`<)]+", page)) <= {"http://www.w3.org/2000/svg"}


def test_the_report_has_a_section_for_each_result(report):
    titles = [section.title for section in report.sections]
    assert titles == [
        "Structure",
        "Design",
        "Outcome",
        "Selection",
        "Surrogates",
        "Scatter",
        "Shares",
        "Lift",
        "Provenance",
    ]
    numbers = [figure.number for section in report.sections for figure in section.figures]
    assert numbers == list(range(1, len(numbers) + 1))
    for section in report.sections:
        for table in section.tables:
            assert {len(row) for row in table.rows} <= {len(table.header)}
            assert len(table.align) == len(table.header)


def test_the_same_results_give_the_same_page(report, page):
    assert report.html() == page


def test_sections_without_results_are_left_out(small_study, tmp_path):
    done = carry_out(small_study(surrogates={}, analyses=[]), tmp_path, workers=1)
    titles = [section.title for section in build_report(done).sections]
    assert titles == ["Structure", "Design", "Outcome", "Selection", "Provenance"]


def test_text_of_a_study_is_not_taken_for_html(small_study, tmp_path):
    study = small_study(surrogates={}, analyses=[], description="<script>alert(1)</script> & more")
    carry_out(study, tmp_path, workers=1)
    text = write_report(open_campaign(tmp_path)).read_text(encoding="utf-8")
    assert "<script>" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; more" in text


def test_a_report_that_cannot_be_written_is_refused(results, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StudyError, match="cannot be written"):
        write_report(results.campaign, tmp_path / "file" / "report.html")
