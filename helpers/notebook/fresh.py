"""Lessons as a student opens them: without the outputs that the repository holds.

A lesson is saved with its outputs, for the tests and the web site. A student would read below each
guess what comes out. So `make lab`, the container and the hub open a lesson without them until the
student has saved it: from then on it holds the outputs of the student.
"""

from jupyter_server.services.contents.largefilemanager import AsyncLargeFileManager

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
        return model
