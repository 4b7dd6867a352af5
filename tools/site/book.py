"""Print the pages, which Sphinx has joined into one, as a PDF file: WeasyPrint lays them out."""

from pathlib import Path


def write(page: Path, pdf: Path) -> Path:
    """Write the PDF of an HTML file; return it. Raises ValueError where Pango is missing."""
    try:
        from weasyprint import HTML
    except OSError as error:  # it loads Pango when it is imported
        raise ValueError(
            'The book needs the library Pango, which sets its letters: '
            'install it, on Debian with `sudo apt install libpangoft2-1.0-0 libharfbuzz-subset0`.'
        ) from error
    text = page.read_text(encoding='utf-8').replace('../_static/', '_static/')
    HTML(string=text, base_url=f'{page.parent}/').write_pdf(pdf)
    return pdf
