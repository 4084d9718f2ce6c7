"""Makes pages of logs with `wheeleg view`, and opens them in a browser from the disk.

    python3 check_view.py WHEELEG LOG SCREENSHOTS AXE

A whole log, one that breaks off, and two that are compared. At three sizes, light and dark: nothing is wider
than the window, nothing is asked for from elsewhere, the console is empty, axe-core finds nothing. The robot
plays, the cursor is one over all plots, and an event can be gone to. Its ground is that of the scenario, and what went wrong
first is named once.
"""

import csv
import math
import shutil
import subprocess
import sys
from pathlib import Path

import check_report
from check_report import cursors, expect, opened, play_a_moment, problems
from playwright.sync_api import sync_playwright


def made(program, page, *arguments):
    done = subprocess.run([program, "view", "--out", str(page), *map(str, arguments)], capture_output=True, text=True)
    expect(done.returncode == 0, f"{page.name}: {done.stderr}")
    return done


def journey(browser, report):
    page = opened(browser, report, 1280, 720, "light")
    expect(page.locator("#motion-view .view").is_visible(), "the robot is not shown")
    expect(page.locator(".plot-area").count() >= 20, f"{page.locator('.plot-area').count()} plots")
    play_a_moment(page)
    times = cursors(page)
    expect(len(set(times)) == 1, f"the plots stand at {set(times)}")
    seek = page.locator("#event-table .seek").last
    wanted = float(seek.get_attribute("data-seek"))
    seek.click()
    expect(abs(cursors(page)[0] - wanted) < 0.011, f"gone to {wanted} s, the cursor is at {cursors(page)[0]}")
    page.fill("input[data-filter]", "no such event")
    expect(page.locator("#event-table tbody:visible").count() == 0, "the filter filters nothing")
    page.context.close()


def rise(page):
    """How much higher the drawn ground is a metre ahead of the axle than below it, along the near track, and how far below
    the near wheel it is drawn, mm."""
    return page.evaluate("""() => {
        const line = document.querySelector('.r-near-edge').getAttribute('points').split(' ').map((p) => p.split(',').map(Number));
        const wheel = document.querySelectorAll('.view svg > g > .r-tyre-face');
        const place = wheel[wheel.length - 1].parentElement.getAttribute('transform').match(/-?[0-9.]+/g).map(Number);
        const radius = 146 * place[2];
        const at = (x) => line.reduce((a, b) => (Math.abs(b[0] - x) < Math.abs(a[0] - x) ? b : a))[1];
        return [at(place[0]) - at(place[0] + 1000), at(place[0]) - (place[1] + radius)];
    }""")


def ground(browser, program, folder):
    """The ground of a slope is drawn as it is: in the page of the log, and in the report, which is told it by the scenario."""
    run = folder / "slope"
    done = subprocess.run([program, "run", "slope-10", "--out", str(run)], capture_output=True, text=True)
    expect(done.returncode == 0, f"slope-10: {done.stderr}")
    made(program, run / "log.html", run / "log.mcap")
    for report in ["log.html", "report.html"]:
        page = opened(browser, (run / report).resolve(), 1280, 720, "light")
        for end in ["Home", "End"]:
            page.focus(".scrub")
            page.keyboard.press(end)
            higher, below = rise(page)
            wanted = 1000 * math.tan(math.radians(10))
            expect(abs(higher - wanted) < 3, f"{report}, {end}: the drawn ground rises by {higher} mm in a metre, not {wanted:.1f}")
            # The axle stands upright over the middle of the wheel; on a slope the tyre's lowest point is uphill of the picture's.
            expect(-8 < below < 12, f"{report}, {end}: the ground is drawn {below} mm below the wheel")
        page.screenshot(path=folder / f"slope-{report}.png")
        page.context.close()


def cause(browser, program, folder):
    """One fault is one cause, named first with its remedy, by the page of the log and by the report."""
    run = folder / "pot-open"
    subprocess.run([program, "run", "three-step", "--fault", "pot-open:joint3@3s", "--out", str(run)], capture_output=True, text=True)
    made(program, run / "log.html", run / "log.mcap")
    for report in ["log.html", "report.html"]:
        page = opened(browser, (run / report).resolve(), 1280, 720, "light")
        told = page.inner_text("h1")
        expect("Joint 3: the position sensor reads outside its range at 3.00 s" in told, f"{report}: {told!r}")
        expect("pot-open:joint3" in page.inner_text("header"), f"{report} does not say that the fault was injected")
        expect("potentiometer wiring" in page.inner_text("header"), f"{report} does not say what to do")
        page.screenshot(path=folder / f"cause-{report}.png")
        readings = lambda: page.inner_text(".readings")
        page.focus(".scrub")
        page.keyboard.press("Home")
        expect("no reading" not in readings(), f"{report}: before the fault there is {readings()!r}")
        page.keyboard.press("End")
        expect("no reading" in readings(), f"{report}: after the fault the joint seems to be read: {readings()!r}")
        page.context.close()


