"""Drives a simulated robot from its console's page, in a browser, as an operator does.

    python3 check_console.py WHEELEG SCREENSHOTS AXE

Without a key and with a wrong one nothing is shown. With the right one: ready, walk, stop the gait,
provoke a fault, read its remedy, stop with Esc from within a field. Who has stopped, and who lost control, is told; Ready waits for air. A slider asks for a stroke; a parameter is written, and not saved while armed. Who has the view key may look and
stop. Signals are plotted, frozen, zoomed and saved; events are sieved and saved; what is done is recorded, and repeats to the bit. Somebody drives by
hand, with wheels and legs and with the wheels alone: who lets go stops. The robot is seen in space, and on a slope on its
ground. Space holds, also on a button; a reload in mid-walk is asked about. A page that did not run says so; one whose earlier events do not come keeps its STOP. When the server goes, the page says so and nothing on it looks live. At three sizes, light and dark,
nothing is wider than the window, STOP can be seen and hit, and axe-core finds nothing.
"""

import contextlib
import csv
import io
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from accessible import findings
from PIL import Image
from playwright.sync_api import TimeoutError as PageTimeout
from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[2] / "host-sim/console/python"))
from wheeleg import Robot

SIZES = [(1280, 720), (1024, 768), (400, 800)]
# WebGL is drawn in software. The page itself is not put together by way of it, which takes ten times as long: no browser without
# graphics does so by itself.
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--disable-gpu-compositing"]
# A browser that renders in software on a busy machine may look away for longer than the master
# lets an operator; then the robot holds, as it should, and the operator begins anew.
ATTEMPTS = 5
# For so long something is begun anew that was disturbed so, s.
PATIENCE_S = 300
# Longest time in which a robot that was stopped stands armed again.
READY_S = 90
# Longest time of the robot for which a button is held until it moves, s.
HELD_S = 15
# Longest time on the wall in which a second of the robot's passes, s: a busy machine simulates slower than real time.
SLOW_S = 30

# What is pressed on a tablet is at least so high, px.
SMALL = """() => [...document.querySelectorAll('button, select, input, summary')]
    .filter((one) => one.checkVisibility() && one.getBoundingClientRect().height < 44)
    .map((one) => `${one.textContent.trim() || one.getAttribute('aria-label')}: ${one.getBoundingClientRect().height} px`)"""

# Parts of the head that are seen in part, air that is not seen, and a choice whose words have no room.
CUT = """() => {
    const head = document.querySelector('.cells').getBoundingClientRect();
    const places = [...document.querySelectorAll('.cell')].filter((cell) => cell.checkVisibility()).map((cell) => [cell.firstChild.textContent, cell.getBoundingClientRect()]);
    const seen = places.filter(([, place]) => place.top < head.bottom - 1);
    const bad = seen.filter(([, place]) => place.right > head.right + 1 || place.bottom > head.bottom + 1).map(([name]) => name);
    if (!seen.some(([name]) => name.startsWith('Air'))) bad.push('no air');
    const choice = document.querySelector('.eventlist select');
    const words = document.createElement('span');
    words.textContent = choice.selectedOptions[0].textContent;
    words.style.cssText = `position: absolute; white-space: nowrap; font: ${getComputedStyle(choice).font}`;
    document.body.append(words);
    if (words.getBoundingClientRect().width + 24 > choice.getBoundingClientRect().width) bad.push(words.textContent);
    words.remove();
    return bad;
}"""

problems = []
# What the browser reports by itself. It counts, whatever became of the step in which it came.
reported = []


def expect(holds, what):
    if not holds:
        problems.append(what)


class Console:
    """`wheeleg serve` in a home of its own."""

    def __init__(self, program, home, listen="127.0.0.1:0", *options, scenario="stand"):
        environment = dict(os.environ, XDG_STATE_HOME=str(home))
        self.recordings = home / "recordings"
        arguments = [program, "serve", scenario, "--listen", listen, "--recordings", str(self.recordings), *options]
        self.process = subprocess.Popen(arguments, env=environment, stdout=subprocess.PIPE, text=True)
        # Before its address it may say that it is not protected.
        words = next(line.split() for line in self.process.stdout if line.startswith("open "))
        self.address = words[1].rstrip("/")
        folder = home / "wheeleg"
        self.keys = {name: (folder / f"{name}.key").read_text().strip() for name in ("control", "view")}

    def end(self):
        self.process.terminate()
        self.process.wait()


def opened(browser, console, fragment, scheme="light", address=None, prepare=lambda page: None):
    address = address or console.address
    context = browser.new_context(viewport={"width": 1280, "height": 720}, color_scheme=scheme)
    # A gamepad that the test holds.
    context.add_init_script("window.testPad = null; navigator.getGamepads = () => [window.testPad];")
    # Its clock is an hour off, which nothing here may notice.
    context.add_init_script("{ const now = Date.now; Date.now = () => now() + 3.6e6; }")
    page = context.new_page()
    page.on("pageerror", lambda error: reported.append(f"{fragment[:2]}: {error}"))
    page.on("request", lambda request: expect(request.url.startswith(address), f"asks for {request.url}"))
    # A browser tells of each answer that a wrong key gets.
    page.on("console", lambda message: reported.append(f"console: {message.text}") if message.type in ("error", "warning") and "401" not in message.text else None)
    prepare(page)
    page.goto(f"{address}/{fragment}")
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


def time_s(page):
    """Time of the robot that the page shows, s."""
    return float(cell(page, "Time").split()[0])


def passes(page, seconds):
    """Waits until the page shows that so much of the robot's time has passed."""
    script = """until => parseFloat([...document.querySelectorAll('.cell')].find((cell) => cell.firstChild.textContent === 'Time').lastChild.textContent) >= until"""
    page.wait_for_function(script, arg=time_s(page) + seconds, timeout=1000 * SLOW_S * max(1, seconds))


def goes_on(page):
    """Whether the page shows that the robot's time passes."""
    with contextlib.suppress(PageTimeout):
        passes(page, 0.3)
        return True
    return False


def press(page, name):
    page.locator(".buttons button", has_text=name).click()


def answers(page, last, seconds=15):
    """Waits until a command of this name is done, or one before it is not; whether it is done."""
    script = """last => {
        const told = document.querySelector('.answer').textContent.trim();
        return told.startsWith(`${last}: done`) || /: (refused|no answer|ended early)/.test(told);
    }"""
    try:
        page.wait_for_function(script, arg=last, timeout=1000 * seconds)
    except Exception:
        return False
    return page.inner_text(".answer").strip().startswith(f"{last}: done")


def spoken(command):
    """A command as the page says it."""
    return re.sub("(?<=.)[A-Z]", lambda letter: f" {letter[0].lower()}", command)


