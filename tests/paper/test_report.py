"""The report: whole, offline, escaped, folded, linked, and every number in it."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import math
import re
from html.parser import HTMLParser
from typing import Any

import pytest

from skyarm.paper.published import TITLES
from skyarm.paper.report_pages import (
    MAIN,
    bound_text,
    difference_text,
    number_cell,
    page_script,
    report_pages,
    sensitivity_tables,
    typographic,
)
from skyarm.paper.variations import GROUPS, variations
from skyarm.view.pages import image
from support.logs import CASES, all_logs, synthetic_log

VOID = {"meta", "link", "img", "br", "hr", "input", "col"}
LOADS = (
    "src",
    "href",
    "srcset",
    "data",
    "action",
    "poster",
    "background",
    "xlink:href",
    "formaction",
    "manifest",
)


class Page(HTMLParser):
    """Reads a page; keeps what the tests ask about and refuses unbalanced elements."""

    def __init__(self, source: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self.values: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.scripts: dict[str, str] = {}
        self._script = ""
        self.styles = ""
        self.feed(source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        held = dict(attrs)
        assert len(held) == len(attrs), f"repeated attribute in {tag}"
        self.tags.append((tag, held))
        self.addresses += [str(held[name]) for name in LOADS if name in held]
        self.styles += str(held.get("style", ""))
        if held.get("id"):
            self.ids.append(str(held["id"]))
        if tag == "data":
            self.values.append(str(held["value"]))
        if tag == "script":
            self._script = str(held.get("id", ""))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert tag not in VOID
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        inside = self.open[-1] if self.open else ""
        if inside == "script":
            self.scripts[self._script] = self.scripts.get(self._script, "") + data
        elif inside == "style":
            self.styles += data
        else:
            self.text += data


def some_results() -> dict[str, Any]:
    """Distinct numbers in every cell; one missing, one not finite, one unpublished."""
    names = (
        "position_error_mean",
        "pitch_rms",
        "hover_offset",
        "settling_time_upper_bound",
        "invented_metric",
    )
    experiments: dict[str, Any] = {}
    count = 0
    for case in CASES:
        experiments[case] = {}
        for controller in ("CT", "PD"):
            cells = experiments[case][controller] = {}
            for name in (*names, *(f"{name}_continuous" for name in names[:2])):
                count += 1
                ours = 0.0001234567 * count
                cells[name] = {
                    "paper": 0.001 * count,
                    "rigid_body": ours,
                    "mujoco": ours + 1e-9,
                }
    experiments["case1"]["CT"]["pitch_rms"]["mujoco"] = None
    experiments["case1"]["PD"]["pitch_rms"]["rigid_body"] = float("nan")
    experiments["case2"]["CT"]["hover_offset"]["paper"] = None
    settings = {
        "rates_hz": {"control": 200},
        "note": "<b>&\"'",
        "empty": None,
        "windows": [10.0, 20.0],
    }
    return {"schema": 1, "experiments": experiments, "settings": settings}


def some_sensitivity() -> dict[str, Any]:
    cells = {
        "case2": {
            "CT": {"pitch_rms": 0.0111222, "tau1_rms": None},
            "PD": {"pitch_rms": 0.0333444},
        }
    }
    other = {
        "case2": {
            "CT": {"pitch_rms": 0.0555666, "tau1_rms": 0.7},
            "PD": {"pitch_rms": float("nan")},
        }
    }
    ramps = {
        "linear": {"case1": {"CT": {"position_error_mean": 0.0777888}}},
        "quintic": {},
    }
    return {
        "joint_damping": {"0": cells, "0.001": other, "0.05": {}},
        "ramp_shape": ramps,
        "moon_phase": {"full": cells},
    }


PICTURE = image(
    "a path & an error", "a path & an error", b"\x89PNG", kind="single opening"
)


PNG = b"\x89PNG"

REDRAWN = {f"figure_{number:02d}": PNG for number in (3, 4, 5)}
"""Pictures of the paper's figures of Case 1."""

FLIGHTS = {f"{case}_{kind}": PNG for case in CASES for kind in ("tracking", "tip")} | {
    "case3_path": PNG
}


@pytest.fixture(scope="module")
def sources() -> dict[str, str]:
    drawn = {**REDRAWN, **FLIGHTS}
    return report_pages(
        some_results(), some_sensitivity(), all_logs(), drawn, opening=PICTURE
    )


