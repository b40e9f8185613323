//! A certificate as it is read: what it says, and whether an authority has signed it. It does not look at dates: nothing
//! expires here, and a Pi has no clock.

use std::fmt;
use std::net::IpAddr;

use ring::digest::{SHA256, digest};
use ring::signature::{ECDSA_P256_SHA256_ASN1, UnparsedPublicKey};
use x509_parser::certificate::X509Certificate;
use x509_parser::extensions::GeneralName;
use x509_parser::pem::parse_x509_pem;
use x509_parser::prelude::FromDer;

/// The SHA-256 of a certificate.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fingerprint(pub [u8; 32]);

impl Fingerprint {
    /// Reads 64 lower-case hexadecimal digits.
    pub fn from_hex(text: &str) -> Option<Fingerprint> {
        let bytes = from_hex(text)?;
        bytes.try_into().ok().map(Fingerprint)
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&to_hex(&self.0))
    }
}

impl fmt::Debug for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// What a certificate says.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Certificate {
    /// The common name of its subject; empty when it has none.
    pub common_name: String,
    /// Its serial number, hexadecimal.
    pub serial: String,
    /// Its fingerprint.
    pub fingerprint: Fingerprint,
    /// Whether it may sign others.
    pub is_authority: bool,
    /// The hosts under which its node is reached, addresses and names.
    pub hosts: Vec<String>,
    /// The public key, as an uncompressed point of P-256.
    pub public_key: Vec<u8>,
    signed: Vec<u8>,
    signature: Vec<u8>,
}

/// Why a certificate is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum CertificateError {
    /// The text is no certificate.
    #[error("is no certificate (PEM of X.509 is expected)")]
    Form,
    /// Another authority has signed it.
    #[error("is not signed by the authority of this swarm")]
    Foreign,
    /// The authority's certificate is that of a node.
    #[error("is no authority's certificate: it may not sign others")]
    NoAuthority,
}

impl Certificate {
    /// Reads the first certificate of a text.
    ///
    /// # Errors
    /// There is none.
    pub fn from_pem(text: &str) -> Result<Certificate, CertificateError> {
        let (_, pem) = parse_x509_pem(text.as_bytes()).map_err(|_| CertificateError::Form)?;
        if pem.label != "CERTIFICATE" {
            return Err(CertificateError::Form);
        }
        Certificate::from_der(&pem.contents)
    }

    fn from_der(der: &[u8]) -> Result<Certificate, CertificateError> {
        let (rest, parsed) = X509Certificate::from_der(der).map_err(|_| CertificateError::Form)?;
        if !rest.is_empty() {
            return Err(CertificateError::Form);
        }
        let mut names = parsed.subject().iter_common_name();
        let common_name = names
            .next()
            .and_then(|name| name.as_str().ok())
            .unwrap_or_default();
        Ok(Certificate {
            common_name: common_name.to_owned(),
            serial: to_hex(parsed.raw_serial()),
            fingerprint: fingerprint(der),
            is_authority: parsed.is_ca(),
            hosts: hosts_of(&parsed),
            public_key: parsed.public_key().subject_public_key.data.to_vec(),
            signed: parsed.tbs_certificate.as_ref().to_vec(),
            signature: parsed.signature_value.data.to_vec(),
        })
    }

    /// Checks that an authority has signed this certificate.
    ///
    /// # Errors
    /// It has not, or it is no authority.
    pub fn check_signed_by(&self, authority: &Certificate) -> Result<(), CertificateError> {
        if !authority.is_authority {
            return Err(CertificateError::NoAuthority);
        }
        match authority.has_signed(&self.signed, &self.signature) {
            true => Ok(()),
            false => Err(CertificateError::Foreign),
        }
    }

    /// Returns whether the owner of this certificate has signed a text.
    pub fn has_signed(&self, text: &[u8], signature: &[u8]) -> bool {
        UnparsedPublicKey::new(&ECDSA_P256_SHA256_ASN1, &self.public_key)
            .verify(text, signature)
            .is_ok()
    }
}

/// Returns the fingerprint of a certificate's bytes (DER).
pub(super) fn fingerprint(der: &[u8]) -> Fingerprint {
    let mut bytes = [0; 32];
    bytes.copy_from_slice(digest(&SHA256, der).as_ref());
    Fingerprint(bytes)
}

/// Returns bytes as lower-case hexadecimal digits.
pub(super) fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Reads bytes from lower-case hexadecimal digits; `None` for anything else.
pub(super) fn from_hex(text: &str) -> Option<Vec<u8>> {
    let is_plain = text
        .bytes()
        .all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
    if !is_plain || !text.len().is_multiple_of(2) {
        return None;
    }
    (0..text.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(text.get(at..at + 2)?, 16).ok())
        .collect()
}

/// Returns the alternative names that are hosts; others are passed over.
fn hosts_of(certificate: &X509Certificate<'_>) -> Vec<String> {
    let Ok(Some(names)) = certificate.subject_alternative_name() else {
        return Vec::new();
    };
    let host = |name: &GeneralName<'_>| match name {
        GeneralName::DNSName(name) => Some((*name).to_owned()),
        GeneralName::IPAddress(bytes) => {
            let four = <[u8; 4]>::try_from(*bytes).map(IpAddr::from);
            four.or_else(|_| <[u8; 16]>::try_from(*bytes).map(IpAddr::from))
                .ok()
                .map(|address| address.to_string())
        }
        _ => None,
    };
    names.value.general_names.iter().filter_map(host).collect()
}