def becomes_ready(page):
    """Presses Ready until the robot stands armed: a fault is cleared, control that was lost is taken again, and air that
    went out comes back in its time."""
    end = time.monotonic() + READY_S
    while time.monotonic() < end:
        press(page, "Ready")
        if answers(page, "Stand", READY_S) and waits(page, "State", ["ARMED"]) and waits(page, "Gait", ["ready"]):
            return True
        if "not in control" in page.inner_text(".answer") or cell(page, "Control") != "you":
            take = page.locator(".buttons button", has_text="Take control")
            # It reads otherwise as soon as the control is there.
            with contextlib.suppress(Exception):
                take.click(timeout=1000)
                answers(page, "Take control")
        press(page, "Clear fault")
        answers(page, "Clear fault")
        page.wait_for_timeout(500)
    return False


def undisturbed(page, robot, act, *arguments):
    """Does something as an operator who is not lost meanwhile: after a loss all begins anew, from Ready. What fails
    without a loss has failed."""
    end = time.monotonic() + PATIENCE_S
    while True:
        heard, newest = len(problems), max((event["number"] for event in robot.events()), default=0)
        try:
            act(page, *arguments)
        except PageTimeout as error:
            expect(False, f"{act.__name__}: {error}")
        lost = cell(page, "Control") != "you" or any(event["detail"] == "operator_lost" and event["number"] > newest for event in robot.events())
        if len(problems) == heard or not lost or time.monotonic() > end:
            return
        del problems[heard:]
        becomes_ready(page)


def walks(page):
    for _ in range(ATTEMPTS):
        press(page, "Walk")
        if waits(page, "Gait", ["walk, step"], 8):
            return True
        becomes_ready(page)
    return False


def records(page, begin):
    """Begins or ends a recording, and waits until it is so."""
    page.locator("button", has_text="Record" if begin else "Stop recording").first.click()
    shown = "Stop recording" if begin else "Record"
    try:
        page.wait_for_selector(f"section[aria-label=Recording] button:has-text('{shown}')", timeout=5000)
    except Exception:
        problems.append(f"recording: {page.inner_text('.answer')!r}")


def repeats(program, console):
    """What was recorded of this session is repeated to the bit."""
    folder = console.recordings / "0001"
    done = subprocess.run([program, "replay", str(folder)], capture_output=True, text=True)
    expect(done.returncode == 0, f"the recording does not repeat: {done.stdout} {done.stderr}")


def colours_of(picture):
    """How many colours a picture has."""
    return len(picture.convert("RGB").getcolors(picture.width * picture.height))


def plots(page, folder):
    expect(page.locator(".scope-plot").count() == 1, "there is not one plot at first")
    page.select_option("select[aria-label='Add a plot']", label="Feet, load")
    page.select_option("select[aria-label='Add a plot']", label="/body pitch_deg")
    expect(page.locator(".scope-plot").count() == 3, "plots are not added")
    page.wait_for_timeout(1500)
    numbers = "() => [...document.querySelectorAll('.scope-plot .legend b')].map((b) => b.textContent)"
    expect("–" not in page.evaluate(numbers), f"plots have no values: {page.evaluate(numbers)}")
    page.get_by_role("button", name="Freeze").click()
    canvas = page.locator(".scope-plot canvas").first
    image = "canvas => canvas.toDataURL()"
    before = canvas.evaluate(image)
    page.wait_for_timeout(400)
    expect(canvas.evaluate(image) == before, "a frozen plot goes on")
    area = page.locator(".scope-plot .plot-area").first
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 30)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 30, steps=4)
    page.mouse.up()
    expect(canvas.evaluate(image) != before, "a drag does not zoom")
    times = page.eval_on_selector_all(".scope-plot .plot-area", "list => list.map((a) => a.getAttribute('aria-valuenow'))")
    expect(len(set(times)) == 1, f"the cursor is not one over all plots: {times}")
    with page.expect_download() as download:
        page.get_by_role("button", name="Save as CSV").click()
    table = Path(download.value.path()).read_text().splitlines()
    expect(len(table) > 30 and any("/body.pitch_deg" in row for row in table), f"the table has {len(table)} rows")
    with page.expect_download() as download:
        page.get_by_role("button", name="Save as PNG").click()
    saved = Image.open(download.value.path()).convert("RGB")
    drawn = colours_of(saved)
    wide = page.locator(".scope-plot canvas").first.evaluate("canvas => [canvas.width, canvas.height]")
    expect(saved.width >= wide[0] and saved.height >= 3 * wide[1] and drawn >= 50, f"the picture of three plots is {saved.size}, {drawn} colours")
    page.screenshot(path=folder / "plots.png", full_page=True)
    page.get_by_role("button", name="Go on").click()
    page.locator(".scope-plot .close").last.click()
    expect(page.locator(".scope-plot").count() == 2, "a plot cannot be closed")


def place(page):
    """Where the drawn ground is, mm."""
    text = page.evaluate(
        "() => document.querySelector('.views .side svg .r-ground').nextElementSibling.getAttribute('transform')")
    return float(text.split("(")[1].split(",")[0])


def drives(page, name, begin, end, ends, least_mm=2.0, state=None):
    """Somebody holds on, and the robot moves; lets go, and it does what it `ends` with, and stands."""
    before, begun_s = place(page), time_s(page)
    begin()
    passes(page, 1)
    while abs(place(page) - before) <= least_mm and cell(page, "Control") == "you" and time_s(page) < begun_s + HELD_S:
        passes(page, 0.1)
    end()
    try:
        page.wait_for_function("ends => document.querySelector('.answer').textContent.trim().startsWith(ends)", arg=f"{ends}: done", timeout=20000)
        ended = True
    except PageTimeout:
        ended = False
    passes(page, 2.5)
    rest = place(page)
    passes(page, 0.5)
    moved, stands = abs(rest - before) > least_mm, abs(place(page) - rest) < 1.0
    answer = page.inner_text(".answer").strip()
    expect(moved and stands and ended, f"{name}: moved {moved}, then stands {stands}, ends with {ends} {ended}: {answer!r}")
    expect(state in (None, cell(page, "State")), f"{name}: afterwards {cell(page, 'State')}, not {state}")


def drives_by_hand(page, robot):
    button = page.get_by_role("button", name="Forward")
    button.scroll_into_view_if_needed()
    page.select_option("select[aria-label='What moves']", "wheels")

    def arrow():
        button.focus()
        page.keyboard.down("ArrowDown")

    undisturbed(page, robot, drives, "the button", lambda: hold_down(page, button), page.mouse.up, "Hold")
    undisturbed(page, robot, drives, "the arrow key", arrow, lambda: page.keyboard.up("ArrowDown"), "Hold")


def hold_down(page, button):
    button.scroll_into_view_if_needed()
    box = button.bounding_box()
    page.mouse.move(box["x"] + 10, box["y"] + 10)
    page.mouse.down()