@pytest.fixture(scope="module")
def source(sources: dict[str, str]) -> str:
    """All pages in a row."""
    return "".join(sources.values())


@pytest.fixture(scope="module")
def pages(sources: dict[str, str]) -> dict[str, Page]:
    return {name: Page(text) for name, text in sources.items()}


@pytest.fixture(params=[MAIN, *(f"{case}.html" for case in CASES)])
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def page(pages: dict[str, Page], name: str) -> Page:
    """Each page in turn."""
    return pages[name]


@pytest.fixture(scope="module")
def main(pages: dict[str, Page]) -> Page:
    return pages[MAIN]


def whole(*given: Any) -> Page:
    """All pages of a report, read as one: the first, then what stands in the others."""
    read = [Page(text) for text in report_pages(*given).values()]
    for other in read[1:]:
        for each in ("tags", "addresses", "values"):
            getattr(read[0], each).extend(getattr(other, each))
        read[0].text += other.text
    return read[0]


def test_there_is_a_page_for_each_case_and_one_that_leads_to_them(
    sources: dict[str, str],
) -> None:
    assert list(sources) == [MAIN, *(f"{case}.html" for case in CASES)]


def test_page_is_balanced_html_with_the_landmarks(
    sources: dict[str, str], name: str, page: Page
) -> None:
    assert sources[name].startswith("<!DOCTYPE html>")
    tags = [tag for tag, _ in page.tags]
    assert all(
        tags.count(each) == 1
        for each in ("html", "head", "body", "main", "header", "h1", "title")
    )
    assert [held["aria-label"] for tag, held in page.tags if tag == "nav"] == [
        "Pages",
        "Contents",
    ]
    assert len(page.ids) == len(set(page.ids))
    assert dict(page.tags[0][1])["lang"] == "en"


def test_contents_lead_to_sections_that_exist(name: str, page: Page) -> None:
    targets = [address[1:] for address in page.addresses if address.startswith("#")]
    assert len(targets) >= (4 if name == MAIN else 2)
    assert set(targets) <= set(page.ids)
    labels = [held["aria-labelledby"] for tag, held in page.tags if tag == "section"]
    assert len(labels) == len(targets) - 1  # and a link that skips to the content
    assert set(labels) <= set(page.ids)


def test_every_page_links_every_other_and_no_link_is_dead(
    pages: dict[str, Page], name: str, page: Page
) -> None:
    linked = {
        address for address in page.addresses if not address.startswith(("#", "data:"))
    }
    assert linked == set(pages) - {name}
    assert [
        held["aria-current"] for _, held in page.tags if "aria-current" in held
    ] == ["page"]


def test_details_are_folded_and_what_comes_first_is_not(
    sources: dict[str, str], name: str, page: Page
) -> None:
    assert not any("open" in held for tag, held in page.tags if tag == "details")
    assert (sum(tag == "details" for tag, _ in page.tags) >= 4) == (name == MAIN)
    unfolded = re.sub(
        r"<details>.*?</details>",
        "",
        re.sub(r"<script.*?</script>", "", sources[name], flags=re.DOTALL),
        flags=re.DOTALL,
    )
    while "<details>" in unfolded:
        unfolded = re.sub(
            r"<details>(?:(?!<details>).)*?</details>", "", unfolded, flags=re.DOTALL
        )
    # a row takes 27 px or two lines of 44: what is open fits into some screens of 800
    assert unfolded.count("<tr") < 40
    body = unfolded[unfolded.index("<body") :]
    first = body.index("<figure")
    # the overview opens with its verdict and the table behind it, the page of a case
    # with its flights
    shown = (
        (body.index("<table"), first) if name == MAIN else (first, body.index("<table"))
    )
    assert body.index("<h1") < shown[0] < shown[1]


