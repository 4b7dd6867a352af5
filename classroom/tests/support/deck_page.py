"""A deck in the browser, used by keys as an instructor does."""

from __future__ import annotations

from support.lab_page import PANEL, LabPage

SLIDE_DRAWN = f"""index => {{
    const widgets = {PANEL}.content.widgets;
    const slide = widgets.filter(cell => cell.node.classList.contains('deck-on'));
    const drawn = cell => cell.model.type === 'code'
        ? cell.inputHidden || cell.node.querySelectorAll('.cm-line').length
            >= cell.model.sharedModel.getSource().split('\\n').length
        : cell.rendered && cell.node.querySelector('.jp-RenderedMarkdown').childElementCount;
    return slide.includes(widgets[index])
        && widgets[index].node.contains(document.activeElement)
        && slide.every(drawn)
        && slide.every(cell => [...cell.node.querySelectorAll('img')].every(img => img.complete));
}}"""
SLIDES_SHOWN = "() => document.querySelector('.jp-Deck .deck-on')?.isConnected"
# What of a slide is cut off at a side, or needs a scroll bar of its own.
CUT_OFF = f"""() => {PANEL}.content.widgets.flatMap((cell, index) => {{
    if (!cell.node.classList.contains('deck-on')) return [];
    const found = [];
    const box = cell.node.getBoundingClientRect();
    if (box.left < 0 || box.right > innerWidth)
        found.push(`cell ${{index}} ends at ${{box.right.toFixed()}}`);
    for (const part of cell.node.querySelectorAll(
        '.cm-scroller, .jp-RenderedMarkdown, .jp-OutputArea-output, pre, table, img')) {{
        const inner = part.getBoundingClientRect();
        if (part.scrollWidth > part.clientWidth + 1 || inner.right > innerWidth
            || (part.clientHeight && part.scrollHeight > part.clientHeight + 1))
            found.push(`cell ${{index}}: ${{part.tagName}}.${{part.className}} is cut off`);
        if (part.tagName === 'IMG' && !part.naturalWidth)
            found.push(`cell ${{index}}: a picture is missing`);
        if (part.tagName === 'IMG' && !part.alt)
            found.push(`cell ${{index}}: a picture has no alternative text`);
    }}
    return found;
}})"""


class DeckPage(LabPage):
    """One tab of the browser, on a server that `make present` started."""

    def present(self, name: str) -> None:
        """Open the copy of a notebook as slides, from the first, and wait for its kernel."""
        self.goto(f'lab/workspaces/present/tree/presentation/{name}')
        self.wait_for_notebook(f'presentation/{name}')
        self.page.wait_for_function(SLIDES_SHOWN)
        self.page.keyboard.press('Home')
        self.wait_for_slide(0)

    def press(self, key: str) -> int:
        """Press a key that leads to another cell, and return its index once it is shown."""
        active = self.leave_with(key)
        self.wait_for_slide(active)
        return active

    def go_on(self) -> int:
        """Press Space until the next slide is shown, and return its active cell."""
        number = self.page.text_content('#deck-head span')
        while self.page.text_content('#deck-head span') == number:
            self.page.keyboard.press('Space')
        active = self.active()
        self.wait_for_slide(active)
        return active

    def wait_for_slide(self, index: int) -> None:
        """Wait until a cell is revealed and has the focus, and all of its slide is drawn."""
        self.page.wait_for_function(SLIDE_DRAWN, arg=index)

    def walk_to(self, cell: str) -> None:
        """Press Space until the cell with this id is shown, and choose it.

        Its index is not that of the lesson: what a slide leaves of a text is two cells.
        """
        places = f'id => {PANEL}.content.widgets.findIndex(cell => cell.model.id === id)'
        index = self.page.evaluate(places, cell)
        shown = f"index => {PANEL}.content.widgets[index].node.classList.contains('deck-on')"
        while not self.page.evaluate(shown, index):
            self.page.keyboard.press('Space')
        while self.active() < index:
            self.page.keyboard.press('ArrowDown')
        self.wait_for_slide(index)