def walks_by_hand(page, robot, name="walking by hand"):
    """The legs step along; who lets go stops with both feet down, and the robot is not held."""
    page.select_option("select[aria-label='What moves']", "walk")
    button = page.get_by_role("button", name="Forward")
    undisturbed(page, robot, drives, name, lambda: hold_down(page, button), page.mouse.up, "Stop walking", 20.0, "ARMED")


def drives_by_gamepad(page, robot):
    """A stick alone moves nothing; with a shoulder button held it does, and letting go holds."""
    pad = """shoulder => { window.testPad = {id: 'Test pad', connected: true, axes: [0, -1, 0, 0],
        buttons: [...Array(16)].map((_, i) => ({pressed: shoulder && i === 5, value: 0}))}; }"""
    page.evaluate(pad, False)
    before = place(page)
    passes(page, 1.2)
    expect(abs(place(page) - before) < 1.0, "a stick without its shoulder button drives")
    undisturbed(page, robot, drives, "the gamepad", lambda: page.evaluate(pad, True), lambda: page.evaluate(pad, False), "Hold")
    page.evaluate("() => { window.testPad = null; }")


def events(page):
    """After a stop: alike events of all boards are one line. Sieved by kind, board and text; saved as they were recorded."""
    panel = page.locator(".eventlist")
    lines = lambda: [line.inner_text() for line in panel.locator("li:visible").all()]
    whole = lines()
    folded = [line for line in whole if "joints 1–6, wheels 7–8" in line]
    expect(folded, f"alike events of eight boards are not one line: {whole[:12]}")
    newest = "\n".join(whole[:8])
    says = [line for line in whole[:8] if re.search(" says? why", line) and "Emergency stop" in line]
    expect(len(says) == 1 and "EmergencyStop: accepted (by you)" in newest, f"a stop is not in sight among the newest events: {whole[:8]}")
    expect(not any("foot leaves the ground" in line for line in whole), f"contacts push out what counts: {whole[:8]}")
    panel.get_by_label("Kind of events").select_option("contact")
    expect(any("foot leaves the ground" in line for line in lines()), f"contacts cannot be seen: {lines()[:5]}")
    panel.get_by_label("Kind of events").select_option("fault")
    faults = lines()
    plain = [line.inner_text() for line in panel.locator("li:visible:not(.bad)").all()]
    expect(0 < len(faults) < len(whole) and all("faults cleared" in line for line in plain), f"the sieve by kind: {len(faults)} of {len(whole)}, {plain[:3]}")
    panel.get_by_label("Board of events").select_option("3")
    of_board = lines()
    expect(0 < len(of_board) <= len(faults) and any("joint 3" in line or "joints" in line for line in of_board), f"the sieve by board: {of_board[:5]}")
    panel.get_by_label("Events whose text has").fill("POTENTIOMETER")
    found = lines()
    expect(found and all("potentiometer" in line for line in found), f"the sieve by text: {found[:5]}")
    expect(f"{len(found)} of {len(panel.locator('li').all())} lines" in panel.inner_text(), f"how many are shown: {panel.inner_text()[:200]!r}")
    panel.get_by_label("Events whose text has").fill("")
    panel.get_by_label("Board of events").select_option("")
    with page.expect_download() as download:
        panel.get_by_role("button", name="Save events as CSV").click()
    table = list(csv.DictReader(Path(download.value.path()).read_text().splitlines()))
    boards = {row["board"] for row in table}
    expect({row["kind"] for row in table} == {"fault"} and len(table) >= 8 and boards >= set("12345678"), f"the table: {len(table)} rows of boards {sorted(boards)}")
    expect(all(int(a["t_ns"]) <= int(b["t_ns"]) for a, b in zip(table, table[1:])), "the table is not in order")
    expect(any(row["board"] == "3" and row["code"] == "fault_latched" and "joint 3" in row["text"] for row in table), f"an event is not as it was recorded: {table[:2]}")
    panel.get_by_label("Kind of events").select_option("")
    expect(len(lines()) >= len(whole), "the sieve stays")


def sees_what_was(browser, console, lines):
    """Who comes later sees the events of before."""
    page = opened(browser, console, f"#v={console.keys['view']}")
    page.wait_for_selector(".events li:visible")
    page.wait_for_timeout(500)
    count = page.locator(".events li").count()
    expect(count >= min(lines, 50), f"who comes later sees {count} lines, who was there {lines}")
    page.context.close()


def events_fail(browser, console):
    """The page of a robot whose earlier events do not come stays, with its STOP; what failed is told beside the events."""
    heard = len(reported)
    without = lambda page: page.route("**/api/v1/events", lambda route: route.abort())
    page = opened(browser, console, f"#v={console.keys['view']}", prepare=without)
    with contextlib.suppress(Exception):
        page.wait_for_selector(".eventlist p.bad:not([hidden])", timeout=5000)
    del reported[heard:]  # the browser tells of the request that failed
    told = page.inner_text(".eventlist") if page.locator(".eventlist").count() else page.inner_text("body")
    expect("Earlier events are missing" in told, f"earlier events that do not come: {told[:300]!r}")
    expect(page.locator(".stop").is_visible(), "without earlier events there is no STOP")
    expect(waits(page, "State", ["disarmed"]), "without earlier events the page is not live")
    expect(goes_on(page), "without earlier events the page stands still")
    page.context.close()


