import pytest

linter = pytest.importorskip('ament_flake8.main', reason='ament_flake8 comes with ROS')


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8():
    code, complaints = linter.main_with_errors(argv=[])
    assert code == 0, '\n'.join(complaints)
