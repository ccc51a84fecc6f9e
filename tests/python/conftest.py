"""What several test files use."""

import resource

import pytest


@pytest.fixture
def full_disk():
    """full_disk(bytes): files cannot become larger, until the end of the test."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