def test_nothing_is_wider_than_a_telephone_but_in_a_box_of_its_own(
    sources: dict[str, str], page: Page
) -> None:
    boxes = [
        held for tag, held in page.tags if tag == "div" and held.get("class") == "table"
    ]
    assert len(boxes) == sum(tag == "table" for tag, _ in page.tags)
    assert all(held.get("tabindex") == "0" for held in boxes), "scrolled by keys, too"
    assert ".table { overflow-x: auto;" in page.styles
    assert not any(
        name in held for _, held in page.tags for name in ("width", "style", "nowrap")
    )
    widths = re.findall(r"(?<![-\w])(?:min-)?width: ([\d.]+)rem", page.styles)
    assert [width for width in widths if float(width) > 21.0] == ["40"], (
        "of pictures in a box that scrolls"
    )
    assert ".single { overflow-x: auto; } .single img { width: 40rem;" in page.styles
    assert re.search(r"(?:^|} )img { max-width: 100%;", page.styles, re.MULTILINE), (
        "of every other picture"
    )


def test_a_printed_page_has_no_folds_and_clips_nothing(page: Page) -> None:
    printed = page.styles[page.styles.index("@media print") :]
    assert (
        "details::details-content { display: block; content-visibility: visible;"
        in printed
    )
    assert ".table { overflow: visible;" in printed
    assert "@page { size: A4;" in printed
    assert 'addEventListener("beforeprint"' in page.scripts[""]


def test_the_report_opens_with_its_verdict_and_a_picture(
    main: Page, sources: dict[str, str]
) -> None:
    source = sources[MAIN]
    order = (
        'class="lead"',
        '<table class="summary"',
        'class="single opening"',
        '<nav aria-label="Contents"',
    )
    places = [source.index(each) for each in order]
    assert places == sorted(places)
    assert source.count('class="lead"') == 3
    assert main.text.count("a path & an error") == 1
    assert 'alt="a path &amp; an error"' in source


def test_one_word_stands_for_the_tip(source: str) -> None:
    text = re.sub(r"<script.*?</script>", "", source, flags=re.DOTALL)
    assert "Mean tip error" in text
    assert not re.search(r"end[- ]effector|\btool\b|\bEE\b", text, re.IGNORECASE)


def test_nothing_is_loaded_from_a_network(page: Page) -> None:
    assert page.addresses
    local = re.compile(r"#|data:image/png;base64,|[a-z0-9_]+\.html$")
    assert all(local.match(address) for address in page.addresses)
    assert not re.search(r"@import|url\(", page.styles)
    assert not any(
        tag in ("link", "iframe", "object", "embed", "base", "form")
        for tag, _ in page.tags
    )


def test_the_browser_itself_is_told_to_refuse_the_network(page: Page) -> None:
    (policy,) = [
        held["content"]
        for tag, held in page.tags
        if held.get("http-equiv") == "Content-Security-Policy"
    ]
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy


def test_the_browser_runs_the_page_s_own_script_and_no_other(
    source: str, page: Page
) -> None:
    own = page.scripts[""]
    assert own == page_script()
    (policy,) = [
        str(held["content"])
        for _, held in page.tags
        if held.get("http-equiv") == "Content-Security-Policy"
    ]
    digest = base64.b64encode(hashlib.sha256(own.encode()).digest()).decode()
    assert re.findall(r"script-src ([^;]*)", policy) == [f"'sha256-{digest}'"]
    assert "\r" not in source, (
        "a browser reads line ends as \\n before it takes the digest"
    )


def test_text_carries_no_address(sources: dict[str, str], name: str) -> None:
    assert re.findall(r"https?://[^\"'\s<]*", sources[name]) == []


def test_every_number_of_the_results_appears_on_the_page_of_its_case(
    pages: dict[str, Page],
) -> None:
    for case, controllers in some_results()["experiments"].items():
        written = set(pages[f"{case}.html"].values)
        for cells in controllers.values():
            for cell in (
                cell
                for metric, cell in cells.items()
                if not metric.endswith("_continuous")
            ):
                for value in cell.values():
                    assert value is None or math.isnan(value) or repr(value) in written


def test_every_number_of_the_sensitivity_appears(main: Page) -> None:
    assert {"0.0111222", "0.0333444", "0.0555666", "0.7", "0.0777888"} <= set(
        main.values
    )


def test_missing_and_not_finite_numbers_are_dashes(page: Page) -> None:
    assert (
        number_cell(float("nan"))
        == number_cell(None)
        == number_cell(float("inf"))
        == "\N{EN DASH}"
    )
    assert not any(value in ("nan", "inf", "None") for value in page.values)
    assert not re.search(r"\b(nan|NaN|None|inf)\b", page.text)


