"""What becomes of a console's page whose line, server, view or time is gone, in a browser.

    python3 check_console_lines.py WHEELEG SCREENSHOTS AXE

A second browser is refused, is handed the control over and gives it back, and may stop. A line that goes dead in mid-walk, a page that freezes and one that is hidden
lose the robot, which holds and says whose it was; when they are back they move nothing. What comes late over a slow
line is marked as old. A server that is gone is told, and one that is there again moves nothing. Real boards are
shown without what they do not tell. Over plain HTTP the page looks and stops.
"""

import contextlib
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from pathlib import Path

import check_console
from check_console import FLAGS, Console, Robot, becomes_ready, cell, expect, opened, press, problems, reported, waits, walks
from playwright.sync_api import sync_playwright
from relay import Relay

# The browser comes by this address, so that its line can be tampered with.
NEAR = "127.0.0.2"
# Far longer than a master waits for an operator.
FROZEN_MS = 3000


def lost(robot, what):
    """The master holds the robot of an operator who is gone, and the events name them."""
    try:
        robot.until(lambda state: state["hold"] == "operator_lost", 5)
    except TimeoutError:
        problems.append(f"{what}: the robot is not held: {robot.state()}")
        return
    held = [event for event in robot.events() if event["detail"] == "operator_lost"]
    expect(held and held[-1]["holder"] == "browser", f"{what}: the events do not name the operator: {held[-1:]}")
    robot.until(lambda state: state["control"] is None, 2)


def moves_nothing(robot, what):
    """For two seconds nobody is in control, and the robot is held."""
    begin = time.monotonic()
    while time.monotonic() - begin < 2:
        state = robot.state()
        if state["control"] or not state["hold"] or state["stepping"]:
            problems.append(f"{what}: {state}")
            return
        time.sleep(0.1)


def tried(page, folder, what, act, *arguments):
    """What of it goes wrong is told with what the page showed, and the rest is looked at all the same."""
    print(f"{what} …", flush=True)
    try:
        return act(*arguments)
    except Exception as error:
        where = "; ".join(f"line {frame.lineno}" for frame in traceback.extract_tb(error.__traceback__) if "/tests/python/" in frame.filename)
        shown = ""
        # A page that hangs cannot be asked either.
        with contextlib.suppress(Exception):
            page.set_default_timeout(5000)
            page.screenshot(path=folder / f"failed-{what.replace(' ', '-')}.png")
            shown = page.inner_text("header") + " | " + page.inner_text(".answer")
            page.set_default_timeout(30000)
        problems.append(f"{what}: {type(error).__name__} ({where}): {str(error)[:400]}; the page showed {shown!r}")
        return None


def recovers(page):
    page.bring_to_front()
    expect(becomes_ready(page), f"does not recover: {page.inner_text('.answer')!r}")


def macs(page):
    """The page's own HMAC-SHA256 is the browser's, of data of any length."""
    differs = page.evaluate("""async () => {
        const { hmac } = await import("/mac.js");
        const key = Uint8Array.from({ length: 32 }, (_, i) => 7 * i + 3);
        const theirs = await crypto.subtle.importKey("raw", key, { name: "HMAC", hash: "SHA-256" }, false, ["sign"]);
        const differs = [];
        for (let length = 0; length < 300; length += 1) {
            const data = Uint8Array.from({ length }, (_, i) => 31 * i + length);
            const wanted = new Uint8Array(await crypto.subtle.sign("HMAC", theirs, data));
            if (hmac(key, data).join() !== wanted.join()) differs.push(length);
        }
        return differs;
    }""")
    expect(differs == [], f"MACs differ from the browser's at lengths {differs[:9]}")


def second_browser(browser, console, first, robot):
    second = opened(browser, console, f"#k={console.keys['control']}")
    second.wait_for_selector(".joint")
    # Its window may have come before the first one, whose page then does not beat.
    for _ in range(check_console.ATTEMPTS):
        recovers(first)
        expect(waits(second, "Control", ["browser"]), "the second does not see who is in control")
        # Pressed without its window coming to the front.
        second.locator(".buttons button", has_text="Take control").dispatch_event("click")
        second.wait_for_timeout(500)
        if "browser is in control" in second.inner_text(".answer"):
            break
    expect("refused" in second.inner_text(".answer"), f"a second takes the control: {second.inner_text('.answer')!r}")
    expect("asks for the control" in first.inner_text(".answer"), f"the first is not told: {first.inner_text('.answer')!r}")
    expect(robot.state()["armed"], "the first is disturbed")
    hands_over(first, second, robot)
    second.locator(".stop").dispatch_event("click")
    expect(waits(first, "State", ["STOPPED"]), "a second cannot stop the first")
    second.context.close()
    recovers(first)


