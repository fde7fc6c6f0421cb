"""Nobody but its owner talks to a local cluster; a scheduler elsewhere is asked with certificates."""

from __future__ import annotations

import os
import socket
import ssl
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from generated import emps300_qm_qc
from modelgen.cli.main import app
from modelgen.errors import DataError
from modelgen.runtime.fleet.dask_cluster import Certificates, check_cluster, fleet_client

distributed: Any = pytest.importorskip("distributed")
dask: Any = pytest.importorskip("dask")
psutil: Any = pytest.importorskip("psutil")
pytest.importorskip("cryptography")

from cryptography.hazmat.primitives import serialization  # noqa: E402

from tests.security.certificates import authority  # noqa: E402 (needs cryptography)

MODULE = str(emps300_qm_qc.__file__)

# distributed leaves sockets and loops to the garbage collector
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


def intruder(ports: list[int], security: Any, protocol: str) -> None:
    """Try to become a client of each port."""
    for port in ports:
        with pytest.raises(OSError):
            distributed.Client(f"{protocol}://127.0.0.1:{port}", timeout=1.0, security=security).close()


def answer(port: int, context: ssl.SSLContext | None) -> bytes:
    """Return what a port answers to a plain request, without TLS or without a certificate."""
    with socket.create_connection(("127.0.0.1", port), 5.0) as plain:
        try:
            connected = plain if context is None else context.wrap_socket(plain)
            connected.settimeout(5.0)
            connected.sendall(b"GET /health HTTP/1.0\r\n\r\n")
            return connected.recv(100)
        except OSError:  # refused, by whichever side was quicker
            return b""


def test_only_its_owner_talks_to_a_local_cluster(
    processes: Path, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    scratch = tmp_path_factory.mktemp("scratch")
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    anyone = ssl._create_unverified_context()
    me = psutil.Process()
    before = {found.laddr.port for found in me.net_connections() if found.status == "LISTEN"}
    with fleet_client(workers=2) as client:
        assert client.submit(sum, [1, 2], pure=False).result(timeout=60.0) == 3
        running = [me, *me.children(recursive=True)]
        listening = [
            found.laddr
            for process in running
            for found in process.net_connections()
            if found.status == "LISTEN" and found.laddr.port not in before
        ]
        assert (
            len(listening) == 5
        )  # a scheduler, two nannies in this process, and two workers: no HTTP server
        assert {address.ip for address in listening} == {"127.0.0.1"}
        ports = [address.port for address in listening]
        for port in ports:
            assert answer(port, None) == answer(port, anyone) == b""
        intruder(ports[:1] + ports[-1:], None, "tcp")
        intruder(ports[:1], distributed.Security.temporary(), "tls")
        for process in running[1:]:
            seen = [*process.cmdline(), *process.environ().values()]
            assert not any("PRIVATE KEY" in text for text in seen)
        for path in scratch.rglob("*"):
            assert "PRIVATE KEY" not in (path.read_text(errors="replace") if path.is_file() else "")
        assert {path.name[:15]: path.stat().st_mode & 0o077 for path in scratch.iterdir()} == {
            "modelgen-fleet-": 0
        }
    assert list(scratch.iterdir()) == []
    assert list(processes.iterdir()) == []


@contextmanager
def tls_scheduler(files: tuple[Path, Path, Path]) -> Iterator[str]:
    ca, cert, key = map(str, files)
    security = distributed.Security(
        require_encryption=True,
        tls_ca_file=ca,
        **{f"tls_{role}_cert": cert for role in ("client", "scheduler", "worker")},
        **{f"tls_{role}_key": key for role in ("client", "scheduler", "worker")},
    )
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tls://",
        host="127.0.0.1",
        dashboard_address=":0",
        security=security,
    ) as cluster:
        yield cluster.scheduler_address


def test_a_scheduler_is_asked_with_certificates(processes: Path) -> None:
    good, foreign = authority(processes, "good"), authority(processes, "foreign")
    mixed = good[0], foreign[1], foreign[2]
    swapped = good[0], good[1], foreign[2]
    with tls_scheduler(good) as address:
        with fleet_client(address, certificates=Certificates(*map(str, good))) as client:
            assert client.submit(sum, [1, 2], pure=False).result(timeout=60.0) == 3
        for wrong in (foreign, mixed):
            with (
                pytest.raises(DataError, match=r"does not answer within 2 s .* one authority signed all"),
                fleet_client(address, timeout_s=2.0, certificates=Certificates(*map(str, wrong))),
            ):
                pass
        with (
            pytest.raises(DataError, match=r"cannot be used .* in PEM format"),
            fleet_client(address, certificates=Certificates(*map(str, swapped))),
        ):
            pass
        with pytest.raises(DataError, match=r"needs certificates; give --tls-ca-file"), fleet_client(address):
            pass
        with (
            pytest.raises(DataError, match="does not answer"),
            fleet_client("tcp" + address[3:], timeout_s=1.0),
        ):
            pass