def test_text_from_outside_is_escaped(source: str, pages: dict[str, Page]) -> None:
    assert "<b>" not in re.sub(r"<script.*?</script>", "", source, flags=re.DOTALL)
    assert "<b>&\"'" in pages[MAIN].text


def test_hostile_names_do_not_become_markup() -> None:
    evil = '"><img src="http://x"><script>'
    cells = {evil: {"paper": 1.0, "rigid_body": 2.0, "mujoco": 3.0}}
    results = {
        "schema": 1,
        "experiments": {evil: {evil: cells}},
        "settings": {evil: evil},
    }
    sensitivity = {evil: {evil: {evil: {evil: {evil: 1.0}}}}}
    logs = {evil: {evil: {evil: synthetic_log("case1", evil, evil, seconds=0.5)}}}
    read = whole(results, sensitivity, logs)
    addresses = (
        r"#[\w-]+|report\.html|_img_src_http_x_script_\.html|data:image/png;base64,.*"
    )
    assert all(re.fullmatch(addresses, each) for each in read.addresses)


def test_empty_inputs_make_a_whole_page() -> None:
    read = whole({"schema": 1, "experiments": {}, "settings": {}}, {}, {})
    assert "No variation was flown." in read.text


def test_a_plant_that_was_not_flown_is_dashes_not_an_error() -> None:
    results = some_results()
    for controllers in results["experiments"].values():
        for cells in controllers.values():
            for cell in cells.values():
                del cell["mujoco"]
    logs = {"rigid_body": all_logs()["rigid_body"]}
    read = Page(report_pages(results, {}, logs)[MAIN])
    assert "mujoco: " not in read.text.split("Every count")[0]


def test_static_figures_stand_with_their_case_and_have_alternative_text(
    pages: dict[str, Page],
) -> None:
    images = {
        name: [
            str(held["alt"]).split(".")[0] for tag, held in page.tags if tag == "img"
        ]
        for name, page in pages.items()
    }
    assert images.pop("case1.html")[2:] == ["Figure 3", "Figure 4", "Figure 5"]
    assert images.pop(MAIN) == ["a path & an error"]
    assert images.pop("case3.html")[2].endswith(
        "path of the tip, desired and flown, on rigid_body"
    )
    assert all(len(each) == 2 for each in images.values())


def test_every_figure_says_what_it_shows(page: Page) -> None:
    assert (
        [tag for tag, _ in page.tags].count("figure")
        == [tag for tag, _ in page.tags].count("figcaption")
        > 0
    )
    for tag, held in page.tags:
        assert tag != "img" or str(held["alt"]) in page.text, "the caption says it, too"


def test_the_caption_of_flights_names_their_case_and_what_is_drawn(
    pages: dict[str, Page],
) -> None:
    for case in CASES:
        found = next(
            str(held["alt"]) for tag, held in pages[f"{case}.html"].tags if tag == "img"
        )
        assert (
            found
            == f"{TITLES[case]}: base and joints, desired and flown, on rigid_body."
        )


def test_tables_have_captions_and_scoped_headings(page: Page) -> None:
    tags = [tag for tag, _ in page.tags]
    assert tags.count("table") == tags.count("caption") == tags.count("thead")
    assert all(
        held.get("scope") in ("col", "row", "rowgroup")
        for tag, held in page.tags
        if tag == "th"
    )


def test_page_stays_small(sources: dict[str, str]) -> None:
    assert all(len(source.encode()) < 1_000_000 for source in sources.values())


def test_difference_is_relative_and_signed() -> None:
    space = "\N{NO-BREAK SPACE}"
    assert difference_text(1.04, 1.0) == f"+4{space}%"
    assert difference_text(0.88, 1.0) == f"\N{MINUS SIGN}12{space}%"
    assert difference_text(2.0, 1.0) == f"+100{space}%"
    assert difference_text(-0.14, -0.28) == f"\N{MINUS SIGN}50{space}%"
    assert difference_text(-0.339, -0.32) == f"+6{space}%"
    assert {difference_text(each, 1.0) for each in (0.999999, 1.000001)} == {
        f"0{space}%"
    }
    assert difference_text(1.0, 0.0) == "\N{EN DASH}"