def hands_over(first, second, robot):
    """Who is in control gives it to who has asked, and gets it back; neither is disturbed."""
    for giver, taker in ((first, second), (second, first)):
        reserved = False
        for _ in range(check_console.ATTEMPTS):
            giver.bring_to_front()
            if cell(giver, "Control") != "you":
                recovers(giver)
            taker.locator(".buttons button", has_text="Take control").dispatch_event("click")
            give = giver.get_by_role("button", name="Hand the control over")
            with contextlib.suppress(Exception):
                give.wait_for(timeout=3000)
                give.click(timeout=1000)
                taker.wait_for_function("() => document.querySelector('.answer').textContent.includes('to you')", timeout=2000)
            reserved |= waits(taker, "Control", ["reserved for you"], 0.3)
            taker.bring_to_front()
            taker.locator(".buttons button", has_text="Take control").dispatch_event("click")
            if waits(taker, "Control", ["you"], 3):
                break
        expect(reserved, "the page does not show for whom control is reserved")
        expect(cell(taker, "Control") == "you", f"handed over: {taker.inner_text('.answer')!r}")
    expect(robot.state()["control"]["holder"] == "browser", "nobody is in control after a hand-over")


def dead_line(page, robot, relay):
    expect(walks(page), f"Walk: {page.inner_text('.answer')!r}")
    relay.dead.set()
    begin = time.monotonic()
    page.wait_for_selector("body[data-state=stale]", timeout=3000)
    took = time.monotonic() - begin
    expect(took < 1.5, f"a dead line is shown after {took:.1f} s")
    expect("old" in page.inner_text(".banner:not(.alarm)"), "a dead line is not told")
    lost(robot, "a dead line")
    page.click(".stop")
    page.wait_for_selector(".banner.alarm:not([hidden])", timeout=2000)
    expect("CUT THE AIR" in page.inner_text(".banner.alarm"), "a stop over a dead line seems confirmed")
    press(page, "Walk")
    relay.dead.clear()
    # What was pressed meanwhile arrives now: the stop counts, the walk does not.
    expect(waits(page, "State", ["STOPPED"]), f"after a dead line: {cell(page, 'State')}")
    moves_nothing(robot, "after a dead line")
    recovers(page)


def slow_line(page, robot, relay, folder):
    """The line delivers all, and late: what arrives is old, however steadily it comes."""
    relay.delay_s = 0.8
    try:
        page.wait_for_function("() => document.body.dataset.state === 'stale' && /old/.test(document.querySelector('.banner:not(.alarm)').textContent)", timeout=5000)
        page.wait_for_timeout(1500)
        states = [page.get_attribute("body", "data-state") for _ in range(20) if page.wait_for_timeout(30) is None]
        expect(states.count("stale") >= 15, f"what comes 0.8 s late looks live: {states}")
        page.screenshot(path=folder / "slow-line.png")
    except Exception:
        problems.append("what comes 0.8 s late looks live")
    lost(robot, "a slow line")
    relay.delay_s = 0.0
    page.wait_for_selector("body[data-state=live]", timeout=10000)
    moves_nothing(robot, "after a slow line")
    recovers(page)


def frozen_page(page, robot):
    expect(walks(page), f"Walk: {page.inner_text('.answer')!r}")
    # The browser's own way to freeze a page leaves one in the foreground alone at times.
    page.evaluate("ms => { setTimeout(() => { const end = performance.now() + ms; while (performance.now() < end); }, 0); }", FROZEN_MS)
    lost(robot, "a frozen page")
    time.sleep(FROZEN_MS / 1e3)
    moves_nothing(robot, "a page that is awake again")
    recovers(page)


def hidden_page(page, robot):
    expect(walks(page), f"Walk: {page.inner_text('.answer')!r}")
    page.evaluate("""() => {
        Object.defineProperty(document, "hidden", { value: true, configurable: true });
        document.dispatchEvent(new Event("visibilitychange"));
    }""")
    robot.until(lambda state: not state["stepping"] and state["phase"] != "walk", 5)
    expect(waits(page, "Gait", ["hold", "idle", "ready"]), f"a hidden page: {cell(page, 'Gait')}")
    page.evaluate("() => { delete document.hidden; }")
    recovers(page)


def server_again(program, home, console, page, browser):
    """The server ends and is there again, under the same address and keys."""
    listen = "127.0.0.1:" + console.address.rsplit(":", 1)[1]
    console.end()
    try:
        page.wait_for_function("() => [...document.querySelectorAll('.banner:not(.alarm):not([hidden])')].some((b) => b.textContent.includes('reload'))", timeout=5000)
    except Exception:
        problems.append(f"a server that is gone is not told: {page.inner_text('body')[:300]!r}")
    expect(page.get_attribute("body", "data-state") == "stale", "without a server the page looks live")
    again = Console(program, home, listen, "--name", NEAR)
    page.reload()
    page.wait_for_selector(".joint", timeout=10000)
    expect(waits(page, "State", ["disarmed"]) and cell(page, "Control") == "free", f"after a restart: {cell(page, 'State')}")
    with Robot(listen, again.keys["view"], role="view") as robot:
        begin = robot.state()["master_us"]
        robot.until(lambda state: state["master_us"] > begin + 1_500_000, 10)
        state = robot.state()
        expect(state["control"] is None and not state["armed"], f"a page that reconnects moves something: {state}")
    page.context.close()
    return again


