import pytest

linter = pytest.importorskip('ament_copyright.main', reason='ament_copyright comes with ROS')


@pytest.mark.skip(reason='the source files of this package have no license headers yet')
@pytest.mark.copyright
@pytest.mark.linter
def test_copyright():
    assert linter.main(argv=['.', 'test']) == 0, 'files without copyright or license, see above'