def events_alone(page):
    """The list by itself: what comes twice is one event, what differs is not one line, and who revoked is saved."""
    lines = page.evaluate("""async () => {
        const { eventsView } = await import("/events.js");
        const view = eventsView();
        view.root.id = "alone";
        document.body.append(view.root);
        const event = (number, text, rest) => ({ number, t_ns: 1e9 + number, kind: "fault", code: "diagnosis", detail: "", board: 0, fault: 3, command: 0, minor: false, text, ...rest });
        const says = (number, board, s) => event(number, `joint ${board} says why: first fault, ${s} s ago: it is hot`, { board });
        view.add(event(3, "third"));
        // Its answer was quicker than the line, on which the fourth comes after it.
        view.past([event(1, "first"), event(2, "second"), event(3, "third"), event(4, "fourth")]);
        view.add(event(4, "fourth"));
        view.add(says(5, 1, 0.01));
        view.add(says(6, 2, 0.01));
        view.add(says(7, 3, 0.25));
        view.add(event(8, "hold", { code: "hold", holder: "tablet", revoked_by: "owner" }));
        view.add(event(9, "wheel 7: faults cleared", { code: "faults_cleared", board: 7, fault: 0 }));
        view.add(event(10, "left foot leaves the ground", { kind: "contact", code: "lift_off", fault: 0, minor: true }));
        for (const [number, board, s] of [[11, 1, 0.004], [12, 2, 0.017]]) view.add({ ...says(number, board, s), fault: 39 });
        view.add(event(14, "no foot carries: the wheels slow down", { kind: "info", code: "tip_guard", fault: 0, minor: true }));
        view.add(event(15, "stop", { code: "hold", stopped: { via: "console", name: "ctl", session: "0", role: "control", at_us: 1 } }));
        return [...view.root.querySelectorAll("li")].map((line) => `${line.textContent.slice(4)}${line.hidden ? " (hidden)" : ""}${line.className === "bad" ? "" : " (plain)"}`).reverse();
    }""")
    wanted = ["first", "second", "third", "fourth"]
    wanted += [f"{who} why: first fault, {s} s ago: it is hot" for who, s in (("joints 1–2 say", "0.01"), ("joint 3 (left vertical) says", "0.25"))]
    wanted += ["hold (tablet, revoked by owner)", "wheel 7 (left): faults cleared (plain)", "left foot leaves the ground (hidden) (plain)"]
    wanted += ["joints 1–2 say why: first fault, 0.004 s ago: it is hot", "no foot carries: the wheels slow down (hidden) (plain)", "stop (by “ctl”)"]
    expect(lines == wanted, f"the list of events: {lines}")
    with page.expect_download() as download:
        page.locator("#alone").get_by_role("button", name="Save events as CSV").click()
    table = list(csv.DictReader(Path(download.value.path()).read_text().splitlines()))
    expect(len(table) == 12 and table[7]["holder"] == "tablet" and table[7]["revoked_by"] == "owner" and table[-1]["stopped_by"] == "“ctl”", f"the table of events: {table}")
    page.evaluate("document.getElementById('alone').remove()")
    names = page.evaluate("import('/boards.js').then(({ titled }) => [[3], [7], [8], [2, 1], [1, 2, 3, 4, 5, 6, 8]].map(titled))")
    expect(names == ["Joint 3 (left vertical)", "Wheel 7 (left)", "Wheel 8 (right)", "Joints 1–2", "Joints 1–6, wheel 8 (right)"], f"boards by name: {names}")


def ground_goes_on(page):
    """However far the robot has gone, there are marks and metres on the ground, each where it is."""
    seen = page.evaluate("""async () => {
        const { floorSide } = await import("/ground.js");
        const picture = document.createElementNS("http://www.w3.org/2000/svg", "svg");
        const move = floorSide(picture);
        return [0, 6400, 25030, -7300].map((travel_mm) => {
            move({ travel_mm }, []);
            const places = (one) => [...one.closest("svg").querySelectorAll("g[transform]")].filter((g) => g.contains(one)).reduce((sum, g) => sum + Number(g.getAttribute("transform").match(/-?[0-9.]+/)[0]), 0);
            const lines = [...picture.querySelectorAll("line")].map((line) => Number(line.getAttribute("x2")) + places(line));
            const texts = [...picture.querySelectorAll("text")].filter((text) => text.getAttribute("visibility") === "visible");
            // A label is 8 mm beside its mark, which the depth of the near edge moves by 135.2 mm.
            const off = texts.map((text) => Number(text.getAttribute("x")) + places(text) - 8 + 135.2 + travel_mm - 1000 * Number(text.textContent.replace("−", "-").split(" ")[0]));
            return [Math.min(...lines) < -392, Math.max(...lines) > 918, texts.length >= 2, Math.max(...off.map(Math.abs)) < 1];
        });
    }""")
    expect(all(all(one) for one in seen), f"marks on the ground: {seen}")


def board_table(page):
    page.get_by_role("region", name="Boards").locator("summary", has_text="Table").click()
    row = page.locator(".boardlist .boardtable tbody tr").nth(2)
    try:
        page.wait_for_function("() => /^[1-9]/.test(document.querySelectorAll('.boardlist .boardtable tbody tr')[2].cells[1].textContent)", timeout=15000)
    except Exception:
        problems.append(f"the table of boards has no counts: {row.inner_text()!r}")
    page.get_by_role("region", name="Boards").locator("summary", has_text="Table").click()


def in_space(page, robot, folder):
    """The view in space is drawn, turns with pointer and keys, and shows the robot move."""
    switch = page.get_by_role("button", name="3D")
    switch.click()
    canvas = page.locator("canvas.space")

    def picture():
        page.wait_for_timeout(600)
        return canvas.screenshot()

    first = picture()
    colours = colours_of(Image.open(io.BytesIO(first)))
    expect(colours >= 50, f"the view in space has {colours} colours")
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.6 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 0.7 * box["height"], steps=4)
    page.mouse.up()
    dragged = picture()
    expect(dragged != first, "a drag does not turn the robot in space")
    canvas.focus()
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("+")
    expect(picture() != dragged, "keys do not turn it")
    space_parts(page)
    page.screenshot(path=folder / "space.png")
    before = picture()
    walks_by_hand(page, robot, "walking, seen in space")
    page.evaluate("scrollTo(0, 0)")
    expect(picture() != before, "the robot does not move in space")
    expect(page.locator(".no-space").is_hidden(), "the view in space says that it failed")
    switch.click()
    expect(canvas.is_hidden() and page.locator(".plan > svg").is_visible(), "the flat view does not come back")


def space_parts(page):
    """Each wheel turns by its own travel, and by that alone."""
    turned = page.evaluate("""async () => {
        const { solids } = await import("/solids.js");
        const size = { crank_mm: 290, p4_mm: [325, 100], o4_mm: [420, 180, 250], stroke_zero_mm: [240, 220, 300], foot_pad_mm: 20,
            sole_radius_mm: 30, wheel_radius_mm: 150, track_mm: 500 };
        const leg = { sensed_mm: [90, 90, 90], load_n: 0 };
        const rims = (x_mm, wheels_mm) => solids(size, { x_mm, y_mm: 0, z_mm: 150, roll_deg: 0, pitch_deg: 0, yaw_deg: 0, wheels_mm, legs: [leg, leg] })
            .filter(({ colour }) => colour === "rim").map(({ at }) => at.slice(0, 12).map((v) => v.toFixed(3)).join());
        const rest = rims(0, [0, 0]);
        const differ = (other) => [0, 3].map((first) => [0, 1, 2].every((i) => rest[first + i] !== other[first + i]));
        return [differ(rims(0, [100, 0])), differ(rims(0, [0, 100])), differ(rims(400, [0, 0]))];
    }""")
    expect(turned == [[True, False], [False, True], [False, False]], f"wheels in space turn so: {turned}")


