"""Certificates of a cluster elsewhere: which files they are, and what dask needs to show and check them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from modelgen.errors import DataError
from modelgen.read_file import CERTIFICATE, read_bytes

# what stands in each of the forms that a protected key has in a PEM file
PROTECTED = b"ENCRYPTED"
OPTIONS = {"--tls-ca-file": "ca_file", "--tls-cert": "cert", "--tls-key": "key"}


@dataclass(frozen=True)
class Certificates:
    """Files (PEM) with which a scheduler and this client know each other; named as dask names them.

    Attributes
    ----------
    ca_file : str
        Certificate of the authority that signed those of the scheduler and of its workers.
    cert, key : str
        Own certificate, signed by the same authority, and its private key.
    """

    ca_file: str
    cert: str
    key: str


def check_certificates(certificates: Certificates) -> None:
    """Check that the files are there, and that none asks for a pass phrase.

    Raises
    ------
    DataError
        OpenSSL would ask for the phrase on the terminal, where nobody may sit.
    """
    for option, name in OPTIONS.items():
        _refuse_protected(f"{option} {getattr(certificates, name)}", getattr(certificates, name))


def _refuse_protected(where: str, path: str) -> None:
    if PROTECTED in read_bytes(path, CERTIFICATE):
        what = "is protected by a pass phrase, which cannot be asked for"
        raise DataError.at(where, what, "give a key without: openssl pkey -in KEY -out NEW")


def security_of(distributed: Any, certificates: Certificates | None, where: str) -> Any:
    """Return how to show and check certificates; without files, as dask's configuration says.

    Raises
    ------
    DataError
    """
    if certificates is None:
        security = distributed.Security(require_encryption=True)
        if not (security.tls_ca_file and security.tls_client_cert):
            remedy = "give --tls-ca-file, --tls-cert and --tls-key"
            raise DataError.at(where, "needs certificates", remedy)
        for held in (security.tls_client_cert, security.tls_client_key):
            if held and "\n" not in held:  # else it is the text itself
                _refuse_protected(held, held)
    else:
        security = distributed.Security(
            require_encryption=True,
            tls_ca_file=certificates.ca_file,
            tls_client_cert=certificates.cert,
            tls_client_key=certificates.key,
        )
    try:
        security.get_connection_args("client")
    except (OSError, ValueError) as error:  # of ssl: no certificate, or a key that does not fit it
        remedy = "give files in PEM format, and the key that the certificate was made for"
        raise DataError.at(", ".join(OPTIONS), f"cannot be used ({error})", remedy) from error
    return security
