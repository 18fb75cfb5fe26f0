"""Clusters that do not answer, are not Ray, or cannot be started."""

from __future__ import annotations

import socket

import pytest

from gbufrt.commands.arguments.checks import check_cluster
from gbufrt.commands.arguments.options import ClusterOptions
from gbufrt.commands.cluster.connection import open_cluster


def test_what_does_not_answer_is_told():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        with pytest.raises(ValueError, match=rf"nothing answers at --cluster 127.0.0.1:{port} .*ray start --head"):
            check_cluster(ClusterOptions(cluster=f"127.0.0.1:{port}"))


def test_a_host_that_cannot_be_one_is_told():
    with pytest.raises(ValueError, match=r"nothing answers at --cluster a\.\.b:6379"):
        check_cluster(ClusterOptions(cluster="a..b:6379"))


def test_what_answers_but_is_not_ray_is_told(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("gbufrt.commands.cluster.connection.SECONDS_TO_CONNECT", 2.0)
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        options = ClusterOptions(cluster=f"127.0.0.1:{other.getsockname()[1]}")
        check_cluster(options)
        with pytest.raises(ValueError, match="is not Ray"), open_cluster(options):
            pass


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("gbufrt.commands.arguments.checks.find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install 'gbufrt\[cluster\]'"):
        check_cluster(ClusterOptions(cluster="local"))
