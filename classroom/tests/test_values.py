"""The values for Zero to JupyterHub: the chart takes them, and the image has its JupyterHub."""

import json
import re
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft7Validator

CLASSROOM = Path(__file__).resolve().parents[1]
HUB = CLASSROOM / 'hub'
CHART = '4.4.0', '5.5'  # and its JupyterHub


@pytest.mark.parametrize('name', sorted(path.name for path in HUB.glob('values*.yaml')))
def test_the_chart_takes_the_values(name):
    folder = CLASSROOM / 'tests/zero_to_jupyterhub'
    schema = json.loads((folder / 'values.schema.json').read_text())
    values = yaml.safe_load((HUB / name).read_text())
    problems = Draft7Validator(schema).iter_errors(values)
    # What is required stands in the chart's own values, to which these are added.
    problems = [one for one in problems if one.validator != 'required']
    assert [f'{one.json_path}: {one.message}' for one in problems] == []


def test_hub_and_image_have_one_jupyterhub():
    chart, version = CHART
    assert f'--version {chart}' in (HUB / 'values.yaml').read_text()
    lock = (CLASSROOM / 'requirements-hub.lock').read_text()
    [ours] = re.findall(r'^jupyterhub==(\d+\.\d+)\.', lock, re.MULTILINE)
    assert ours == version
