"""The viewer end to end: a real browser, without a screen, draws hands and follows the sliders."""

import shutil
import time

import numpy as np
import pytest

from ffhnet.apps.capture_options import NetworkOptions
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet

viser = pytest.importorskip("viser", reason="the viewer needs the extra `viewer`")
playwright = pytest.importorskip("playwright.sync_api", reason="the browser is driven by playwright")

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
ARGUMENTS = [
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
PATIENCE = 240  # s: a busy processor draws what a graphics processor should

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium: apt-get install chromium")


@pytest.fixture(scope="module")
def viewer():
    from ffhnet.apps.viewer import stage
    from ffhnet.apps.viewer.sight import Looker
    from ffhnet.apps.viewer.viewer import Viewer

    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    # Round fingers and shadows cost a processor most of its time.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stage, "MAX_FACES", 100)
        hand = load_hand()
        looker = Looker(FFHNet.from_pretrained(), hand, NetworkOptions(num=60))
        viewer = Viewer(server, hand, looker)
    server.scene.configure_default_lights(cast_shadow=False)
    viewer.panel.example.value = "spray_flask_2000005"
    viewer.server = server
    yield viewer
    server.stop()


@pytest.fixture(scope="module")
def page(viewer):
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=BROWSER, args=ARGUMENTS)
        page = browser.new_page(viewport={"width": 640, "height": 400})
        page.set_default_timeout(1000 * PATIENCE)
        page.complaints = []
        page.on("console", lambda m: page.complaints.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        page.on("request", lambda request: page.complaints.append(request.url) if away(request.url) else None)
        page.goto(f"http://127.0.0.1:{viewer.server.get_port()}")
        page.get_by_text("hands shown").wait_for()
        yield page
        browser.close()


def away(url):
    """Whether an address is not of this machine."""
    return not url.startswith(("http://127.0.0.1", "ws://127.0.0.1", "data:", "blob:"))


def hand_pixels(viewer):
    """How many pixels of the browser's picture have the yellow of a hand of high probability."""
    (client,) = viewer.server.get_clients().values()
    picture = client.get_render(height=120, width=120).astype(int)
    red, green, blue = np.moveaxis(picture[..., :3], -1, 0)
    # Yellow has almost as much green as red; the cloud is orange, and the table has as much blue.
    return int(((green > 0.8 * red) & (red > 1.5 * blue) & (red > 60)).sum())


def pixels_that(fit, viewer):
    """The first `hand_pixels` that fit, twice in a row: the browser still draws what the panel says."""
    end, last = time.monotonic() + PATIENCE, -1
    while not (fit(count := hand_pixels(viewer)) and count == last) and time.monotonic() < end:
        last = count
        time.sleep(0.2)
    return count


def type_number(page, label, value):
    """Types into the number beside a slider."""
    row = page.get_by_text(label, exact=True).locator("xpath=ancestor::*[.//input][1]")
    row.locator("input").last.fill(str(value))
    row.locator("input").last.press("Enter")


def test_hands_follow_the_sliders(viewer, page):
    page.get_by_text("5 hands shown").wait_for()
    many = pixels_that(lambda count: count > 100, viewer)
    assert many > 100

    type_number(page, "at most", 1)
    page.get_by_text("1 hands shown").wait_for()
    assert viewer.stage.crowd_size == 1
    one = pixels_that(lambda count: 0 < count < many, viewer)
    assert 0 < one < many

    type_number(page, "threshold", 1)
    page.get_by_text("0 hands shown").wait_for()
    assert pixels_that(lambda count: count < one / 5, viewer) < one / 5

    assert page.complaints == []