def space_fails(browser, console):
    """A picture that is not drawn any more says so, and the page goes on; parts that do not come are told."""
    page = opened(browser, console, f"#v={console.keys['view']}")
    page.wait_for_selector(".joint")
    page.route("**/view3d.js", lambda route: route.abort())
    heard = len(reported)
    switch = page.get_by_role("button", name="3D")
    switch.click()
    page.wait_for_selector(".no-space:not([hidden])")
    del reported[heard:]  # the browser tells of the part that did not come
    expect("does not give its parts" in page.inner_text(".no-space"), page.inner_text(".no-space"))
    expect(page.locator(".plan > svg").is_visible(), "without its parts the flat view is gone")
    page.context.close()
    page = opened(browser, console, f"#v={console.keys['view']}")
    page.route("**/space.js", lambda route: route.fulfill(body="onmessage = () => {};", content_type="text/javascript"))
    page.wait_for_selector(".joint")
    page.get_by_role("button", name="3D").click()
    page.wait_for_selector(".late:not([hidden])", timeout=5000)
    expect("s old" in page.inner_text(".late"), f"a worker that hangs: {page.inner_text('.late')!r}")
    expect(goes_on(page), "the page hangs with its worker")
    page.context.close()


def slider(page):
    """The slider of a joint asks for a stroke."""
    knob = page.get_by_role("slider", name="Joint 3 (left vertical), stroke to ask for, mm")
    expect(becomes_ready(page), f"Ready before the slider: {page.inner_text('.answer')!r}")
    before = float(knob.input_value())
    knob.focus()
    for _ in range(10):
        page.keyboard.press("ArrowLeft")
    wanted = float(knob.input_value())
    expect(abs(wanted - before) == 10, f"the slider went from {before} to {wanted}")
    page.get_by_role("button", name="Send the stroke to Joint 3 (left vertical)").click()
    shown = f"asked {wanted:.1f}"
    try:
        page.wait_for_function("shown => document.querySelectorAll('.joint')[2].textContent.includes(shown)", arg=shown, timeout=5000)
    except Exception:
        problems.append(f"the slider asks for {wanted}: {page.inner_text('.answer')!r}")


def form(page, command, **arguments):
    """Gives any command by its form; what is answered."""
    page.select_option("select[aria-label=Command]", command)
    for name, value in arguments.items():
        page.fill(f".fields [name={name}]", str(value))
    page.get_by_role("button", name="Send", exact=True).last.click()
    page.wait_for_function("command => RegExp(`${command}: `).test(document.querySelector('.answer').textContent)", arg=spoken(command), timeout=6000)
    return page.inner_text(".answer")


def parameters(page):
    """A parameter of a board is written in its unit and read back, in its panel and by the form of every command; what is
    out of range and saving while armed are refused."""
    expect(becomes_ready(page), f"Ready before parameters: {page.inner_text('.answer')!r}")
    told = form(page, "WriteParameter", board=3, parameter="error_scale", value=21)
    expect("done" in told, f"a parameter is written: {told!r}")
    told = form(page, "ReadParameter", board=3, parameter="error_scale")
    expect("done" in told, f"a parameter is read: {told!r}")
    events = page.inner_text(".events")
    expect(re.search(r"parameter error_scale of .*3.* is 21 mm", events), f"what was read: {events[:400]!r}")
    told = form(page, "WriteParameter", board=3, parameter="error_scale", value=1e6)
    expect("refused" in told and " mm" in told, f"a value out of range: {told!r}")
    told = form(page, "SaveParameters", board=3)
    expect("refused" in told and "disarm" in told.lower(), f"saving while armed: {told!r}")
    panel = page.locator("section[aria-label=Parameters]")
    if not panel.locator("details").first.evaluate("details => details.open"):
        panel.locator("summary").click()
    panel.get_by_label("Board", exact=True).select_option("3")
    panel.get_by_label("Parameters whose name has").fill("error_scale")
    value = panel.get_by_label("error_scale, value", exact=True)
    row = panel.locator("tr", has=page.get_by_label("error_scale, value", exact=True))
    value.wait_for(timeout=5000)
    expect(float(value.input_value()) == 21 and "board" in row.inner_text(), f"the panel: {row.inner_text()!r}, {value.input_value()}")
    expect(panel.locator("tbody tr:visible").count() < 4, "the panel shows what was not asked for")
    value.fill("22.5")
    panel.get_by_role("button", name="Write error_scale", exact=True).click()
    try:
        page.wait_for_function("() => /is 22.5 mm/.test(document.querySelector('.events').textContent) && !document.querySelector('.parametertable .typed')", timeout=5000)
    except Exception:
        problems.append(f"the panel writes: {page.inner_text('.answer')!r}")
    expect(float(value.input_value()) == 22.5, f"what was written is shown as {value.input_value()}")
    panel.get_by_role("button", name="Save on the board").click()
    page.wait_for_function("() => /Save parameters: /.test(document.querySelector('.answer').textContent)", timeout=5000)
    told = page.inner_text(".answer")
    expect("refused" in told and "disarm" in told.lower(), f"saving while armed, in the panel: {told!r}")


def in_a_walk(page):
    """Simulated time and way since power-up, s and mm."""
    texts = "() => [[...document.querySelectorAll('.cell')].find((cell) => cell.firstChild.textContent === 'Time').lastChild.textContent, document.querySelector('.views .side svg title').textContent]"
    time_s, way = page.evaluate(texts)
    return float(time_s.split()[0]), float(re.search(r"(-?[0-9]+) mm travelled", way)[1])


def speed_of(page):
    """Over two seconds, mm/s."""
    begin = in_a_walk(page)
    passes(page, 2)
    end = in_a_walk(page)
    return (end[1] - begin[1]) / (end[0] - begin[0])


def walk_is_as_set(page):
    """The button says what it does; a speed that is set in a walk counts at once."""
    knob = page.get_by_role("slider", name="Speed, mm/s")
    knob.fill("50")
    page.wait_for_timeout(300)
    told = page.locator(".buttons button", has_text="Walk").inner_text()
    expect("straight, 50 mm/s" in told, f"Walk says {told!r}")
    expect(walks(page), f"Walk: {page.inner_text('.answer')!r}")
    passes(page, 2)
    slow = speed_of(page)
    knob.fill("120")
    passes(page, 2)
    fast = speed_of(page)
    expect(fast > 1.6 * slow > 0, f"set to 50 mm/s the robot walks at {slow:.0f} mm/s, then to 120 mm/s at {fast:.0f} mm/s")
    knob.fill("100")
    page.locator(".buttons button", has_text="Stop walking").click(timeout=3000)
    expect(waits(page, "Gait", ["done", "ready", "idle"], 20), f"Stop walking: {cell(page, 'Gait')}")
    expect(becomes_ready(page), f"Ready after a walk: {page.inner_text('.answer')!r}")


