"""Makes docs/images/viewer.png: ranked hands, and the end of a trial, in headless Chromium, side by side.

Run it from the repository root: python docs/make_viewer_picture.py
"""

import io
import shutil
from pathlib import Path

import viser
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from ffhnet.apps.capture_options import NetworkOptions, load_network
from ffhnet.apps.viewer.sight import Looker
from ffhnet.apps.viewer.viewer import Viewer

EXAMPLE = "spray_flask_2000005"
HANDS = 3
PICTURE = Path(__file__).parent / "images" / "viewer.png"
SCENE, PANEL, HEIGHT = 640, 320, 930  # pixels
PATIENCE = 600_000  # ms: without a graphics processor a frame can take seconds
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def photograph(page: Page) -> Image.Image:
    """The page after everything has been sent and drawn."""
    page.evaluate("() => new Promise(r => setTimeout(() => requestAnimationFrame(r), 15000))")
    return Image.open(io.BytesIO(page.screenshot()))


def main() -> None:
    """All hands on the left; one that has lifted the object, and the panel, on the right."""
    options = NetworkOptions()
    network, hand = load_network(options)
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    viewer = Viewer(server, hand, Looker(network, hand, options))
    viewer.panel.count.value = HANDS
    viewer.panel.example.value = EXAMPLE
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
        page = browser.new_page(viewport={"width": SCENE + PANEL, "height": HEIGHT})
        page.set_default_timeout(PATIENCE)
        page.goto(f"http://127.0.0.1:{server.get_port()}")
        page.get_by_text("hands shown").wait_for()
        # Viser warns of the slow drawing that nobody with a graphics processor sees.
        page.add_style_tag(content=".mantine-Notifications-root { display: none }")
        everything = photograph(page)
        viewer.panel.grasp.value = viewer.panel.grasp.options[1]
        page.get_by_role("button", name="Try it in physics").click()
        page.get_by_text("held: the object rose").wait_for()
        one = photograph(page)
        browser.close()
    server.stop()
    picture = Image.new("RGB", (2 * SCENE + PANEL, HEIGHT))
    picture.paste(everything.crop((0, 0, SCENE, HEIGHT)))
    picture.paste(one, (SCENE, 0))
    picture.save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