def test_a_bound_is_met_below_and_missed_above() -> None:
    assert [bound_text(ours, 10) for ours in (3.0, 11.0, None)] == [
        "below",
        "above",
        "\N{EN DASH}",
    ]


def test_numbers_have_three_significant_digits_and_a_typographic_minus() -> None:
    assert (
        number_cell(0.00001).text == typographic("1.00e-05") == "1.00e\N{MINUS SIGN}05"
    )
    assert [number_cell(value).text for value in (0.0, -0.28, 123.4)] == [
        "0",
        "\N{MINUS SIGN}0.280",
        "123",
    ]


def test_published_numbers_keep_their_printed_digits() -> None:
    cells = {
        "position_error_mean": {"paper": 0.04, "rigid_body": 0.0349, "mujoco": 0.0349}
    }
    cells["pitch_rms"] = {"paper": 0.5, "rigid_body": 0.4, "mujoco": 0.4}
    results = {"schema": 1, "experiments": {"case1": {"CT": cells}}, "settings": {}}
    page = report_pages(results, {}, {})["case1.html"]
    assert '<data value="0.04">0.040</data>' in page
    assert '<data value="0.5">0.500</data>' in page, (
        "a number that is not the printed one is not shown as if it were"
    )


def test_captions_name_the_plant_that_flew() -> None:
    results = some_results()
    for controllers in results["experiments"].values():
        for cells in controllers.values():
            for cell in cells.values():
                cell["rigid_body"] = None
    logs = {"mujoco": all_logs()["mujoco"]}
    read = whole(results, some_sensitivity(), logs, REDRAWN)
    assert "Layout of the paper, mujoco plant" in read.text
    assert "Joint damping [N m s/rad], mujoco; bold" in read.text


def test_the_order_of_the_plants_decides_which_is_first() -> None:
    results = some_results()
    results["settings"]["plants"] = ["mujoco", "rigid_body"]
    assert (
        "Joint damping [N m s/rad], mujoco; bold"
        in report_pages(results, some_sensitivity(), {})[MAIN]
    )


def test_every_group_of_variations_has_a_title() -> None:
    assert {each.group for each in variations()} == set(GROUPS)


def test_an_episode_that_ended_early_is_named() -> None:
    log = synthetic_log("case1", "rigid_body", "PD", seconds=3.0)
    ended = {
        **log.info,
        "status": "joint_limit",
        "cause": "joint 2 < limit",
        "end_time": 3.0,
    }
    logs = {"rigid_body": {"case1": {"PD": dataclasses.replace(log, info=ended)}}}
    read = Page(report_pages(some_results(), {}, logs)[MAIN])
    assert "1 of 1 episodes ended early" in read.text
    assert "joint_limit at 3 s, joint 2 < limit" in read.text


def test_an_episode_that_came_to_its_end_far_from_its_reference_is_named() -> None:
    log = synthetic_log("case1", "rigid_body", "PD", seconds=3.0)
    away = dataclasses.replace(log, position=log.position + 7.0)
    logs = {"rigid_body": {"case1": {"PD": away, "CT": log}}}
    read = Page(report_pages(some_results(), {}, logs)[MAIN])
    assert "All 2 episodes flew to their end." in read.text
    assert "They lacked:" in read.text
    assert (
        "PD: not reached: reference of the base, 12.1 m off in the mean from 1 s on"
        in read.text
    )
    assert "CT: not reached" not in read.text


def test_the_variant_nearest_to_the_paper_is_bold(source: str) -> None:
    """Case 2, CT, pitch RMS: the paper's 0.016 lies nearer to 0.0111 than to 0.0556; a
    single variant is never bold.
    """
    assert re.findall(r"<strong>([0-9.]+)</strong>", source) == ["0.0111"]


@pytest.mark.parametrize(("farther", "bold"), [(1.0199, []), (1.0201, ["1.00"])])
def test_variants_within_two_percent_of_each_other_are_all_as_near(
    farther: float, bold: list[str]
) -> None:
    variants = {
        name: {"case2": {"CT": {"pitch_rms": value}}}
        for name, value in (("a", 1.0), ("b", farther))
    }
    paper = {"case2": {"CT": {"pitch_rms": {"paper": 1.0}}}}
    found = sensitivity_tables({"ramp_shape": variants}, paper, "rigid_body")
    assert re.findall(r"<strong>([0-9.]+)</strong>", found) == bold
