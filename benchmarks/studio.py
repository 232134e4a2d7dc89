"""From a hand's move to the picture that shows it: the studio in Debian's Chromium, drawn by its software.

    python -m benchmarks.studio

For the beam and for a tower of 1,000 nodes: the time from an event at a slider to the draw of the state that
it asked for, one event after the other; then a drag of 60 frames with an event in each, and how many of them
showed a new state. Every state is a certified solve. The browser and the solver share the machine's cores.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from tensegra.structure import library, write_structure

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
SIZE = {"width": 1400, "height": 860}
EVENTS = 60

LATENCY = """([key, low, high, n]) => new Promise((resolve) => {
  const slider = document.querySelector(`input[type=range][data-key='${key}']`), viewer = tensegra.viewer;
  const times = [], solves = [];
  let start = 0, asked = null;
  const next = () => {
    if (times.length === n) { viewer.removeEventListener("draw", drawn); resolve([times, solves]); return; }
    slider.value = low + (high - low) * (times.length + 1) / n;
    asked = Number(slider.value);
    start = performance.now();
    slider.dispatchEvent(new Event("input"));
  };
  const drawn = () => {
    if (tensegra.state?.values[key] !== asked) return;
    times.push(performance.now() - start);
    solves.push(tensegra.state.milliseconds);
    asked = null;
    setTimeout(next, 30);
  };
  viewer.addEventListener("draw", drawn);
  next();
})"""
"""Milliseconds from each event to its draw, and of its solve."""

DRAG = """([key, low, high, n]) => new Promise((resolve) => {
  const slider = document.querySelector(`input[type=range][data-key='${key}']`), viewer = tensegra.viewer;
  let frame = 0, shown = null, states = 0;
  const drawn = () => { if (tensegra.state !== shown) { shown = tensegra.state; states += 1; } };
  viewer.addEventListener("draw", drawn);
  const start = performance.now();
  const tick = (now) => {
    if (frame === n) {
      viewer.removeEventListener("draw", drawn);
      resolve([states, performance.now() - start]);
      return;
    }
    frame += 1;
    slider.value = low + (high - low) * (1 - frame / n);
    slider.dispatchEvent(new Event("input"));
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
})"""
"""How many of n frames of a drag showed a new state, and the milliseconds that they took."""


def main() -> None:
    columns = "structure", "event → draw, median", "90 %", "of it the solve", "new states in 60 frames"
    print(f"| {' | '.join((*columns, 'frames a second'))} |")
    print(f"|{' --- |' * 6}")
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        tower = Path(folder) / "tower.json"
        write_structure(library.tower(n_stages=249, n_struts=4, guided_every=10), tower)
        beam = "the beam, 24 nodes", "library:paper_beam", "actuator:A14", 0.1
        large = "a tower, 1,000 nodes", str(tower), "actuator:chain0", 0.002
        for name, reference, key, high in (beam, large):
            measure(browser.new_page(viewport=SIZE), name, reference, key, high)
        browser.close()


def measure(page: Page, name: str, reference: str, key: str, high: float) -> None:
    """Print a row of the table."""
    start = "from tensegra.cli import main; main()"
    command = [sys.executable, "-c", start, "studio", reference, "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None  # noqa: S101 - it is piped
        page.goto(process.stdout.readline().strip())
        page.wait_for_selector("body[data-ready]")
        page.evaluate(LATENCY, [key, 0.0, high, 10])  # the first ones warm up
        times, solves = (np.array(row) for row in page.evaluate(LATENCY, [key, 0.0, high, EVENTS]))
        states, passed = page.evaluate(DRAG, [key, 0.0, high, EVENTS])
        process.terminate()
    print(
        f"| {name} | {np.median(times):.1f} ms | {np.percentile(times, 90):.1f} ms "
        f"| {np.median(solves):.1f} ms | {states} | {1e3 * EVENTS / passed:.0f} |"
    )


if __name__ == "__main__":
    main()
