"""Opens the report of a run in a browser, as its reader does: from the disk, without a server.

    python3 check_report.py RUN_DIR AXE

At three sizes, light and dark: nothing is wider than the window, nothing is asked for from
elsewhere, the console is empty, axe-core finds nothing. Figures are drawn and share a cursor, a drag zooms all of them,
the robot plays. Without scripts verdict, tables and pictures are there. Screenshots go to
RUN_DIR/browser.
"""

import shutil
import sys
import time
from pathlib import Path

from accessible import findings
from playwright.sync_api import sync_playwright

LARGEST_BYTES = 3_000_000
SIZES = [(1280, 720), (1024, 768), (400, 800)]
FLAGS = ["--no-sandbox", "--use-angle=swiftshader"]

problems = []


def expect(holds, what):
    if not holds:
        problems.append(what)


def opened(browser, report, width, height, scheme, **options):
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=scheme, **options
    )
    page = context.new_page()
    name = f"{width} px, {scheme}"
    page.on("console", lambda message: problems.append(f"{name}: console: {message.text}"))
    page.on("pageerror", lambda error: problems.append(f"{name}: {error}"))
    page.on(
        "request",
        lambda request: expect(
            request.url == report.as_uri() or request.url.startswith("data:"),
            f"{name}: asks for {request.url}",
        ),
    )
    page.goto(report.as_uri())
    return page


def cursors(page):
    """Times at which the plots of the page's clock stand."""
    return page.eval_on_selector_all(
        ".plot-area", "areas => areas.map(area => Number(area.getAttribute('aria-valuenow')))"
    )


def play_a_moment(page):
    """Plays for 0.2 s of the run and pauses. A starved browser plays more slowly than the wall's clock, never faster."""
    before, begun = cursors(page)[0], time.monotonic()
    page.get_by_role("button", name="Play").click()
    while cursors(page)[0] <= before + 0.2 and time.monotonic() < begun + 20:
        page.wait_for_timeout(100)
    page.get_by_role("button", name="Pause").click()
    after, played = cursors(page)[0], time.monotonic() - begun
    expect(before + 0.2 < after <= before + played + 0.1, f"played for {played:.2f} s, {before} s became {after} s")


def looks(browser, report, folder, axe, shown=".plot-area canvas"):
    for width, height in SIZES:
        for scheme in ["light", "dark"]:
            page = opened(browser, report, width, height, scheme)
            name = f"{width}-{scheme}"
            page.wait_for_selector(shown)
            wide = page.evaluate("document.documentElement.scrollWidth")
            expect(wide <= width, f"{name}: {wide} px wide")
            verdict = page.locator("h1").bounding_box()
            expect(verdict and verdict["y"] < height / 2, f"{name}: the verdict does not come first")
            page.screenshot(path=folder / f"{name}.png")
            page.screenshot(path=folder / f"{name}-whole.png", full_page=True)
            if width == SIZES[0][0]:
                problems.extend(f"{name}: {finding}" for finding in findings(page, axe))
            page.context.close()


def journey(browser, report):
    page = opened(browser, report, 1280, 720, "light")
    robot = page.locator("#motion-view .view")
    expect(robot.is_visible(), "the robot is not shown")
    expect(page.locator("#motion-view .seg").count() > 0, "the phases of the gait are not shown")
    plot = page.locator(".plot-area").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)

    # One cursor over all plots.
    page.mouse.move(*middle)
    times = cursors(page)
    expect(len(times) > 5 and len(set(times)) == 1, f"cursors stand at {sorted(set(times))}")
    expect(3 < times[0] < 7, f"the cursor stands at {times[0]} s, not in the middle")

    # Zoom, and back.
    ticks = "canvas => canvas.toDataURL().length"
    canvas = page.locator(".plot-area canvas").nth(1)
    whole = canvas.evaluate(ticks)
    page.mouse.down()
    page.mouse.move(middle[0] + 100, middle[1], steps=5)
    page.mouse.up()
    zoomed = canvas.evaluate(ticks)
    expect(whole != zoomed, "a drag over one plot does not zoom another")
    page.mouse.dblclick(*middle)
    page.mouse.move(*middle)
    expect(canvas.evaluate(ticks) != zoomed, "a double click does not show everything again")

    # The keyboard.
    plot.focus()
    before = cursors(page)[0]
    page.keyboard.press("ArrowRight")
    expect(abs(cursors(page)[0] - before - 0.02) < 0.011, "an arrow key does not step by 20 ms")

    play_a_moment(page)
    page.context.close()


def without_scripts(browser, report):
    page = opened(browser, report, 1280, 720, "light", java_script_enabled=False)
    expect(page.locator("h1").is_visible(), "without scripts: no verdict")
    expect(page.locator(".still svg").first.is_visible(), "without scripts: no picture")
    expect(page.locator("table").count() > 2, "without scripts: no tables")
    page.context.close()


def main(run_dir, axe):
    report = (Path(run_dir) / "report.html").resolve()
    size = report.stat().st_size
    expect(size <= LARGEST_BYTES, f"the report has {size} bytes, more than {LARGEST_BYTES}")
    program = shutil.which("chromium")
    if program is None:
        sys.exit("chromium is missing: apt-get install -y chromium")
    folder = report.parent / "browser"
    folder.mkdir(exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        looks(browser, report, folder, axe)
        journey(browser, report)
        without_scripts(browser, report)
        browser.close()
    if problems:
        sys.exit("\n".join(problems))
    print(f"{report.name}: {size} bytes, sound at {len(SIZES)} sizes; pictures in {folder.name}/")


if __name__ == "__main__":
    main(*sys.argv[1:])
