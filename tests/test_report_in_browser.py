"""The report in a browser: nothing is wrong, nothing is too wide, the rig can be turned by keys."""

import json
import re
import shutil
import subprocess

import pytest

from atom_core import cli
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

BROWSER = shutil.which("chromium-headless-shell") or shutil.which("chromium")
# Runs in the page when the rig is drawn, and leaves what it measured in an element.
PROBE = """
<script>
(async function () {
  const viewer = document.getElementById("viewer");
  for (let i = 0; i < 600 && !viewer.dataset.ready; i++) {
    await new Promise((done) => setTimeout(done, 50));
  }
  const root = document.documentElement;
  const wide = [...document.querySelectorAll("body *")].filter((one) =>
    one.getBoundingClientRect().right > root.clientWidth + 1 &&
    !one.closest(".matrix, svg, .viewer, .skip"));
  const eye = () => JSON.stringify(viewer._fullLayout.scene.camera.eye);
  const before = eye(), traces = viewer.data.length;
  document.querySelector("[data-turn]").click();
  await new Promise((done) => setTimeout(done, 500));
  document.getElementById("show-boards").click();
  await new Promise((done) => setTimeout(done, 500));
  const found = {
    ready: viewer.dataset.ready || "no", width: root.clientWidth, scroll: root.scrollWidth,
    wide: wide.slice(0, 5).map((one) => one.tagName + "." + one.className),
    turned: before !== eye(), fewer: viewer.data.length < traces,
    unreachable: [...document.querySelectorAll("button, select, input, summary, a")]
      .filter((one) => one.tabIndex < 0).length,
    unnamed: [...document.querySelectorAll("input, select")]
      .filter((one) => !one.labels.length).length,
  };
  const answer = document.createElement("pre");
  answer.id = "probe";
  answer.textContent = JSON.stringify(found);
  document.body.append(answer);
})();
</script>
"""

pytestmark = [
    pytest.mark.long,  # Chromium takes 280 MB of disk: make setup does not install it
    pytest.mark.skipif(
        BROWSER is None, reason="needs Chromium: apt-get install chromium-headless-shell"
    ),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Return the report of a small rig, with a probe."""
    folder = tmp_path_factory.mktemp("report")
    scene = scenes.random_scene(2, collections=4, disturbance=(0.03, 0.03))
    write_dataset_folder(scene.dataset, folder / "data", name="train")
    words = ["calibrate", "--dataset", str(folder / "data" / "dataset.json"), "--no_report"]
    assert cli.main([*words, "--output", str(folder / "results")]) == 0
    assert cli.main(["report", "--calibration", str(folder / "results")]) == 0
    path = folder / "results" / "report.html"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("</body>", PROBE + "</body>"), encoding="utf-8")
    return path


@pytest.mark.parametrize("width, height", [(1280, 800), (390, 844)])
def test_the_report_works_at(page, tmp_path, width, height):
    done = subprocess.run(
        [
            BROWSER,
            *("--headless", "--no-sandbox", "--hide-scrollbars", "--disable-dev-shm-usage"),
            *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--mute-audio"),
            *("--enable-logging=stderr", f"--user-data-dir={tmp_path}", "--dump-dom"),
            *(f"--window-size={width},{height}", "--virtual-time-budget=40000"),
            page.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    told = re.findall(r"CONSOLE[:(]\d+\)?\] (.*)", done.stderr)
    assert not [line for line in told if "willReadFrequently" not in line], told  # a hint on speed
    answer = re.search(r'<pre id="probe">(.*?)</pre>', done.stdout)
    assert answer, done.stderr[-2000:]
    found = json.loads(answer.group(1))
    assert found["width"] == width and found["scroll"] <= width
    expected = {"ready": "yes", "wide": [], "turned": True, "fewer": True}
    expected.update(unreachable=0, unnamed=0)
    assert {name: found[name] for name in expected} == expected
