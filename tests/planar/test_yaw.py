"""Algorithm 1: known headings, turned accelerations, an iron offset, what cannot be."""

import numpy as np
import pytest

from navfuse.errors import InputError
from navfuse.planar import declination, hard_iron, magnetic_yaw, planar_dcm, to_north_east


def field_at(yaw, dip=0.0, horizontal=22.0):
    """Field in the body of a level vehicle: C_bn times (H, 0, V)."""
    return np.column_stack((horizontal * np.cos(yaw), -horizontal * np.sin(yaw), np.full_like(yaw, dip)))


@pytest.mark.parametrize(
    ("field", "yaw_deg"),
    [((1, 0), 0), ((0, -1), 90), ((-1, 0), 180), ((0, 1), -90), ((3, -3), 45), ((-2, 2), -135), ((-1, -1e-300), 180)],
)
def test_known_headings(field, yaw_deg):
    """Heading east, magnetic north is to the left: -y."""
    assert np.degrees(magnetic_yaw([field])[0]) == pytest.approx(yaw_deg, abs=1e-12)


def test_the_magnitude_and_the_vertical_component_do_not_matter():
    yaw = np.linspace(-np.pi + 1e-9, np.pi, 37)
    for scale in (1e-9, 1.0, 1e9):
        np.testing.assert_allclose(magnetic_yaw(scale * field_at(yaw, dip=40.0)), yaw, atol=1e-12)


def test_rows_without_a_field():
    assert np.isnan(magnetic_yaw([[np.nan, 1.0], [1.0, 0.0]])[0])
    with pytest.raises(InputError, match="row 2 is zero"):
        magnetic_yaw([[1.0, 0.0], [0.0, 0.0]])
    with pytest.raises(InputError, match=r"has shape \(3,\)"):
        magnetic_yaw([1.0, 2.0, 3.0])
    with pytest.raises(InputError, match=r"has shape \(1, 4\)"):
        magnetic_yaw(np.ones((1, 4)))


def test_accelerations_turn_to_north_and_east():
    """Heading east, forward is east and right is south."""
    turned = to_north_east([[2.0, 0.5, -9.8], [2.0, 0.5, -9.8]], [0.0, np.pi / 2.0])
    np.testing.assert_allclose(turned, [[2.0, 0.5], [-0.5, 2.0]], atol=1e-15)
    C = planar_dcm(0.3)
    np.testing.assert_allclose(C @ C.T, np.eye(2), atol=1e-15)
    with pytest.raises(InputError, match=r"yaw has shape \(1,\)"):
        to_north_east(np.ones((2, 2)), [0.0])


def test_declination_of_the_site_of_the_tutorial():
    """10 deg 42 min west, as its introduction of an offset has it; components of the World Magnetic Model 2025."""
    assert np.degrees(declination([21815.0, -4158.0, 43941.0])) == pytest.approx(-10.79, abs=0.005)


def test_offset_of_the_iron_is_found_by_a_circle():
    yaw = np.linspace(0.0, 6.0, 200)
    field = field_at(yaw, dip=41.0) + np.array([3.0, -7.0, 1.0])
    np.testing.assert_allclose(hard_iron(field), [3.0, -7.0], atol=1e-9)
    np.testing.assert_allclose(hard_iron(1e-6 * field[:, :2]), [3e-6, -7e-6], atol=1e-15)
    holed = field.copy()
    holed[5] = np.nan
    np.testing.assert_allclose(hard_iron(holed), [3.0, -7.0], atol=1e-9)
    with pytest.raises(InputError, match="of 8 sectors"):
        hard_iron(field[:40])
    with pytest.raises(InputError, match="7 rows are too few"):
        hard_iron(field[:7])