@pytest.mark.parametrize("workers", [0, -1, -(10**9), 10**9, 2**70, True, 1.5])
def test_a_number_of_workers_that_cannot_be_started_is_refused_at_once(workers: Any) -> None:
    if workers is True:
        check_cluster(None, 1)
        return
    with pytest.raises(
        DataError, match=rf"--workers {workers}: is no number of processes to be started here"
    ):
        check_cluster(None, workers)


NO_ADDRESS = [
    "",
    " ",
    "nonsense",
    "tls://",
    "tls://host",
    "tls://host:0",
    "tls://host:65536",
    "tls://host:99999999999999999999",
    "tls://host:80/path",
    "http://host:8787",
    "inproc://a/b/c",
    "ucx://host:1",
    "tcp://user@host:1",
    "tcp://host:1\n",
    "tcp://ho st:1",
    "file:///etc/passwd",
    "tcp://" + "h" * 10**6,
]


@pytest.mark.parametrize("address", NO_ADDRESS, ids=range(len(NO_ADDRESS)))
def test_what_is_no_address_is_refused_before_anything_is_read(address: str) -> None:
    options = ["absent.csv", "--model", MODULE, "--cutoff-hz", "1", "--scheduler", address]
    result = CliRunner().invoke(app, ["fleet", *options])
    assert result.exit_code == 2
    assert "is no address of a scheduler; write it as dask scheduler prints it" in result.stderr
    assert len(result.stderr) < 500


def test_a_key_with_a_pass_phrase_is_refused_for_nobody_is_asked_for_it(tmp_path: Path) -> None:
    ca, cert, key = authority(tmp_path, "good")
    loaded = serialization.load_pem_private_key(key.read_bytes(), None)
    phrase = serialization.BestAvailableEncryption(b"phrase")
    for form in (serialization.PrivateFormat.PKCS8, serialization.PrivateFormat.TraditionalOpenSSL):
        key.write_bytes(loaded.private_bytes(serialization.Encoding.PEM, form, phrase))
        with pytest.raises(DataError, match=r"key.pem: is protected by a pass phrase"):
            check_cluster("tls://127.0.0.1:9", None, Certificates(*map(str, (ca, cert, key))))
        own = {"ca-file": ca, "client.cert": cert, "client.key": key}
        with (
            dask.config.set({f"distributed.comm.tls.{name}": str(path) for name, path in own.items()}),
            pytest.raises(DataError, match=r"key.pem: is protected by a pass phrase"),
            fleet_client("tls://127.0.0.1:9"),
        ):
            pass


@pytest.mark.parametrize("place", range(3))
def test_certificates_are_regular_files_of_a_bounded_size(tmp_path: Path, place: int) -> None:
    large, pipe = tmp_path / "large.pem", tmp_path / "pipe.pem"
    large.write_bytes(b"x" * 1_000_001)
    os.mkfifo(pipe)
    for path, reason in ((large, "is larger than 1 MB"), (pipe, "it is a pipe"), (tmp_path, "a folder")):
        paths = [str(path) for path in authority(tmp_path, "good")]
        paths[place] = str(path)
        with pytest.raises(DataError, match=reason):
            check_cluster("tls://127.0.0.1:9", None, Certificates(*paths))


def test_certificates_are_given_together_for_tls_and_must_exist(tmp_path: Path) -> None:
    asked = ["fleet", "absent.csv", "--model", MODULE, "--cutoff-hz", "1"]
    tls = ["--scheduler", "tls://127.0.0.1:9"]
    whole = ["--tls-ca-file", "a", "--tls-cert", "b", "--tls-key", "c"]
    expected = {
        (*tls, "--tls-cert", "b"): "--tls-ca-file, --tls-key: is missing",
        (*tls, *whole): "a: cannot be read (No such file or directory); give a PEM file",
        ("--scheduler", "tcp://127.0.0.1:9", *whole): "write tls:// before the host",
        tuple(whole): "a local cluster makes its own",
        (*tls, "--workers", "2"): "leave it out, or leave out --scheduler",
    }
    for options, message in expected.items():
        result = CliRunner().invoke(app, [*asked, *options])
        assert result.exit_code == 2
        assert message in result.stderr
