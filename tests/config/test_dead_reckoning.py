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
        ({"imu": {"file": "imu.csv"}}, r"imu: beside \[dead_reckoning\]; give one or the other"),
        ({"start": {"time_s": 3.0}}, r"start.time_s: not with \[dead_reckoning\]: cut the log"),
        ({"start": {"velocity_mps": [0.0, 0.0, 0.0]}}, "start.velocity_mps: not with .* come from the log"),
        ({"start": {"roll_deg": 1.0, "pitch_deg": 0.0, "heading_deg": 3.0}}, "start.roll_deg: not with"),
        ({"start": {"heading_deg": 3.0, "sd_attitude_deg": [1.0, 1.0, 1.0]}}, "start.sd_attitude_deg: not with"),
        ({"dead_reckoning": {"source": "trajectory"}}, 'heading_file: not read by source = "trajectory"; remove it'),
        ({"dead_reckoning": {"wheel_names": ["a"]}}, 'wheel_names: not read by source = "odometer"'),
        ({"dead_reckoning": {"sd_wheel_mps": 0.1}}, 'sd_wheel_mps: not read by source = "odometer"'),
        ({"dead_reckoning": {**WHEELS, "wheel_names": ["a", "a"]}}, 'wheel_names: "a" is there twice'),
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


def test_more_that_is_not_read():
    gnss = {"file": "gnss.csv"}
    for changes, message in (
        ({**WHEELS, "heading_offset_deg": 2.0}, "heading_offset_deg: not read without heading_file"),
        (
            {"source": "trajectory", "file": "t.csv", "heading_offset_deg": 2.0},
            'heading_offset_deg: not read by source = "trajectory"',
        ),
    ):
        with pytest.raises(ConfigError, match=message):
            any_project({"dead_reckoning": changes, "gnss": gnss})


@pytest.mark.parametrize("settings", [FILES["dead_reckoning"], WHEELS, {"source": "trajectory", "file": "t.csv"}])
def test_a_project_written_down_is_one_again(settings):
    made = DeadReckoningProject.from_dict(
        {"dead_reckoning": settings, "gnss": {"file": "g.csv"}, "start": {"heading_deg": 3.0}}
    )
    assert DeadReckoningProject.from_dict(tomllib.loads(made.to_toml())) == made