def space_holds(page):
    """Space holds wherever the focus is but where one types or chooses, and presses no button once more."""
    places = {
        "Walk": lambda: None,  # it keeps the focus when it was pressed
        "a slider": lambda: page.get_by_role("slider", name="Speed, mm/s").focus(),
        "nothing": lambda: page.evaluate("document.activeElement.blur()"),
    }
    for where, focus in places.items():
        expect(walks(page), f"Walk before Space on {where}: {page.inner_text('.answer')!r}")
        focus()
        for _ in range(2):
            page.keyboard.press("Space")
            expect(waits(page, "Gait", ["hold", "done"], 5), f"Space with the focus on {where}: {cell(page, 'Gait')}, {page.inner_text('.answer')!r}")
        passes(page, 1.5)
        expect(not cell(page, "Gait").startswith("walk"), f"a second Space on {where} walks on")
        expect(page.inner_text(".answer").strip().startswith("Hold: done"), f"Space on {where}: {page.inner_text('.answer')!r}")
        expect(becomes_ready(page), f"Ready after Space: {page.inner_text('.answer')!r}")
    expect(walks(page), f"Walk before Space in a field: {page.inner_text('.answer')!r}")
    field = page.get_by_label("Events whose text has")
    field.focus()
    page.keyboard.press("Space")
    expect(field.input_value() == " " and cell(page, "Gait").startswith("walk"), f"Space in a field of text: {field.input_value()!r}, {cell(page, 'Gait')}")
    field.fill("")
    page.focus(".events")
    page.keyboard.press("Space")
    expect(waits(page, "Gait", ["hold", "done"], 5), f"Space on the list of events: {cell(page, 'Gait')}")
    expect(becomes_ready(page), f"Ready after Space: {page.inner_text('.answer')!r}")


def operator_leaves(page):
    """Whoever reloads the page in mid-walk is asked before, and then told why the robot holds."""
    page.set_viewport_size({"width": 1280, "height": 720})
    for end in page.get_by_role("button", name="End", exact=True).all():
        end.click()
    asked = []

    def answer(dialog):
        asked.append(dialog.type)
        dialog.accept()

    page.on("dialog", answer)
    for _ in range(ATTEMPTS):
        # Lost by itself meanwhile, it is not this operator who leaves.
        if becomes_ready(page) and walks(page) and cell(page, "Control") == "you":
            break
    else:
        problems.append(f"no walk before leaving: {page.inner_text('.answer')!r}")
    page.reload()
    try:
        page.wait_for_selector(".fault:has-text('has ended: its page was closed or reloaded')", timeout=30000)
    except Exception:
        problems.append(f"after a reload: {page.inner_text('.faults')!r}")
    expect("nothing new" not in page.inner_text(".faults"), f"after a reload: {page.inner_text('.faults')!r}")
    expect(asked == ["beforeunload"], f"a reload in mid-walk asks {asked}")


def server_is_gone(page):
    """What is old looks old, all of it, and nothing can be pressed but STOP, which says that it is not confirmed."""
    page.wait_for_selector(".banner:not([hidden])")
    expect(page.get_attribute("body", "data-state") == "stale", "what is old looks live")
    told = page.inner_text(".banner:not(.alarm)")
    expect("reload" in told and told.strip().startswith("The server has ended"), f"the lost server is told as {told!r}")
    page.set_viewport_size({"width": 1280, "height": 720})
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    page.wait_for_timeout(200)
    box = page.locator(".banner:not(.alarm)").bounding_box()
    expect(0 <= box["y"] < 720, f"further down the lost server is not told: {box}")
    for part in [".cells", ".faultlist", ".control", ".byhand", ".joint", ".boardlist"]:
        background = page.locator(part).first.evaluate("one => getComputedStyle(one).backgroundImage")
        expect("gradient" in background, f"{part} looks live without a server")
    for part in [".control", ".drive", ".try", ".form", "section[aria-label=Recording]", ".joints"]:
        count = page.locator(f"{part} :is(button, input, select):not([disabled]):visible").count()
        expect(count == 0, f"{count} things of {part} can be pressed without a server")
    expect(page.locator(".faults :is(p, ol):visible").count() == 0, f"without a server a card asks for what cannot be pressed: {page.inner_text('.faults')!r}")
    page.keyboard.press("Space")
    expect("no connection" in page.inner_text(".answer"), f"Space without a server: {page.inner_text('.answer')!r}")
    page.keyboard.press("Escape")
    told = page.inner_text(".answer")
    expect("CUT THE AIR" in page.inner_text(".banner.alarm") and "STOP: not confirmed" in told, f"a stop without a server seems confirmed: {told!r}")


def without_the_key(browser, console):
    page = opened(browser, console, "")
    expect("needs a key" in page.inner_text("body"), "without a key the page does not say what it needs")
    page.context.close()
    page = opened(browser, console, "#k=abcdef")
    expect("is no key: a key has 64 digits" in page.inner_text("body"), f"what is no key: {page.inner_text('body')!r}")
    page.context.close()
    page = opened(browser, console, f"#k={'0' * 64}")
    page.wait_for_selector("[role=alert].alone")
    expect("is no key" not in page.inner_text("body"), "a key is none")
    expect("The key in the address is wrong" in page.inner_text("body"), f"a wrong key: {page.inner_text('body')!r}")
    page.context.close()


