"""Certificates for tests: an authority, and what it signs."""

from __future__ import annotations

import datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

BEFORE, AFTER = datetime.datetime(2020, 1, 1), datetime.datetime(2120, 1, 1)


def authority(folder: Path, name: str) -> tuple[Path, Path, Path]:
    """Write an authority's certificate, and a certificate it signed with its key; return the three paths."""
    own_key, key = (ec.generate_private_key(ec.SECP256R1()) for _ in range(2))
    own = _signed(f"{name} authority", own_key, f"{name} authority", own_key, True)
    cert = _signed(name, key, f"{name} authority", own_key, False)
    paths = folder / f"{name}-ca.pem", folder / f"{name}.pem", folder / f"{name}-key.pem"
    paths[0].write_bytes(own.public_bytes(serialization.Encoding.PEM))
    paths[1].write_bytes(cert.public_bytes(serialization.Encoding.PEM))
    paths[2].write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
    )
    return paths


def _signed(
    subject: str, key: ec.EllipticCurvePrivateKey, issuer: str, by: ec.EllipticCurvePrivateKey, ca: bool
) -> x509.Certificate:
    names = [x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)]) for name in (subject, issuer)]
    builder = x509.CertificateBuilder().subject_name(names[0]).issuer_name(names[1])
    builder = builder.public_key(key.public_key()).serial_number(x509.random_serial_number())
    builder = builder.not_valid_before(BEFORE).not_valid_after(AFTER)
    return builder.add_extension(x509.BasicConstraints(ca, None), critical=True).sign(by, hashes.SHA256())
