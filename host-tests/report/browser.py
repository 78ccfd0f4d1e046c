"""A report in a real browser, and checks of it."""

import sys


def check(what, holds):
    if not holds:
        sys.exit(f"error: {what}: no")
    print(f"  {what}")


class Report:
    """A report in its own window, with its errors and requests."""

    def __init__(self, browser, path, width=1100, height=900, **options):
        size = {"width": width, "height": height}
        self.address = path.resolve().as_uri()
        self.errors, self.requests = [], []
        self.window = browser.new_context(viewport=size, **options)
        self.page = self.window.new_page()
        self.page.on("console", lambda message: self.errors.append(message.text))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(self.address)
        self.settle()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        if error[0] is None:
            check(f"no errors {self.errors}", not self.errors)
            check("no request beside the file", self.requests == [self.address])
        self.window.close()

    def run(self, script):
        return self.page.evaluate(script)

    def settle(self):
        """Waits until the page is drawn."""
        if self.run("Boolean(document.querySelector('#interactive:not([hidden])'))"):
            twice = "requestAnimationFrame(() => requestAnimationFrame(done))"
            self.run(f"new Promise((done) => {twice})")

    def picture(self):
        """The picture of the point cloud."""
        self.settle()
        return self.run("document.getElementById('cloud').toDataURL()")

    def colours(self):
        """The number of colours drawn."""
        return self.run(
            """(() => {
                const { width, height } = document.getElementById("cloud");
                const context = document.getElementById("cloud").getContext("2d");
                const bytes = context.getImageData(0, 0, width, height).data;
                return new Set(new Uint32Array(bytes.buffer)).size;
            })()"""
        )

    def changes(self, what, act):
        """Checks that `act` changes the picture."""
        before = self.picture()
        act()
        check(f"{what} changes the picture", self.picture() != before)

    def width_is(self, width):
        wide = self.run("document.documentElement.scrollWidth")
        check(f"no scrolling sideways at {width} pixels", wide <= width)