def journey(browser, console, folder):
    page = opened(browser, console, f"#k={console.keys['control']}")
    page.wait_for_selector(".joint")
    expect(console.keys["control"] not in page.url, "the key stays in the address")
    expect(waits(page, "State", ["disarmed"]), f"at first: {cell(page, 'State')}")
    records(page, True)
    expect(becomes_ready(page), f"Ready: {page.inner_text('.answer')!r}")
    told = page.inner_text(".answer")
    code = page.get_attribute(".control .answer", "title")
    expect(told.strip() == "Stand: done" and code == "Stand 0x0201, layer 1", f"an answer, and code and layer of its command: {told!r}, {code!r}")
    few_tabs(page)
    page_hangs(page)
    with Robot(console.address, console.keys["view"], role="view") as robot:
        undisturbed(page, robot, slider)
        undisturbed(page, robot, parameters)
        undisturbed(page, robot, walk_is_as_set)
        undisturbed(page, robot, space_holds)
        drives_by_hand(page, robot)
        drives_by_gamepad(page, robot)
        expect(becomes_ready(page), f"Ready after driving: {page.inner_text('.answer')!r}")
        walks_by_hand(page, robot)
        expect(becomes_ready(page), f"Ready after driving: {page.inner_text('.answer')!r}")
        in_space(page, robot, folder)
    expect(becomes_ready(page), f"Ready after a look in space: {page.inner_text('.answer')!r}")
    plots(page, folder)
    board_table(page)
    ground_goes_on(page)
    before = page.locator(".views .side svg").inner_html()
    expect(walks(page), f"Walk: {page.inner_text('.answer')!r}")
    expect(page.locator(".views .side svg").inner_html() != before, "the robot stands still on the page while it walks")
    page.evaluate("scrollTo(0, 0)")
    page.screenshot(path=folder / "walking.png")
    if page.locator(".buttons button", has_text="Stop walking").count():
        press(page, "Stop walking")

    page.select_option("select[aria-label=Fault]", "pot-open")
    targets = page.eval_on_selector_all("select[aria-label=Target] option", "list => list.map((o) => o.value)")
    expect(targets == [f"joint{n}" for n in range(1, 7)], f"targets: {targets}")
    page.select_option("select[aria-label=Target]", "joint3")
    expect(page.locator("input[aria-label=Value]").is_hidden(), "a fault without a value asks for one")
    inject = page.get_by_role("button", name="Inject")
    done_until_seen(page, inject.click, ".fault:has-text('Joint 3')", 5000)
    remedy = page.inner_text(".faults")
    expect("Joint 3 (left vertical)" in remedy and "potentiometer" in remedy, f"the fault and its remedy: {remedy!r}")
    expect("You have injected pot-open:joint3." in remedy, f"what is in the way: {remedy!r}")
    told = page.inner_text(".try .answer")
    expect("Inject: done" in told, f"beside Inject: {told!r}")
    expect(waits(page, "State", ["HOLD"]), f"after the fault: {cell(page, 'State')}")
    expect("No reading" in page.locator(".joint").nth(2).inner_text(), "the joint shows a reading all the same")
    expect(page.locator(".scope-plot .legend b").nth(1).inner_text() == "–", f"the plot shows a reading all the same: {page.inner_text('.scope-plot .legend')!r}")
    expect("error" not in page.locator(".joint").nth(2).inner_text(), "the joint shows an error of no reading")
    expect(page.locator(".joint.blind").count() == 1, "other joints show no reading, too")
    page.evaluate("scrollTo(0, 0)")
    page.screenshot(path=folder / "fault.png")
    records(page, False)
    lost_again(page)
    ends_by_key(page, inject)

    page.select_option("select[aria-label=Fault]", "bit-errors")
    expect(page.locator("select[aria-label=Target]").is_hidden(), "a fault of the whole robot asks for a target")
    page.focus("input[aria-label=Value]")
    page.keyboard.press("Escape")
    expect(waits(page, "State", ["STOPPED"]), f"after Esc: {cell(page, 'State')}")
    page.wait_for_timeout(300)
    told = page.inner_text(".faults")
    expect("Joints 1–6, wheels 7–8" in told, "equal faults of all boards are not one line")
    expect(re.search(r"Stopped by you, at [0-9.]+ s", told), f"who stopped: {told!r}")
    # A stop has no cause to remove; the sensor's fault, which is still latched, may have one.
    expect(told.count("Remove the cause") == ("SensorRange" in told), f"how to go on: {told!r}")
    events(page)
    events_alone(page)
    sees_what_was(browser, console, page.locator(".events li").count())
    return page


def ground(browser, program, folder):
    """The view from the side draws the ground of the scenario."""
    with tempfile.TemporaryDirectory() as home:
        console = Console(program, Path(home), scenario="slope-10")
        try:
            page = opened(browser, console, f"#k={console.keys['control']}")
            page.wait_for_selector(".joint")
            expect(becomes_ready(page), f"Ready on a slope: {page.inner_text('.answer')!r}")
            # Left to walk a little, it stands higher than where it began.
            walks(page)
            page.wait_for_timeout(4000)
            line = page.eval_on_selector(".r-near-edge", "line => line.getAttribute('points')")
            points = [tuple(map(float, point.split(","))) for point in line.split()]
            near = lambda x: min(points, key=lambda point: abs(point[0] - x))[1]
            # The near track is half a track to the right: 0.26 and 0.2 of it to the left and down.
            wheel = page.evaluate("() => [...document.querySelectorAll('.views .side svg > g > .r-tyre-face')].pop().parentElement.getAttribute('transform').match(/-?[0-9.]+/g).map(Number)")
            x, y, scale = wheel[0], wheel[1], wheel[2]
            wanted = 1000 * math.tan(math.radians(10))
            expect(abs(near(x) - near(x + 1000) - wanted) < 4, f"the drawn ground rises by {near(x) - near(x + 1000):.1f} mm in a metre, not {wanted:.1f}")
            below = near(x) - (y + 146 * scale)
            expect(-8 < below < 12, f"the ground is drawn {below:.1f} mm below the wheel")
            page.screenshot(path=folder / "slope.png")
            page.locator(".views .btn", has_text="3D").click()
            page.wait_for_timeout(1500)
            page.screenshot(path=folder / "slope-3d.png")
        finally:
            console.end()


def done_until_seen(page, act, selector, timeout):
    """Does something, again if what should come of it is not seen in time, ms."""
    for _ in range(ATTEMPTS):
        act()
        try:
            page.wait_for_selector(selector, timeout=timeout)
            return
        except Exception:
            continue


def few_tabs(page):
    """From the begin of the page the keyboard comes to STOP, and then to the control."""
    page.evaluate("() => { document.body.tabIndex = -1; document.body.focus(); document.body.removeAttribute('tabindex'); }")
    passed = []
    for _ in range(4):
        page.keyboard.press("Tab")
        passed.append(page.evaluate("document.activeElement.textContent"))
    expect(passed[0].startswith("STOP") and "control" in passed[1] and passed[2].startswith("Ready") and passed[3].startswith("Walk"), f"by Tab: {passed}")


def lost_again(page):
    """Who loses control while a board has a fault is told so, too; and how soon, if it was not the first time."""

    def lose():
        if cell(page, "Control") != "you":
            page.locator(".buttons button", has_text="Take control").click()
            expect(waits(page, "Control", ["you"]), f"control is not taken: {page.inner_text('.answer')!r}")
        page.evaluate("() => { const end = performance.now() + 900; while (performance.now() < end); }")

    done_until_seen(page, lose, ".fault:has-text('You lost control')", 3000)
    done_until_seen(page, lose, ".fault:has-text('You lost control again')", 3000)
    told = page.inner_text(".faults")
    expect(re.search(r"[0-9.]+ s after you had taken it", told) and "Joint 3 (left vertical)" in told, f"control that was lost again: {told!r}")
    press(page, "Clear fault")
    page.wait_for_function("() => document.querySelector('.answer').textContent.includes('Clear fault: refused')", timeout=5000)
    told = page.inner_text(".answer")
    expect(re.search(r"you lost control at [0-9.]+ s of the robot's clock: press Take control again", told), f"without control: {told!r}")
    page.locator(".buttons button", has_text="Take control").click()
    expect(waits(page, "Control", ["you"]) and "You lost control" not in page.inner_text(".faults"), f"with control: {page.inner_text('.faults')!r}")


def ends_by_key(page, inject):
    """Who ends a fault by keyboard, on its card, goes on at what is pressed next. A board that keeps its fault does not keep the others from being cleared."""
    press(page, "Clear fault")
    page.wait_for_function("() => document.querySelector('.answer').textContent.includes('Clear fault: refused')", timeout=5000)
    told = page.inner_text(".answer")
    expect("then clear it. The other boards no longer hold, and are disarmed. Injected: pot-open:joint3." in told or "Take control" in told, f"a fault that stays: {told!r}")
    page.get_by_role("button", name="End pot-open:joint3").focus()
    page.keyboard.press("Enter")
    page.wait_for_selector(".injected li", state="detached", timeout=5000)
    focused = page.evaluate("document.activeElement.textContent")
    expect(focused == "Clear fault", f"after the last End the focus is at {focused!r}")
    # What follows finds the fault as it was.
    inject.scroll_into_view_if_needed()


