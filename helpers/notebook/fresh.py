"""Lessons as a student opens them: without the outputs that the repository holds.

A lesson is saved with its outputs, for the tests and the web site. A student would read below each
guess what comes out. So `make lab`, the container and the hub open a lesson without them until the
student has saved it: from then on it holds the outputs of the student.
"""

import sys

from jupyter_server.services.contents.largefilemanager import AsyncLargeFileManager

# What a kernel says of its language. JupyterLab writes it into a notebook that has another one, and
# then calls a lesson that nobody has touched unsaved.
LANGUAGE = {
    'name': 'python',
    'version': sys.version.split()[0],
    'mimetype': 'text/x-python',
    'codemirror_mode': {'name': 'ipython', 'version': sys.version_info[0]},
    'pygments_lexer': 'ipython3',
    'nbconvert_exporter': 'python',
    'file_extension': '.py',
}
MARK = 'ros2_notebooks'
AS_SAVED = 'with the outputs of the repository'


class FreshLessons(AsyncLargeFileManager):
    """Reads and writes files as JupyterLab does, and opens a lesson of the repository empty."""

    async def get(self, path, content=True, **options) -> dict:
        model = await super().get(path, content=content, **options)
        notebook = model['content']
        if model['type'] == 'notebook' and content and notebook.metadata.pop(MARK, None):
            for cell in notebook.cells:
                if cell.cell_type == 'code':
                    cell.outputs, cell.execution_count = [], None
            notebook.metadata['language_info'] = LANGUAGE
        return model
