"""Sphinx's settings for `make site`. tools/site/__main__.py prepares what is read here."""

from tools.site.lexer import CellLexer

project = 'ROS 2 in notebooks'
extensions = ['myst_nb']

nb_execution_mode = 'off'  # the outputs are the saved ones
nb_merge_streams = True
myst_heading_anchors = 4
suppress_warnings = ['mystnb.unknown_mime_type']

html_theme = 'furo'
html_title = project
html_static_path = ['static']
html_css_files = ['site.css']
html_extra_path = ['downloads']
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_permalinks_icon = '#'
pygments_style = 'a11y-high-contrast-light'
pygments_dark_style = 'a11y-high-contrast-dark'


# What screen readers and keyboards miss in the pages of Sphinx, myst-nb and furo: the level of a
# heading in the menu, the words of a fold, and the key focus of what scrolls.
REPAIRS = [
    ('furo_navigation_tree', 'role="heading"', 'role="heading" aria-level="2"'),
    ('body', '<summary aria-label="Toggle hidden content">', '<summary>'),
    ('body', '<pre>', '<pre tabindex="0">'),
    ('body', '<div class="cell_output ', '<div tabindex="0" class="cell_output '),
    ('body', '<div class="table-wrapper ', '<div tabindex="0" class="table-wrapper '),
]


def repair(app, pagename, templatename, context, doctree):
    """Let assistive technology read a page; Sphinx calls this for each one."""
    for part, text, better in REPAIRS:
        if part in context:
            context[part] = context[part].replace(text, better)


def setup(app):
    """Colour a cell that writes a file as the file's language."""
    app.add_lexer('cell', CellLexer)
    app.connect('html-page-context', repair, priority=900)
