"""Feeds the console's page with what a robot tells in eight hours, and looks at the memory that it has then.

    python3 check_page_hours.py WHEELEG [SCREENSHOTS AXE [HOURS]]

The messages are those of a robot that lives, repeated with later times as fast as the page takes them: every channel that it
looks at 50 times a second, its state 20 times a second, an event a second, with plots of every kind open. The bar is 150 MB of
the heap of its scripts; what grew since the first tenth is told beside it.
"""

import shutil
import sys
import tempfile
import time
from pathlib import Path

from check_console import FLAGS, Console, opened, problems, reported
from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[2] / "host-sim/console/python"))
from wheeleg import Robot

BAR_MB = 150.0
GROWS_MB = 16.0
# Simulated seconds that the page is given at once; in between it draws.
PIECE_S = 30

TAP = """
window.WebSocket = class extends WebSocket {
    constructor(...given) {
        super(...given);
        window.line = { socket: this, samples: new Map(), state: null };
        this.addEventListener("message", ({ data }) => {
            if (typeof data !== "string") window.line.samples.set(new DataView(data).getUint16(1, true), data.slice(0));
            else {
                const told = JSON.parse(data);
                if (told.op === "state") window.line.state = told;
            }
        });
    }
};
"""

# From here on the line is fed from within; answers still come.
BEGIN = """(event) => {
    const { line } = window;
    line.take = line.socket.onmessage;
    line.socket.onmessage = (message) => { if (typeof message.data === "string" && JSON.parse(message.data).op === "answer") line.take.call(line.socket, message); };
    line.ms = line.state.master_us / 1000;
    line.fed = 0;
    line.event = { op: "event", ...event };
    return line.samples.size;
}"""

FEED = """(seconds) => {
    const { line } = window;
    const give = (data) => { line.take.call(line.socket, { data }); line.fed += 1; };
    for (const end = line.ms + 1000 * seconds; line.ms < end; line.ms += 20) {
        const t_ns = BigInt(Math.round(line.ms)) * 1000000n;
        for (const data of line.samples.values()) {
            new DataView(data).setBigUint64(7, t_ns, true);
            give(data);
        }
        if (line.ms % 60 < 20) give(JSON.stringify({ ...line.state, master_us: Math.round(line.ms) * 1000 }));
        if (line.ms % 1000 < 20) give(JSON.stringify({ ...line.event, t_ns: Math.round(line.ms) * 1e6, text: `at ${line.ms} ms` }));
    }
    return new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(() => drawn(line.fed))));
}"""


def heap_mb(tools):
    for _ in range(2):
        tools.send("HeapProfiler.collectGarbage")
    used = tools.send("Runtime.getHeapUsage")
    # What typed arrays hold is beside the heap.
    return (used["usedSize"] + used.get("backingStorageSize", 0)) / 1e6


def main(program, _folder=None, _axe=None, hours=8.0):
    hours = float(hours)
    with tempfile.TemporaryDirectory() as home, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        console = Console(program, Path(home))
        try:
            page = opened(browser, console, f"#v={console.keys['view']}")
            page.wait_for_selector(".joint")
            page.context.add_init_script(TAP)
            # The key stays with the tab.
            page.reload()
            page.wait_for_selector(".joint")
            chosen = page.locator("select[aria-label='Add a plot']")
            for label in ("Feet, load", "/body pitch_deg"):
                chosen.select_option(label=label)
            page.wait_for_function("() => window.line.state?.ready && window.line.samples.size >= 19", timeout=30000)
            with Robot(console.address, console.keys["view"], role="view") as robot:
                event = robot.get("events?last=1")["events"][0]
            channels = page.evaluate(BEGIN, event)
            tools = page.context.new_cdp_session(page)
            begin, early_mb, worst_mb, fed = time.monotonic(), None, 0.0, 0
            pieces = max(int(hours * 3600 / PIECE_S), 10)
            for piece in range(1, pieces + 1):
                fed = page.evaluate(FEED, PIECE_S)
                if piece % max(pieces // 10, 1) == 0:
                    now_mb = heap_mb(tools)
                    early_mb = early_mb or now_mb
                    worst_mb = max(worst_mb, now_mb)
                    print(f"{piece * PIECE_S / 3600:.2f} h: {now_mb:.1f} MB", flush=True)
            shown = float(page.evaluate("() => [...document.querySelectorAll('.cell')].find((c) => c.firstChild.textContent === 'Time').lastChild.textContent").split()[0])
            lines = page.locator(".events li").count()
            took_s = time.monotonic() - begin
        finally:
            console.end()
            browser.close()
    assert not problems + reported, problems + reported
    assert shown >= 0.99 * pieces * PIECE_S, f"the page shows {shown} s of {pieces * PIECE_S} s"
    assert lines <= 500, f"{lines} events are kept"
    grew_mb = worst_mb - early_mb
    assert worst_mb <= BAR_MB and grew_mb <= GROWS_MB, f"{worst_mb:.1f} MB, {grew_mb:.1f} MB of it since the first tenth"
    print(f"page of {pieces * PIECE_S / 3600:.1f} h, {channels} channels, {fed} messages in {took_s:.0f} s: heap {worst_mb:.1f} MB at most (bar {BAR_MB:.0f}), {grew_mb:.1f} MB since the first tenth")


if __name__ == "__main__":
    main(*sys.argv[1:])