def stopped_by_another(page, viewer):
    """Everybody is told who has stopped the robot; its operator clears that, and Ready waits until the air is back."""
    expect(becomes_ready(page), f"Ready before a stop: {page.inner_text('.answer')!r}")
    viewer.click(".stop")
    expect(waits(page, "State", ["STOPPED"]), f"a viewer's stop: {cell(page, 'State')}")
    passes(page, 3)
    told = page.inner_text(".faults")
    expect("Stopped by another browser, with the view key, at" in told and "Make sure that nobody needs" in told and "Press Clear fault.\nPress Ready" in told, f"who stopped, for the operator: {told!r}")
    told = viewer.inner_text(".faults")
    expect("Stopped by you" in told and "you can only watch" in told and "press" not in told.lower(), f"who stopped, for the viewer: {told!r}")
    if cell(page, "Control") != "you":
        page.locator(".buttons button", has_text="Take control").click()
        waits(page, "Control", ["you"])
    press(page, "Clear fault")
    answers(page, "Clear fault")
    press(page, "Ready")
    try:
        page.wait_for_function("() => /^Ready waits for air: [0-9.]+ of 6.6 bar absolute/.test(document.querySelector('.answer').textContent)", timeout=10000)
    except PageTimeout:
        problems.append(f"Ready does not wait for air: {page.inner_text('.answer')!r}, {cell(page, 'Air')}")
    expect(answers(page, "Stand", READY_S) and waits(page, "State", ["ARMED"]), f"Ready after a stop: {page.inner_text('.answer')!r}")


def air_is_lost(page, robot):
    """Who has no air is told how much there is, and what to look at."""
    expect(becomes_ready(page), f"Ready before air is lost: {page.inner_text('.answer')!r}")
    page.select_option("select[aria-label=Fault]", "tube-burst")
    page.get_by_role("button", name="Inject").click()
    try:
        page.wait_for_selector(".fault:has-text('Supply pressure lost')", timeout=30000)
        told = page.inner_text(".faults")
        expect(re.search(r"Supply pressure lost: [0-9.]+ of 6.6 bar absolute", told) and "Check compressor" in told, f"lost air: {told!r}")
        words = {one["hold"]: one for one in robot.get("faults")["holds"]}["supply_lost"]
        expect(words["cause"] in told and words["remedy"] in told, f"a hold is not told in the words of the server: {told!r}, {words}")
        events = page.inner_text(".events")
        expect("fault tube-burst begins" in events, f"the event of a fault: {events[:300]!r}")
    except PageTimeout:
        problems.append(f"lost air: {cell(page, 'State')}, {page.inner_text('.faults')!r}")
    page.get_by_role("button", name="End", exact=True).click()
    page.wait_for_selector(".injected li", state="detached", timeout=5000)


def page_hangs(page):
    """A page that did not run for so long that its operator was lost says that it was the page."""

    def hang():
        expect(becomes_ready(page), f"Ready before a pause: {page.inner_text('.answer')!r}")
        page.evaluate("() => { const end = performance.now() + 900; while (performance.now() < end); }")

    done_until_seen(page, hang, ".fault:has-text('Operator lost')", 3000)
    told = page.inner_text(".faults")
    seconds = re.search(r"For ([0-9.]+) s this page did not run", told)
    expect(seconds and 0.5 < float(seconds[1]) < 5, f"a page that did not run: {told!r}")


def looks_only(browser, console):
    """Whoever has the view key may look and stop, whichever way the address has it."""
    for way in ["#v", "#k"]:
        looks_only_by(browser, console, way)


def looks_only_by(browser, console, way):
    page = opened(browser, console, f"{way}={console.keys['view']}")
    page.wait_for_selector(".joint")
    expect(cell(page, "You") == "watching only" and "view key" in page.inner_text(".answer"), "a viewer is not told that he is one")
    expect(waits(page, "State", ["STOPPED"]), "a viewer does not see the stop")
    for part in [".control", ".drive", ".try", ".form"]:
        expect(page.locator(f"{part} .btn:not([disabled])").count() == 0, f"a viewer can press buttons of {part}")
    page.click(".stop")
    expect(waits(page, "State", ["STOPPED"]), "a viewer cannot stop")
    expect(page.locator(".banner.alarm").is_hidden(), "a viewer's stop is not confirmed")
    page.context.close()


def looks(page, folder, axe):
    for scheme in ["light", "dark"]:
        page.emulate_media(color_scheme=scheme)
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            name = f"{width}-{scheme}"
            page.evaluate("scrollTo(0, 0)")
            page.wait_for_timeout(200)
            wide = page.evaluate("document.documentElement.scrollWidth")
            expect(wide <= width, f"{name}: {wide} px wide")
            box = page.locator(".stop").bounding_box()
            hit = box["width"] >= 96 and box["height"] >= 56
            seen = box["y"] >= 0 and box["y"] + box["height"] <= height and box["x"] + box["width"] <= width
            expect(hit and seen, f"{name}: STOP is at {box}")
            if width <= 1024:
                small = page.evaluate(SMALL)
                expect(not small, f"{name}: too small for a finger: {small[:5]}")
            cut = page.evaluate(CUT)
            expect(not cut, f"{name}: cut off: {cut}")
            page.screenshot(path=folder / f"{name}.png")
            page.screenshot(path=folder / f"{name}-whole.png", full_page=True)
            for finding in findings(page, axe):
                problems.append(f"{name}: {finding}")


def main(program, folder, axe):
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as home, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        console = Console(program, Path(home))
        try:
            without_the_key(browser, console)
            space_fails(browser, console)
            events_fail(browser, console)
            page = journey(browser, console, folder)
            looks_only(browser, console)
            ground(browser, program, folder)
            looks(page, folder, axe)
            with Robot(console.address, console.keys["view"], role="view") as robot:
                viewer = opened(browser, console, f"#v={console.keys['view']}")
                viewer.wait_for_selector(".joint")
                undisturbed(page, robot, stopped_by_another, viewer)
                viewer.context.close()
                undisturbed(page, robot, air_is_lost, robot)
            operator_leaves(page)
            console.end()
            repeats(program, console)
            server_is_gone(page)
            page.screenshot(path=folder / "gone.png")
        finally:
            console.end()
            browser.close()
    if problems or reported:
        print("\n".join(problems + reported))
        sys.exit(1)
    print(f"driven from the page; screenshots in {folder}")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), sys.argv[3])