def gave_up(browser, program, folder):
    """A robot that gives up has no fault of a board: its log says so first, marks it, and finds it by the name that the
    report gives it; the report says what was missed, and by how much."""
    run = folder / "wall"
    subprocess.run([program, "run", "wall-30", "--out", str(run)], capture_output=True, text=True)
    made(program, run / "log.html", run / "log.mcap")
    page = opened(browser, (run / "log.html").resolve(), 1280, 720, "light")
    told = page.inner_text("h1")
    expect(told.startswith("The robot got stuck and gave up at "), f"log.html: {told!r}")
    expect("lead it another way" in page.inner_text("header .remedy"), "log.html does not say what to do")
    at = float(told.split(" at ")[1].split()[0])
    with (run / "csv" / "events.csv").open(newline="") as table:
        faults = [row["text [text]"] for row in csv.DictReader(table) if row["kind [text]"] == "fault"]
    expect(faults == [], f"a robot that gave up has faults: {faults}")
    ticks = page.locator("#motion-view .tick").count()
    expect(ticks == 1, f"{ticks} marks on the time line for a robot that gave up")
    page.locator(".missed-list .seek").first.click()
    expect(abs(cursors(page)[0] - at) < 0.011, f"gone to {cursors(page)[0]} s, the robot gave up at {at} s")
    words = page.eval_on_selector_all("#motion-view .seg", "all => all.map((seg) => [seg.textContent, seg.scrollWidth > seg.clientWidth])")
    expect(any(word == "walk" for word, _ in words), f"phases are named {words}")
    page.fill("input[data-filter]", "stuck")
    rows = page.locator("#event-table tbody:visible")
    expect(rows.count() == 1 and rows.locator("td.bad").count() == 1, f"{rows.count()} events are found by the name stuck")
    page.screenshot(path=folder / "stuck-log.html.png")
    page.context.close()
    small = opened(browser, (run / "log.html").resolve(), 400, 800, "light")
    words = small.eval_on_selector_all("#motion-view .seg", "all => all.map((seg) => [seg.textContent, seg.scrollWidth > seg.clientWidth])")
    expect(any(word == "walk" for word, _ in words) and not any(cut for _, cut in words), f"400 px: phases are named {words}")
    small.context.close()
    page = opened(browser, (run / "report.html").resolve(), 1280, 720, "light")
    told = page.inner_text("h1")
    if "missed" in told:
        missed = page.inner_text(".missed-list li >> nth=0")
        expect("asked: ≤ 20 s" in missed and "`" not in missed, f"report.html: {missed!r}")
    expect("gave up at" in page.inner_text("header"), "report.html does not say that the robot gave up")
    page.screenshot(path=folder / "stuck-report.html.png")
    page.context.close()
    both = folder / "unlike.html"
    told = made(program, both, folder / "pot-open", run).stdout
    for words in ["different robots (wheeleg-2003, wheeleg)", "scenarios (three-step, wall-30)", "First log: Joint 3", "Second log: The robot got stuck", "goes on for"]:
        expect(words in told, f"a comparison does not say {words!r}: {told}")
    told = made(program, folder / "beyond.html", run, "--to", "99").stderr
    expect("ends at 60.0" in told, f"a part beyond the end is not told: {told!r}")


def main(program, log, folder, axe):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    whole = folder / "whole.html"
    made(program, whole, log)
    size = whole.stat().st_size
    expect(size <= check_report.LARGEST_BYTES, f"the page has {size} bytes")
    text = Path(log).read_bytes()
    broken = folder / "broken.mcap"
    broken.write_bytes(text[: len(text) * 2 // 3])
    cut = folder / "cut.html"
    expect("is truncated" in made(program, cut, broken).stderr, "a truncated log is not reported")
    both = folder / "both.html"
    done = made(program, both, log, broken)
    expect("equal up to" in done.stdout, f"a log and its first part differ: {done.stdout}")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=check_report.shutil.which("chromium"), args=check_report.FLAGS)
        for report in [whole, cut, both]:
            shots = folder / report.stem
            shots.mkdir(exist_ok=True)
            check_report.looks(browser, report.resolve(), shots, axe)
        journey(browser, whole.resolve())
        ground(browser, program, folder)
        cause(browser, program, folder)
        gave_up(browser, program, folder)
        page = opened(browser, cut.resolve(), 1280, 720, "light")
        expect("breaks off" in page.inner_text(".note"), "the page does not say that its log breaks off")
        browser.close()
    for run in ["slope", "pot-open", "wall"]:
        shutil.rmtree(folder / run, ignore_errors=True)
    if problems:
        sys.exit("\n".join(problems))
    print(f"{whole.name}: {size} bytes, sound at {len(check_report.SIZES)} sizes; pictures in {folder.name}/")


main(*sys.argv[1:])