def real_boards(program, browser, home, folder):
    """Boards at a port tell neither attitude nor forces: nothing on the page is made up, and no number is broken."""
    boards = subprocess.Popen([program, "boards", "--pty"], stdout=subprocess.PIPE, text=True)
    try:
        port = boards.stdout.readline().split()[-1]
        console = Console(program, home, "127.0.0.1:0", "--robot", "wheeleg", "--port", port)
        try:
            page = opened(browser, console, f"#v={console.keys['view']}")
            page.wait_for_selector(".joint")
            page.wait_for_timeout(1500)
            broken = page.evaluate("() => [...document.querySelectorAll('svg *')].filter((e) => [...e.attributes].some((a) => /NaN|undefined/.test(a.value))).length")
            expect(broken == 0, f"{broken} parts of the drawings have no number")
            text = page.inner_text("body")
            expect("not measured" in text, "what real boards do not tell is not named")
            expect("NaN" not in text and "false" not in text, "the page shows words of the machine")
            expect(not page.get_by_role("button", name="Inject").count(), "faults can be tried on real boards")
            page.get_by_role("button", name="3D").click()
            page.wait_for_timeout(1500)
            page.screenshot(path=folder / "real-boards.png")
            page.context.close()
        finally:
            console.end()
    finally:
        boards.terminate()
        boards.wait()


def plain_http(program, playwright, home, folder):
    """Over plain HTTP from elsewhere a browser has no cryptography: the page looks and stops, says that it is not protected, and
    sends no key."""
    # A name that no browser takes for this computer.
    rules = "--host-resolver-rules=MAP robot.test 127.0.0.1"
    browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=[*FLAGS, rules])
    console = Console(program, home, "0.0.0.0:0", "--name", "robot.test", "--plain-http")
    sent = []
    try:
        expect(console.address.startswith("http://robot.test:"), f"served at {console.address}")
        watched = lambda page: page.on("request", lambda request: sent.append(f"{request.url} {request.headers}"))
        page = opened(browser, console, f"#v={console.keys['view']}", prepare=watched)
        page.wait_for_selector(".joint")
        expect(not page.evaluate("isSecureContext"), "the browser takes plain HTTP for secure")
        expect(waits(page, "State", ["disarmed"]), f"over plain HTTP: {cell(page, 'State')}")
        expect("Not protected" in page.inner_text("body"), "over plain HTTP the page does not say that it is not protected")
        expect(page.locator(".buttons .btn:not([disabled])").count() == 0, "over plain HTTP buttons can be pressed")
        page.screenshot(path=folder / "plain-http.png")
        page.click(".stop")
        expect(waits(page, "State", ["STOPPED"]), "over plain HTTP nobody can stop")
        expect(page.locator(".banner.alarm").is_hidden(), "over plain HTTP a stop is not confirmed")
        page.context.close()
        page = opened(browser, console, f"#k={console.keys['control']}", prepare=watched)
        page.wait_for_selector("[role=alert].alone")
        expect("plain HTTP" in page.inner_text("body"), f"driving over plain HTTP: {page.inner_text('body')!r}")
        page.context.close()
        keys = [console.keys[name] for name in ("control", "view")]
        expect(sent and not any(key in text for key in keys for text in sent), f"a key is sent: {sent}")
        # The browser tells that a header of ours counts over HTTPS alone.
        reported[:] = [line for line in reported if "Cross-Origin-Opener-Policy" not in line]
    finally:
        console.end()
        browser.close()


def main(program, folder, _axe=None):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as home, sync_playwright() as playwright:
        home = Path(home)
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        console = Console(program, home, "127.0.0.1:0", "--name", NEAR)
        # The address that the server prints is the relay's: who watches comes past it.
        port = int(console.address.rsplit(":", 1)[1])
        listen = f"127.0.0.1:{port}"
        try:
            with Relay((NEAR, port), ("127.0.0.1", port)) as relay, Robot(listen, console.keys["view"], role="view") as robot:
                page = opened(browser, console, f"#k={console.keys['control']}", address=f"http://{NEAR}:{port}")
                page.wait_for_selector(".joint")
                robot.until(lambda state: state["ready"])
                recovers(page)
                macs(page)
                tried(page, folder, "second browser", second_browser, browser, console, page, robot)
                for what, act in [
                    ("dead line", lambda: dead_line(page, robot, relay)),
                    ("slow line", lambda: slow_line(page, robot, relay, folder)),
                    ("frozen page", lambda: frozen_page(page, robot)),
                    ("hidden page", lambda: hidden_page(page, robot)),
                ]:
                    tried(page, folder, what, act)
                    relay.dead.clear()
                    relay.delay_s = 0.0
                robot.close()
                again = tried(page, folder, "server again", server_again, program, home, console, page, browser)
                console = again or console
            console.end()
            tried(page, folder, "real boards", real_boards, program, browser, home, folder)
            tried(page, folder, "plain HTTP", plain_http, program, playwright, home, folder)
        finally:
            console.end()
            browser.close()
    if problems or reported:
        print("\n".join(problems + reported))
        sys.exit(1)
    assert threading.active_count() < 4
    print("lines, servers, views and time went, and nothing moved unseen")


if __name__ == "__main__":
    main(*sys.argv[1:])
