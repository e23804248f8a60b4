"""A Ray cluster for all tests of this folder."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def cluster():
    """Two Ray nodes of one CPU each; starting them takes long."""
    pytest.importorskip("ray", reason="Ray is not installed: pip install 'ffhnet[ray]'")
    from ray.cluster_utils import Cluster

    with pytest.MonkeyPatch.context() as patch:
        # The units of these tests are in no package that is installed on the nodes.
        folders = [str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
        patch.setenv("PYTHONPATH", os.pathsep.join(filter(None, folders)))
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
        cluster.add_node(num_cpus=1)
        yield cluster
        cluster.shutdown()
