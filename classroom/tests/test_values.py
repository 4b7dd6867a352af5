"""The values for Zero to JupyterHub: the chart takes them, and the image has its JupyterHub."""

import json
import re
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft7Validator

CLASSROOM = Path(__file__).resolve().parents[1]
HUB = CLASSROOM / 'hub'
# The chart, and what its image has: images/hub/requirements.txt of the chart.
CHART = '4.4.0'
IN_ITS_IMAGE = {
    'jupyterhub': r'5\.5\.\d+',
    'jupyterhub-ltiauthenticator': r'1\.6\.3',
    'oauthenticator': r'17\.4\.0',
}


@pytest.mark.parametrize('name', sorted(path.name for path in HUB.glob('values*.yaml')))
def test_the_chart_takes_the_values(name):
    folder = CLASSROOM / 'tests/zero_to_jupyterhub'
    schema = json.loads((folder / 'values.schema.json').read_text())
    values = yaml.safe_load((HUB / name).read_text())
    problems = Draft7Validator(schema).iter_errors(values)
    # What is required stands in the chart's own values, to which these are added.
    problems = [one for one in problems if one.validator != 'required']
    assert [f'{one.json_path}: {one.message}' for one in problems] == []


def test_what_is_tried_here_is_what_the_image_of_the_chart_has():
    """`make hub` and the lessons' own image have its JupyterHub; test_logins.py has all three."""
    assert f'--version {CHART}' in (HUB / 'values.yaml').read_text()
    lock = (CLASSROOM.parent / 'tools/locks/requirements-logins.lock').read_text()
    hub = (CLASSROOM / 'requirements-hub.lock').read_text()
    for name, version in IN_ITS_IMAGE.items():
        assert re.search(rf'^{name}=={version} ', lock, re.MULTILINE), name
    assert re.search(rf'^jupyterhub=={IN_ITS_IMAGE["jupyterhub"]} ', hub, re.MULTILINE)
