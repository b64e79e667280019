"""What tests do with a page in a browser."""


def settle(page):
    """Wait until what has changed is drawn."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def colour(page, canvas: str, col: int, row: int) -> list[int]:
    """Red, green and blue in the middle of an image pixel, where the whole image is in view."""
    settle(page)
    return page.evaluate(
        """([canvas, col, row]) => {
            const found = document.querySelector(canvas);
            const [x, y] = [(col + 0.5) * found.width / 64, (row + 0.5) * found.height / 64];
            return [...found.getContext("2d").getImageData(x, y, 1, 1).data.slice(0, 3)];
        }""",
        [canvas, col, row],
    )


def panel(method: str) -> str:
    return f'#grid .panel[data-method="{method}"] canvas'


def point_of(page, selector: str, col: float, row: float) -> tuple[float, float]:
    """Where an image pixel is on the screen."""
    page.locator(selector).scroll_into_view_if_needed()
    box = page.locator(selector).bounding_box()
    return box["x"] + (col + 0.5) * box["width"] / 64, box["y"] + (row + 0.5) * box["height"] / 64


def grey(value: float, level: float, width: float) -> list[int]:
    shown = min(1.0, max(0.0, (value - level) / width + 0.5))
    return [int(255 * shown + 0.5)] * 3


def set_slider(page, name: str, value: int):
    page.locator(f"#{name}").evaluate(
        "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }", value
    )
