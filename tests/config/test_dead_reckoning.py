"""The project file without an inertial sensor: template, keys, contradictions."""

import tomllib

import pytest

from navfuse.config import DeadReckoningProject, Project, any_project, help_keys, template
from navfuse.config.project import ProjectFile
from navfuse.errors import ConfigError

FILES = {
    "dead_reckoning": {"file": "odometer.csv", "heading_file": "heading.csv"},
    "gnss": {"file": "gnss.csv"},
}
WHEELS = {"source": "wheels", "file": "w.csv", "wheel_names": ["a", "b"], "wheel_places_m": [[0.0, -1.0], [0.0, 1.0]]}


def made(**changes):
    data = {name: dict(table) for name, table in FILES.items()}
    for name, values in changes.items():
        data.setdefault(name, {}).update(values)
    return data


def test_the_template_is_a_project_with_every_key():
    text = template(DeadReckoningProject)
    assert any_project(tomllib.loads(text)) == DeadReckoningProject.from_dict(FILES)
    for entry in help_keys(DeadReckoningProject):
        assert entry.description.endswith(".")
        assert f"\n{entry.key.split('.')[1]} = " in text.replace("\n#", "\n"), entry.key
    project = DeadReckoningProject.from_dict(FILES)
    assert DeadReckoningProject.from_dict(tomllib.loads(project.to_toml())) == project


def test_both_kinds_are_told_apart(tmp_path):
    path = tmp_path / "project.toml"
    path.write_text(DeadReckoningProject.from_dict(FILES).to_toml())
    found = any_project(path)
    assert isinstance(found, DeadReckoningProject)
    assert found.dead_reckoning.file == tmp_path / "odometer.csv"
    assert any_project(found) is found
    path.write_text('[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.csv"\n')
    assert isinstance(any_project(path), Project)
    with pytest.raises(TypeError, match="is not a project"):
        any_project(ProjectFile())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dead_reckoning": {"heading_fil": "x"}}, "did you mean dead_reckoning.heading_file"),
        ({"imu": {"file": "imu.csv"}}, "imu"),
        ({"dead_reckoning": {"source": "wheel"}}, 'must be "odometer" or "wheels" or'),
        ({"dead_reckoning": {"velocity_psd_m2ps3": -1.0}}, "must be >= 0"),
        ({"dead_reckoning": {**WHEELS, "wheel_places_m": [[0.0, 1.0]]}}, "2 wheel_names need as many places"),
        ({"dead_reckoning": {**WHEELS, "steered_wheels": ["c"]}}, '"c" is not in wheel_names'),
        ({"gnss": {"lever_arm_m": [0.0, 1.0, 0.0]}}, r"gnss.lever_arm_m: not with \[dead_reckoning\]"),
    ],
)
def test_what_is_refused(changes, message):
    with pytest.raises(ConfigError, match=message):
        any_project(made(**changes))


def test_what_is_missing():
    with pytest.raises(ConfigError, match="gnss.file: missing; dead reckoning is corrected by GNSS"):
        any_project({"dead_reckoning": FILES["dead_reckoning"]})
    for source in ("odometer", "body-velocity"):
        with pytest.raises(ConfigError, match=f'heading_file: missing; source = "{source}" needs headings'):
            any_project({"dead_reckoning": {"source": source, "file": "a.csv"}, "gnss": {"file": "b.csv"}})
