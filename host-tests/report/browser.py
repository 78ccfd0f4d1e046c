"""A report in a real browser, and what is checked of it."""

import sys


def check(what, holds):
    if not holds:
        sys.exit(f"error: {what}: no")
    print(f"  {what}")


class Report:
    """A report in a window of its own, and everything it complained of or asked for."""

    def __init__(self, browser, path, width=1100, height=900, **options):
        size = {"width": width, "height": height}
        self.address = path.resolve().as_uri()
        self.complaints, self.requests = [], []
        self.window = browser.new_context(viewport=size, **options)
        self.page = self.window.new_page()
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(self.address)
        self.settle()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        if error[0] is None:
            check(f"no complaint {self.complaints}", not self.complaints)
            check("no request beside the file", self.requests == [self.address])
        self.window.close()

    def run(self, script):
        return self.page.evaluate(script)

    def settle(self):
        """Waits until what was asked for is drawn."""
        if self.run("Boolean(document.querySelector('#interactive:not([hidden])'))"):
            twice = "requestAnimationFrame(() => requestAnimationFrame(done))"
            self.run(f"new Promise((done) => {twice})")

    def picture(self):
        """What the point cloud shows."""
        self.settle()
        return self.run("document.getElementById('cloud').toDataURL()")

    def colours(self):
        """How many colours are drawn."""
        return self.run(
            """(() => {
                const { width, height } = document.getElementById("cloud");
                const context = document.getElementById("cloud").getContext("2d");
                const bytes = context.getImageData(0, 0, width, height).data;
                return new Set(new Uint32Array(bytes.buffer)).size;
            })()"""
        )

    def changes(self, what, act):
        """Whether the picture is another one after `act`."""
        before = self.picture()
        act()
        check(f"{what} changes the picture", self.picture() != before)

    def width_is(self, width):
        wide = self.run("document.documentElement.scrollWidth")
        check(f"no scrolling sideways at {width} pixels", wide <= width)
