#!/usr/bin/env python3
"""The report of raceloc-eval in a browser without a window: no complaint on its console, and pictures that answer.

usage: page_in_browser.py PATH_OF_RACELOC_EVAL
Exit status: 0 good, 1 not, 77 chromium or gnuplot is not installed (skipped).
"""
import math
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

# Acts on the first picture of curves with a key, after gnuplot's own script has taken hold of it at `load`.
PROBE = """
<script>
window.addEventListener('load', () => setTimeout(() => {
  const answers = [];
  const svgs = [...document.querySelectorAll('svg')].filter(s => s.getElementById('gnuplot_canvas'));
  answers.push('alive ' + svgs.filter(s => s.gnuplot).length + ' of ' + svgs.length);
  const key = document.getElementById('distribution_plot_1_keyentry');
  const curve = document.getElementById('distribution_plot_1');
  key.dispatchEvent(new MouseEvent('click', {bubbles: true}));
  answers.push('curve ' + curve.getAttribute('visibility'));
  const svg = key.ownerSVGElement, box = svg.getBoundingClientRect();
  const at = {bubbles: true, clientX: box.left + box.width / 2, clientY: box.top + box.height / 2};
  svg.dispatchEvent(new MouseEvent('click', at));
  answers.push('values ' + svg.getElementById('coord_text').textContent.trim());
  const before = svg.getAttribute('viewBox');
  svg.dispatchEvent(new WheelEvent('wheel', {bubbles: true, deltaY: 1}));
  answers.push('wheel ' + (svg.getAttribute('viewBox') === before ? 'scrolls' : 'zooms'));
  svg.dispatchEvent(new WheelEvent('wheel', {bubbles: true, deltaY: 1, ctrlKey: true}));
  answers.push('ctrl-wheel ' + (svg.getAttribute('viewBox') === before ? 'scrolls' : 'zooms'));
  document.title = 'PROBE ' + answers.join('; ') + ' END';
}, 100));
</script>
"""


def write_drive(path, offset_m):
    with open(path, "w") as file:
        for i in range(300):
            angle = 0.02 * i
            x, y = 50 * math.sin(angle), 50 - 50 * math.cos(angle)
            y += offset_m * math.sin(i / 7)
            file.write(f"{1e9 + 0.1 * i:.6f} {x:.4f} {y:.4f} 0 0 0 {math.sin(angle / 2):.9f} {math.cos(angle / 2):.9f}\n")


def main():
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None or shutil.which("gnuplot") is None:
        print("skipped: chromium or gnuplot is not installed")
        return 77
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        truth, estimate, page = folder / "truth.tum", folder / "estimate.tum", folder / "page.html"
        write_drive(truth, 0)
        write_drive(estimate, 0.1)
        subprocess.run([sys.argv[1], "--truth", truth, "--estimate", estimate, "--report", page], check=True,
                       stdout=subprocess.DEVNULL)
        page.write_text(page.read_text().replace("</body>", PROBE + "</body>"))
        run = subprocess.run([browser, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}",
                              "--enable-logging=stderr", "--virtual-time-budget=5000", "--dump-dom", f"file://{page}"],
                             capture_output=True, text=True, timeout=120)
    complaints = [line for line in run.stderr.splitlines() if "CONSOLE" in line]
    start = run.stdout.find("<title>PROBE ")
    answers = run.stdout[start + 13:run.stdout.find(" END</title>")].split("; ") if start >= 0 else []
    print("\n".join(complaints + answers))
    said = dict(answer.split(" ", 1) for answer in answers if " " in answer)
    alive, _, all_of_them = said.get("alive", "0 of 1").partition(" of ")
    good = (not complaints and alive == all_of_them and int(alive) >= 8 and said.get("curve") == "hidden" and
            said.get("values", "") != "" and said.get("wheel") == "scrolls" and said.get("ctrl-wheel") == "zooms")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
