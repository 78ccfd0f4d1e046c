"""The picture of the live page in docs/figures: a recording, half played."""

import shutil
import subprocess
import sys
import time
from pathlib import Path

from browser import check
from playwright.sync_api import sync_playwright

# Half of the demo's 0.2 s at this speed.
SPEED, SECONDS = 0.02, 5


def main(chromium, picture, dtof, recording):
    command = [Path(dtof).resolve(), "view", Path(recording).name, "--speed", str(SPEED)]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(recording).parent)
    try:
        address = program.stdout.readline().strip()
        with sync_playwright() as driver:
            # Root, as in a container, has no sandbox.
            browser = driver.chromium.launch(executable_path=shutil.which(chromium), args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1200, "height": 900}, color_scheme="light")
            errors = []
            page.on("pageerror", lambda error: errors.append(str(error)))
            page.goto(address)
            page.wait_for_selector("#playback:not([hidden])")
            time.sleep(SECONDS)
            check("it plays", page.inner_text("#state") == "playing")
            # Down to the end of the cloud.
            end = page.evaluate("document.getElementById('cloud').closest('section').getBoundingClientRect().bottom")
            page.screenshot(path=picture, full_page=True, clip={"x": 0, "y": 0, "width": 1200, "height": end + 16})
            check(f"no errors {errors}", not errors)
            browser.close()
    finally:
        program.terminate()


main(*sys.argv[1:])
