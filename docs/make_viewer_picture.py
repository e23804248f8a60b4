"""Makes docs/images/viewer.png, a picture of the viewer in headless Chromium.

Run it from the repository root: python docs/make_viewer_picture.py
"""

import shutil
from pathlib import Path

import viser
from playwright.sync_api import sync_playwright

from ffhnet.apps.capture_options import NetworkOptions, load_network
from ffhnet.apps.viewer.sight import Looker
from ffhnet.apps.viewer.viewer import Viewer

EXAMPLE = "box_2000024"
HANDS = 7
PICTURE = Path(__file__).parent / "images" / "viewer.png"
PATIENCE = 600_000  # ms: without a graphics processor a frame can take seconds
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def main() -> None:
    """Serves an example and photographs it."""
    options = NetworkOptions()
    network, hand = load_network(options)
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    viewer = Viewer(server, hand, Looker(network, options))
    viewer.panel.count.value = HANDS
    viewer.panel.example.value = EXAMPLE
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
        page = browser.new_page(viewport={"width": 1200, "height": 720})
        page.set_default_timeout(PATIENCE)
        page.goto(f"http://127.0.0.1:{server.get_port()}")
        page.get_by_text("hands shown").wait_for()
        # Viser warns of the slow drawing that nobody with a graphics processor sees.
        page.add_style_tag(content=".mantine-Notifications-root { display: none }")
        page.evaluate("() => new Promise(r => setTimeout(() => requestAnimationFrame(r), 20000))")
        page.screenshot(path=PICTURE)
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
