"""Sphinx's settings for `make site`. tools/site/__main__.py prepares what is read here."""

import os
from html import escape

from docutils import nodes

from tools.site.lexer import CellLexer

project = 'ROS 2 in notebooks'
extensions = ['myst_nb']

nb_execution_mode = 'off'  # the outputs are the saved ones
nb_merge_streams = True
myst_heading_anchors = 4
myst_enable_extensions = ['attrs_block']  # a class of a paragraph
suppress_warnings = ['mystnb.unknown_mime_type']

html_theme = 'furo'
html_title = project
html_static_path = ['static']
html_css_files = ['site.css']
html_extra_path = ['downloads']
html_js_files = ['sidebar.js', 'paper.js']
html_favicon = 'static/icon.svg'
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


# A person who shares a link sees these. A preview picture needs an address with a host: SITE_URL,
# where the site is published.
ADDRESS = os.environ.get('SITE_URL', '').rstrip('/')
DESCRIPTION = (
    'Learn ROS 2 in notebooks: write the programs of a robot, watch why it crashes, mend it.'
)
MOST = 200  # letters of a description


def description(pagename, doctree):
    """Return what a page is about, in one line: its first paragraph that is a sentence or more."""
    if doctree is None or pagename == 'index':
        return DESCRIPTION
    texts = (' '.join(part.astext().split()) for part in doctree.findall(nodes.paragraph))
    text = next((text for text in texts if len(text) > 40 and '. ' in f'{text} '), DESCRIPTION)
    return text if len(text) <= MOST else f'{text[:MOST].rpartition(" ")[0]} …'


def preview(app, pagename, templatename, context, doctree):
    """Say to who shows a link what is behind it; Sphinx calls this for each page."""
    title = context.get('title') or app.config.project
    about = {
        'og:type': 'website',
        'og:site_name': app.config.project,
        'og:title': title if pagename != 'index' else app.config.project,
        'og:description': description(pagename, doctree),
        'og:image': f'{ADDRESS}/_static/preview.png' if ADDRESS else '',
        'og:url': f'{ADDRESS}/{pagename}.html' if ADDRESS else '',
        'twitter:card': 'summary_large_image' if ADDRESS else '',
    }
    found = [f'<meta name="description" content="{escape(about["og:description"])}">']
    found += [
        f'<meta property="{name}" content="{escape(text)}">' for name, text in about.items() if text
    ]
    context['metatags'] = '\n'.join([context.get('metatags', ''), *found])


def repair(app, pagename, templatename, context, doctree):
    """Let assistive technology read a page; Sphinx calls this for each one."""
    for part, text, better in REPAIRS:
        if part in context:
            context[part] = context[part].replace(text, better)


def setup(app):
    """Colour a cell that writes a file as the file's language."""
    app.add_lexer('cell', CellLexer)
    app.connect('html-page-context', preview)
    app.connect('html-page-context', repair, priority=900)
