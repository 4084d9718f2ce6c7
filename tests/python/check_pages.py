"""Opens the reports of all studies in a browser, as their reader does: from the disk, without a server.

    python3 check_pages.py WHEELEG FOLDER AXE

Each is made by the program, with as little work as it lets one ask for. At three sizes, light and dark: the verdict comes
first, nothing is wider than the window, nothing is asked for from elsewhere, the console is empty, axe-core finds nothing,
and the first column of a table that scrolls stays. The main figure stands before all tables; axes have a name and a unit. Figures have a legend with values, and those over the same abscissa share a cursor.
Without scripts, and on paper, verdict, tables and pictures are there. Screenshots go to FOLDER.
"""

import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import check_report
from check_report import FLAGS, LARGEST_BYTES, cursors, expect, looks, opened, problems
from playwright.sync_api import sync_playwright

STUDIES = {
    "compare": ["compare", "--axis", "bench-vq110u", "--quick", "--combinations", "2"],
    "delay": ["delay", "--seeds", "1"],
    "tune": ["tune", "bench-vq110u"],
    "faults": ["faults", "run", "--row", "pot-open", "--row", "ui-link-lost", "--row", "valve-slow"],
    "figures": ["figures"],
    "field": ["field", "sand-flat", "rocks-20", "--seeds", "2"],
}
# A table of verdicts.
WITHOUT_FIGURES = {"faults"}


def made(program, name, folder):
    """The report of a study."""
    begin = time.monotonic()
    out = folder / name
    done = subprocess.run([program, *STUDIES[name], "--out", str(out)], capture_output=True, text=True)
    # 1: a target is missed, which is a result as well.
    expect(done.returncode in (0, 1), f"{name}: {done.stderr}")
    print(f"{name}: {time.monotonic() - begin:.0f} s", flush=True)
    return out / "report.html"


def figures(browser, report, name):
    page = opened(browser, report, 1280, 720, "light")
    areas = page.locator(".plot-area")
    expect(areas.count() > 0, f"{name}: no figure is drawn")
    area = areas.first
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + box["height"] / 2)
    moved = page.evaluate("() => [...document.querySelectorAll('.plot')].filter((p) => [...p.querySelectorAll('.legend b')].some((b) => b.textContent !== '–')).length")
    expect(moved > 0, f"{name}: no legend tells a value at the cursor: {cursors(page)[:5]}")
    bare = page.evaluate("() => [...document.querySelectorAll('.plot')].filter((p) => p.querySelectorAll('.key').length === 0).map((p) => p.querySelector('h3, h4').textContent)")
    expect(bare == [] or all(bare), f"{name}: panels without a legend: {bare}")
    unnamed = page.evaluate("""() => [...document.querySelectorAll('.fig script[type="application/json"]')].map((data) => JSON.parse(data.textContent))
        .filter((panel) => !(/\\[.+\\]$/.test(panel.x_label) || panel.x_label === 'seed') || panel.unit === '').map((panel) => `${panel.title}: ${panel.x_label}, ${panel.unit}`)""")
    expect(not unnamed, f"{name}: axes without name or unit: {unnamed}")
    first = page.evaluate("() => [...document.querySelectorAll('main figure, main table')][0].tagName")
    expect(first == "FIGURE", f"{name}: a {first} comes before the main figure")
    page.context.close()


def small(browser, report, name):
    """On a small screen the letters of a picture stay readable, and no cell lies on the next one."""
    page = opened(browser, report, 400, 800, "light")
    page.wait_for_load_state("load")
    page.evaluate("() => document.querySelectorAll('details').forEach((d) => (d.open = true))")
    shrunk = page.evaluate("""() => [...document.querySelectorAll('.still svg')].filter((one) => one.checkVisibility())
        .map((one) => (11 * one.getBoundingClientRect().width) / 940).filter((px) => px < 9)""")
    expect(not shrunk, f"{name}: letters of {shrunk} px in pictures")
    over = page.evaluate("""() => [...document.querySelectorAll('.scroll td')].filter((one) => one.checkVisibility() && one.scrollWidth > one.clientWidth + 1)
        .map((one) => one.textContent)""")
    expect(not over, f"{name}: cells that lie on the next one: {over[:3]}")
    page.context.close()


def tables(browser, report, name):
    """What a row is of stays in sight when its table scrolls."""
    page = opened(browser, report, 400, 800, "light")
    page.evaluate("() => document.querySelectorAll('details').forEach((d) => (d.open = true))")
    lost = page.evaluate("""() => [...document.querySelectorAll('.scroll')].filter((box) => {
        const cell = box.querySelector('tbody tr > :first-child');
        if (!cell || box.scrollWidth <= box.clientWidth + 8) return false;
        box.scrollLeft = box.scrollWidth;
        const gone = cell.getBoundingClientRect().right < box.getBoundingClientRect().left + 8;
        box.scrollLeft = 0;
        return gone;
    }).map((box) => box.querySelector('th').textContent)""")
    expect(not lost, f"{name}: the first column scrolls away: {lost}")
    first = page.evaluate("() => { const head = document.querySelector('header').firstElementChild; return [head.tagName, head.textContent]; }")
    expect(first[0] == "H1" and first[1].rstrip().endswith("."), f"{name}: no verdict stands above the title, but {first}")
    words = page.inner_text("main")
    expect(not re.search(r"(^|\D)1 axes", words) and "≤ –" not in words, f"{name}: a count or a bound without sense")
    page.context.close()


def without_scripts(browser, report, name):
    page = opened(browser, report, 1280, 720, "light", java_script_enabled=False)
    expect(page.locator("h1").is_visible(), f"{name}: without scripts no verdict")
    expect(name in WITHOUT_FIGURES or page.locator(".still svg").first.is_visible(), f"{name}: without scripts no picture")
    expect(page.locator("table").count() > 0, f"{name}: without scripts no table")
    page.context.close()


def on_paper(browser, report, name, folder):
    page = opened(browser, report, 1280, 720, "light")
    page.wait_for_load_state("load")
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    hidden = page.evaluate("() => [...document.querySelectorAll('.fig .still svg')].filter((one) => !one.checkVisibility()).length")
    folded = page.evaluate("() => [...document.querySelectorAll('details')].filter((one) => !one.open).length")
    expect(hidden == 0 and folded == 0, f"{name}: on paper {hidden} pictures and {folded} folded tables are missing")
    page.pdf(path=folder / f"{name}.pdf", format="A4")
    page.context.close()


def main(program, folder, axe):
    folder = Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    sizes = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        for name in STUDIES:
            report = made(program, name, folder).resolve()
            size = report.stat().st_size
            sizes.append(size)
            expect(size <= LARGEST_BYTES, f"{name}: {size} bytes, more than {LARGEST_BYTES}")
            shots = folder / f"{name}-shots"
            shots.mkdir()
            heard = len(problems)
            looks(browser, report, shots, axe, "main" if name in WITHOUT_FIGURES else ".plot-area canvas")
            problems[heard:] = [f"{name}: {problem}" for problem in problems[heard:]]
            if name not in WITHOUT_FIGURES:
                figures(browser, report, name)
            tables(browser, report, name)
            small(browser, report, name)
            without_scripts(browser, report, name)
            on_paper(browser, report, name, folder)
        browser.close()
    if problems:
        sys.exit("\n".join(problems))
    print(f"{len(sizes)} reports, {max(sizes)} bytes at most, sound at {len(check_report.SIZES)} sizes; pictures in {folder}")


if __name__ == "__main__":
    main(*sys.argv[1:])
