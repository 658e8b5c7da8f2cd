import pytest

linter = pytest.importorskip('ament_pep257.main', reason='ament_pep257 comes with ROS')


@pytest.mark.linter
@pytest.mark.pep257
def test_pep257():
    assert linter.main(argv=['.', 'test']) == 0, 'docstrings with errors, see above'
