"""Photographs a report in a real browser, light and dark; needs Chromium. `make report-pictures` calls this."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

PICTURES = Path(__file__).parent / "pictures"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
WIDTH, HEIGHT = 1280, 1720  # [px]
SHOWN = 900  # [px] width of the pictures
SCHEMES = {"dark": 0, "light": 1}  # Chromium's numbers


def photograph(page: Path, scheme: str, *, width: int = WIDTH, height: int = HEIGHT) -> Image.Image:
    """The top of a page as the browser shows it."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        sys.exit(f"no browser: install one of {', '.join(BROWSERS)}")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "page.png"
        options = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            f"--user-data-dir={folder}/profile",
            f"--blink-settings=preferredColorScheme={SCHEMES[scheme]}",
            f"--window-size={width},{height}",
            "--virtual-time-budget=3000",
            f"--screenshot={target}",
        ]
        subprocess.run([browser, *options, page.resolve().as_uri()], check=True, capture_output=True, timeout=300)
        with Image.open(target) as picture:
            return picture.convert("RGB")


if __name__ == "__main__":
    for scheme in SCHEMES:
        picture = photograph(Path(sys.argv[1]), scheme)
        small = picture.resize((SHOWN, round(SHOWN * picture.height / picture.width)), Image.Resampling.LANCZOS)
        small.save(PICTURES / f"report_{scheme}.webp", quality=82, method=6)
        print(PICTURES / f"report_{scheme}.webp")
