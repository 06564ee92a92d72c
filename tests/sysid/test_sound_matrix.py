"""A sample of the matrix of sound joints; all of it by `python -m tests.sysid.sound_matrix`."""

from tests.sysid.sound_matrix import CELLS, alarm


def test_a_sample_of_sound_joints_in_cells_of_sampling_drive_and_noise_raises_no_alarm():
    """Ten cases in five cells: with alarms in 2 % of them, more than 2 come in one of a thousand."""
    assert sum(alarm(40 + each, cell) for cell in CELLS[::5] for each in range(2)) <= 2
