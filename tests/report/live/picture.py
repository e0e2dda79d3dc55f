"""The picture of `sainet play` in docs/figures/, taken from the page itself.

`PYTHONPATH=tests python -m report.live.picture` takes it again.
"""

import base64
import io
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from selenium.webdriver import ActionChains

from conftest import chromium
from report.live.test_play_browser import ghosts, opened, point_beside_disk_1, text
from report.test_report_browser import wait_until
from support import REPOSITORY

PICTURE = REPOSITORY / "docs" / "figures" / "play.png"
_SIZE = {"width": 1120, "height": 752, "deviceScaleFactor": 1.5, "mobile": False}
_COLOURS = 128


def take(path: Path) -> None:
    """Drag disk 2 to the side of disk 1, and point at a push of disk 1."""
    with (
        TemporaryDirectory() as folder,
        opened(chromium.__wrapped__(), Path(folder)) as page,
    ):
        page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", _SIZE)
        page.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})
        disk = page.find_element("id", "disk-2")
        ActionChains(page, 50).drag_and_drop_by_offset(disk, -30, -62).perform()
        wait_until(lambda: "Ready" in text(page, "status"))
        page.execute_script("document.activeElement.blur()")
        point_beside_disk_1(page, -90, 0)  # the first prediction compiles
        wait_until(lambda: len(ghosts(page)) == 6)
        before = ghosts(page)
        point_beside_disk_1(page, -60, 75)
        wait_until(lambda: ghosts(page) != before)
        time.sleep(1)
        shot = page.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})
    picture = Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB")
    picture.quantize(_COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    take(PICTURE)
