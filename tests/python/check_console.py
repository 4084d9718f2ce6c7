"""Drives a simulated robot from its console's page, in a browser, as an operator does.

    python3 check_console.py WHEELEG [SCREENSHOTS]

Without a key and with a wrong one nothing is shown. With the right one: ready, walk, stop the gait,
provoke a fault, read its remedy, stop with Esc from within a field. Who has the view key may look and
stop. When the server goes, the page says so and nothing on it looks live. At three sizes, light and dark,
nothing is wider than the window, and STOP can be seen and hit.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

SIZES = [(1280, 720), (1024, 768), (400, 800)]
FLAGS = ["--no-sandbox", "--use-angle=swiftshader"]
# A browser that renders in software on a busy machine may look away for longer than the master
# lets an operator; then the robot holds, as it should, and the operator begins anew.
ATTEMPTS = 5

problems = []


def expect(holds, what):
    if not holds:
        problems.append(what)


class Console:
    """`wheeleg serve` in a home of its own."""

    def __init__(self, program, home):
        environment = dict(os.environ, XDG_STATE_HOME=str(home))
        arguments = [program, "serve", "stand", "--listen", "127.0.0.1:0"]
        self.process = subprocess.Popen(arguments, env=environment, stdout=subprocess.PIPE, text=True)
        first = self.process.stdout.readline()
        self.address = first.split()[1].rstrip("/")
        folder = home / "wheeleg"
        self.keys = {name: (folder / f"{name}.key").read_text().strip() for name in ("control", "view")}

    def end(self):
        self.process.terminate()
        self.process.wait()


def opened(browser, console, fragment, scheme="light"):
    context = browser.new_context(viewport={"width": 1280, "height": 720}, color_scheme=scheme)
    page = context.new_page()
    page.on("pageerror", lambda error: problems.append(f"{fragment[:2]}: {error}"))
    page.on("request", lambda request: expect(request.url.startswith(console.address), f"asks for {request.url}"))
    page.goto(f"{console.address}/{fragment}")
    return page


def cell(page, name):
    return page.locator(".cell", has_text=name).locator("b").inner_text()


def waits(page, name, wanted, seconds=15):
    """Whether a cell of the head comes to show one of these."""
    script = """([name, wanted]) => [...document.querySelectorAll('.cell')].some(
        (cell) => cell.firstChild.textContent === name && wanted.some((w) => cell.lastChild.textContent.startsWith(w)))"""
    try:
        page.wait_for_function(script, arg=[name, wanted], timeout=1000 * seconds)
        return True
    except Exception:
        return False


def press(page, name):
    page.locator(".buttons button", has_text=name).click()


def becomes_ready(page):
    for _ in range(ATTEMPTS):
        press(page, "Ready")
        if waits(page, "State", ["ARMED"]) and waits(page, "Gait", ["ready"]):
            return True
        if cell(page, "Control") != "you":
            press(page, "Take control")
        press(page, "Clear fault")
    return False


def walks(page):
    for _ in range(ATTEMPTS):
        press(page, "Walk")
        if waits(page, "Gait", ["lift", "reach", "lower", "push"]):
            return True
        becomes_ready(page)
    return False


def without_the_key(browser, console):
    page = opened(browser, console, "")
    expect("needs a key" in page.inner_text("body"), "without a key the page does not say what it needs")
    page.context.close()
    page = opened(browser, console, f"#k={'0' * 64}")
    page.wait_for_selector("[role=alert].alone")
    expect("key" in page.inner_text("body"), f"a wrong key: {page.inner_text('body')!r}")
    page.context.close()


def journey(browser, console, folder):
    page = opened(browser, console, f"#k={console.keys['control']}")
    page.wait_for_selector(".joint")
    expect(console.keys["control"] not in page.url, "the key stays in the address")
    expect(waits(page, "State", ["disarmed"]), f"at first: {cell(page, 'State')}")
    expect(becomes_ready(page), f"Ready: {page.inner_text('.answer')!r}")
    before = page.locator(".views .side svg").inner_html()
    expect(walks(page), f"Walk: {page.inner_text('.answer')!r}")
    expect(page.locator(".views .side svg").inner_html() != before, "the robot stands still on the page while it walks")
    page.screenshot(path=folder / "walking.png")
    if page.locator(".buttons button", has_text="Stop gait").count():
        press(page, "Stop gait")

    page.select_option("select[aria-label=Fault]", "pot-open")
    page.fill("input[aria-label='Target and value']", ":joint3")
    for _ in range(ATTEMPTS):
        page.get_by_role("button", name="Inject").click()
        try:
            page.wait_for_selector(".fault", timeout=5000)
            break
        except Exception:
            continue
    remedy = page.inner_text(".faults")
    expect("Board 3" in remedy and "potentiometer" in remedy, f"the fault and its remedy: {remedy!r}")
    expect(waits(page, "State", ["HOLD"]), f"after the fault: {cell(page, 'State')}")
    expect("No reading" in page.locator(".joint").nth(2).inner_text(), "the joint shows a reading all the same")
    expect(page.locator(".joint.blind").count() == 1, "other joints show no reading, too")
    page.screenshot(path=folder / "fault.png")

    page.focus("input[aria-label='Target and value']")
    page.keyboard.press("Escape")
    expect(waits(page, "State", ["STOPPED"]), f"after Esc: {cell(page, 'State')}")
    page.wait_for_timeout(300)
    expect("Boards 1, 2, 3" in page.inner_text(".faults"), "equal faults of all boards are not one line")
    return page


def looks_only(browser, console):
    page = opened(browser, console, f"#v={console.keys['view']}")
    page.wait_for_selector(".joint")
    expect(waits(page, "State", ["STOPPED"]), "a viewer does not see the stop")
    expect(page.locator(".buttons .btn:not([disabled])").count() == 0, "a viewer can press buttons")
    page.click(".stop")
    expect(waits(page, "State", ["STOPPED"]), "a viewer cannot stop")
    expect(page.locator(".banner.alarm").is_hidden(), "a viewer's stop is not confirmed")
    page.context.close()


def looks(page, folder):
    for scheme in ["light", "dark"]:
        page.emulate_media(color_scheme=scheme)
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            name = f"{width}-{scheme}"
            page.wait_for_timeout(200)
            wide = page.evaluate("document.documentElement.scrollWidth")
            expect(wide <= width, f"{name}: {wide} px wide")
            box = page.locator(".stop").bounding_box()
            hit = box["width"] >= 96 and box["height"] >= 56
            seen = box["y"] >= 0 and box["y"] + box["height"] <= height and box["x"] + box["width"] <= width
            expect(hit and seen, f"{name}: STOP is at {box}")
            page.screenshot(path=folder / f"{name}.png")


def main(program, folder):
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as home, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        console = Console(program, Path(home))
        try:
            without_the_key(browser, console)
            page = journey(browser, console, folder)
            looks_only(browser, console)
            looks(page, folder)
            console.end()
            page.wait_for_selector(".banner:not([hidden])")
            expect(page.get_attribute("body", "data-state") == "stale", "what is old looks live")
            expect("reload" in page.inner_text(".banner:not(.alarm)"), "the lost server is not told")
        finally:
            console.end()
            browser.close()
    if problems:
        print("\n".join(problems))
        sys.exit(1)
    print(f"driven from the page; screenshots in {folder}")


main(sys.argv[1], Path(sys.argv[2] if len(sys.argv) > 2 else "console-shots"))
